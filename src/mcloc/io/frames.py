"""Where one frame lies in another: T_ac = T_ab T_bc along the tree of frames, then seen from above.

T is (4, 4), a rotation with a translation in metres; quaternions are x, y, z, w. Frames are called
as in tf2, without the leading slash of the first tf.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcloc.geometry import Pose

Transform = NDArray[np.float64]

LEAST_NORM = 1e-6  # of a quaternion; one of length 0 was never set


def transform(translation: ArrayLike, quaternion: ArrayLike) -> Transform:
    """(4, 4) of a translation (3,) and a quaternion (4,) of any length.

    All NaN where one of them is not finite or the quaternion is 0.
    """
    q = np.asarray(quaternion, dtype=np.float64)
    norm = float(np.hypot.reduce(q))
    matrix = np.eye(4)
    matrix[:3, 3] = translation
    if not (np.isfinite(matrix).all() and np.isfinite(norm) and norm >= LEAST_NORM):
        return np.full((4, 4), np.nan)
    x, y, z, w = (q / norm).tolist()
    matrix[:3, :3] = [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
        [2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)],
        [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)],
    ]
    return matrix


def planar(matrix: Transform) -> Pose:
    """(3,): x, y, and where the x axis points, seen from above."""
    return np.array([matrix[0, 3], matrix[1, 3], np.arctan2(matrix[1, 0], matrix[0, 0])])


def upside_down(matrix: Transform) -> bool:
    """Whether the z axis points down: what turns left in the frame turns right seen from above."""
    return bool(matrix[2, 2] < 0.0)


def tilt(matrix: Transform) -> float:
    """Radians between the z axis, up or down, and the vertical: 0 … π/2."""
    return float(np.arctan2(np.hypot(matrix[0, 2], matrix[1, 2]), abs(matrix[2, 2])))


class Frames:
    """A tree of frames as it becomes known, edge by edge; of two edges to one frame the first one
    stays. Nothing here breaks on a loop.
    """

    def __init__(self) -> None:
        self._parents: dict[str, tuple[str, Transform]] = {}

    def add(self, parent: str, child: str, matrix: Transform) -> bool:
        """Whether this is news: a frame not known before, and a transform that is finite."""
        if child in self._parents or not np.isfinite(matrix).all():
            return False
        self._parents[child] = (parent, matrix)
        return True

    def find(self, base: str, frame: str) -> Transform | None:
        """(4, 4) of the pose of `frame` in `base`, or None where no chain joins them."""
        above = self._above(frame)
        for ancestor, base_in_ancestor in self._above(base).items():
            if ancestor in above:
                with np.errstate(all="ignore"):
                    found = _inverse(base_in_ancestor) @ above[ancestor]
                return found if np.isfinite(found).all() else None
        return None

    def _above(self, frame: str) -> dict[str, Transform]:
        """The pose of `frame` in itself and in every frame above it, nearest first."""
        poses = {frame: np.eye(4)}
        at = frame
        while at in self._parents:
            parent, matrix = self._parents[at]
            if parent in poses:
                break
            with np.errstate(all="ignore"):
                poses[parent] = matrix @ poses[at]
            at = parent
        return poses


def _inverse(matrix: Transform) -> Transform:
    turned = matrix[:3, :3].T
    inverse = np.eye(4)
    inverse[:3, :3] = turned
    inverse[:3, 3] = -turned @ matrix[:3, 3]
    return inverse


def frame_name(name: str) -> str:
    """A frame's name without leading slashes."""
    return name.lstrip("/")
