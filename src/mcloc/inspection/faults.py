"""v = ⊖m ⊕ u ⊕ m: how a laser at m moved while the robot moved by u, under each single fault that
a log may have.
"""

import math
from dataclasses import dataclass

import numpy as np

from mcloc.geometry import Pose, between, compose, inverse


@dataclass(frozen=True, slots=True)
class Fault:
    """What may be wrong with a laser or the odometry.

    yaw: rad, how much farther to the left the laser looks than its mount says. mirrored: its beams
    go the other way round, or the wheels' world is a mirror image; scans and odometry alone do not
    tell which. turn: −1 where θ of the odometry grows to the right, x and y being right. length,
    angle: what its lengths and θ are to be multiplied by. still: the robot does not move at all.
    """

    name: str
    yaw: float = 0.0
    mirrored: bool = False
    turn: float = 1.0
    length: float = 1.0
    angle: float = 1.0
    still: bool = False

    def move(self, a: Pose, b: Pose) -> Pose:
        """(3,): the robot's motion between two odometry poses, were this the fault."""
        scale = np.array([self.length, self.length, self.turn * self.angle])
        return between(scale * a, scale * b)

    def motion(self, a: Pose, b: Pose, mount: Pose) -> Pose:
        """(3,): the laser's motion, in the frame that its own beams are given in."""
        if self.still:
            return np.zeros(3)
        at = mount + np.array([0.0, 0.0, self.yaw])
        moved = compose(inverse(at), compose(self.move(a, b), at))
        return moved * np.array([1.0, -1.0, -1.0]) if self.mirrored else moved


NONE = Fault("none")
STILL = Fault("still", still=True)
NO_WAY = Fault("no way", length=0.0)  # the robot turns as stated, on the spot

TURNED = tuple(Fault(f"yaw {d}", yaw=math.radians(d)) for d in (90, 180, 270))
MIRRORED = (
    Fault("mirrored", mirrored=True),
    *(Fault(f"mirrored, yaw {d}", yaw=math.radians(d), mirrored=True) for d in (90, 180, 270)),
)
SIGN = Fault("turn sign", turn=-1.0)

# The wheels' moves are then other ones than they seem: which scans are some steps apart has to be
# judged anew for each of these.
LENGTHS = tuple(Fault(f"length {scale:g}", length=scale) for scale in (1e-3, 1e-2, 1e2, 1e3))
DEGREES = Fault("degrees", angle=math.pi / 180.0)
