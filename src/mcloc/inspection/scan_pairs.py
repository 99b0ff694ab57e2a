"""r = mean min(d, 0.5 m), d from each point that a scan saw, moved by −v, to the nearest point of a
later scan: small only for the motion v that the laser really made.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from mcloc.events import Scan
from mcloc.geometry import Pose, compose, inverse
from mcloc.inspection.faults import Fault
from mcloc.inspection.thinned import Thinned

FARTHEST = 15.0  # m; beyond, neighbouring beams lie too far apart
TRUNCATED = 0.5  # m: what the other scan does not see counts no more than that
POINTS = 90  # of the earlier scan, evenly spread; enough, and quick
LEAST_POINTS = 10  # of a scan, to be worth comparing
LARGEST_ROBOT = 100.0  # m from its centre to a laser

NEAR, FAR = 0.3, 1.5  # m between the two scans of a pair …
LITTLE, MUCH = math.radians(10.0), math.radians(45.0)  # … or a turn by that much
MOST_PAIRS = 200


@dataclass(frozen=True, eq=False, slots=True)
class Pair:
    """Two scans of one laser. earlier, later: (n, 2) endpoints, metres, laser frame. a, b: (3,)
    odometry poses. mount: (3,).
    """

    earlier: NDArray[np.float64]
    later: NDArray[np.float64]
    a: Pose
    b: Pose
    mount: Pose

    def residuals(self, faults: Sequence[Fault]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """(F,) r under each fault, and (F,) how far on average its points lie from those of the
        first one, metres.
        """
        motions = [fault.motion(self.a, self.b, self.mount) for fault in faults]
        points = np.stack([self._seen_after(motion) for motion in motions])
        tree = cKDTree(self.later)
        distances, _ = tree.query(points, distance_upper_bound=TRUNCATED)
        apart = np.linalg.norm(points - points[0], axis=2)
        return np.minimum(distances, TRUNCATED).mean(axis=1), apart.mean(axis=1)

    def _seen_after(self, motion: Pose) -> NDArray[np.float64]:
        """(n, 2): the earlier endpoints in the laser's frame after the motion."""
        headless = np.column_stack([self.earlier, np.zeros(len(self.earlier))])
        return compose(inverse(motion), headless)[:, :2]


class Pairs:
    """Pairs of scans that follow each other after a move that is worth comparing, if this is the
    fault; at most MOST_PAIRS, evenly spread over the log.
    """

    def __init__(self, fault: Fault) -> None:
        self.fault = fault
        self.kept: Thinned[Pair] = Thinned(MOST_PAIRS)
        self._last: Scan | None = None

    def add(self, scan: Scan) -> None:
        """The next scan, with its odometry."""
        last = self._last
        if last is None or last.odometry is None or scan.odometry is None:
            self._last = scan
            return
        dx, dy, turn = scan.odometry - last.odometry
        distance = self.fault.length * math.hypot(dx, dy)
        if not math.isfinite(distance + turn):
            self._last = scan
            return
        angle = abs(math.remainder(self.fault.angle * turn, math.tau))
        if not self._enough(distance, angle):
            return
        if distance <= FAR and angle <= MUCH:
            self._pair(last, scan, last.odometry, scan.odometry)
        self._last = scan

    def _enough(self, distance: float, angle: float) -> bool:
        """For a wrong unit the move has to be one that shows it."""
        if self.fault.length != 1.0:
            return distance >= NEAR
        if self.fault.angle != 1.0:
            return angle >= LITTLE
        return distance >= NEAR or angle >= LITTLE

    def _pair(self, first: Scan, second: Scan, a: Pose, b: Pose) -> None:
        earlier, later = _endpoints(first), _endpoints(second)
        on_board = np.abs(first.mount[:2]).max() < LARGEST_ROBOT
        if min(len(earlier), len(later)) >= LEAST_POINTS and on_board:
            some = np.linspace(0, len(earlier) - 1, min(len(earlier), POINTS)).astype(np.intp)
            self.kept.add(Pair(earlier[some], later, a, b, first.mount))


def _endpoints(scan: Scan) -> NDArray[np.float64]:
    """(n, 2) metres, laser frame: where the returns that are not too far lie."""
    near = scan.returned & (scan.ranges < FARTHEST)
    r, angle = scan.ranges[near], scan.angles[near]
    return np.column_stack([r * np.cos(angle), r * np.sin(angle)])
