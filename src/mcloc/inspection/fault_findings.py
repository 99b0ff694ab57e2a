"""A fault that was found, in words. Some cannot be told apart by scans and odometry alone: robots
mostly drive forwards, so if the wheels say so, too, it is the laser that looks the other way.
"""

import math

from mcloc.geometry import Pose, wrap
from mcloc.inspection.consistency import Comparison
from mcloc.inspection.faults import DEGREES, LENGTHS, STILL, Fault
from mcloc.inspection.finding import Finding
from mcloc.inspection.path import Path


def tell(name: str, found: Comparison, mount: Pose, path: Path) -> Finding:
    """What is wrong with the laser of this name and mount (3,), or with the odometry."""
    fault = found.fault
    so = "the robot never moved" if fault is STILL else "this is so"
    evidence = (
        f"over {found.pairs} pairs of scans, what both saw lies {found.stated:.2f} m apart as the"
        f" log has it, and {found.faulty:.2f} m if {so}"
    )
    backwards = math.isclose(fault.yaw, math.pi) and path.backward > path.forward
    if fault.mirrored or (fault.yaw != 0.0 and not backwards):
        check, what, remedy = _laser(fault, mount)
        return Finding(check, name, what, evidence, remedy)
    check, what, remedy = _odometry(fault)
    return Finding(check, "odometry", what, evidence, remedy)


def _laser(fault: Fault, mount: Pose) -> tuple[str, str, str]:
    """check, what, remedy."""
    heading = math.degrees(wrap(mount[2] + fault.yaw))
    x, y, heading = (round(value, 3) + 0.0 for value in (*mount[:2], heading))  # no −0
    left = math.degrees(wrap(fault.yaw))
    side = "left" if left > 0.0 else "right"
    turned = f"the laser looks {abs(left):.0f}° farther to the {side} than stated"
    turn = f"--mount {x:g},{y:g},{heading:g} (m, m, degrees)"
    if not fault.mirrored:
        return "laser-yaw", turned, turn
    what = "left and right are swapped, in the scans or in the odometry"
    remedy = "reverse the order of the beams; or negate y and θ of the odometry"
    if fault.yaw != 0.0:
        return "laser-mirrored", f"{what}, and {turned}", f"{remedy}; and {turn}"
    return "laser-mirrored", what, remedy


def _odometry(fault: Fault) -> tuple[str, str, str]:
    """check, what, remedy."""
    if fault is STILL:
        return (
            "odometry-contradicts",
            "odometry and scans contradict each other, and no single fault explains it",
            "check units, signs and stamps of the odometry, and the laser's mount",
        )
    if fault is DEGREES:
        return (
            "odometry-unit",
            "θ of the odometry is in degrees",
            "give θ in radians: multiply it by π/180",
        )
    if fault in LENGTHS:
        return (
            "odometry-unit",
            f"x and y of the odometry are {1.0 / fault.length:g} times what they are in metres",
            f"multiply them by {fault.length:g}",
        )
    if fault.turn < 0.0:
        return (
            "odometry-turn-sign",
            "θ of the odometry grows to the right",
            "negate θ of the odometry: it must grow to the left",
        )
    return (
        "odometry-reversed",
        "the odometry says that the robot drives backwards, where the scans see it go ahead",
        "negate x and y of the odometry; if the robot did drive backwards, turn the laser's mount"
        " by 180°",
    )
