"""Path: how far the wheels say that the robot drove, and how."""

import math

import numpy as np

from mcloc.geometry import Pose

PIECE = 100.0  # m; on longer ways the drift of wheels may unroll a round trip


class Path:
    """Odometry poses one after the other, in the order of the file.

    count: poses. length: metres. forward, backward: metres along and against the robot's own
    heading. extent: metres, the diagonal of the smallest upright box around any PIECE of the way.
    """

    def __init__(self) -> None:
        self.count = 0
        self.length = self.forward = self.backward = self.extent = 0.0
        self._last: Pose = np.zeros(3)
        self._began = 0.0
        self._low = self._high = np.zeros(2)

    def add(self, pose: Pose) -> None:
        """The next pose (3,), odometry frame."""
        if self.count:
            dx, dy = pose[0] - self._last[0], pose[1] - self._last[1]
            ahead = float(dx * math.cos(self._last[2]) + dy * math.sin(self._last[2]))
            self.length += math.hypot(dx, dy)
            self.forward += max(ahead, 0.0)
            self.backward += max(-ahead, 0.0)
        if self.count == 0 or self.length > self._began + PIECE:
            self._began = self.length
            self._low = self._high = pose[:2]
        self.count += 1
        self._last = pose
        self._low = np.minimum(self._low, pose[:2])
        self._high = np.maximum(self._high, pose[:2])
        self.extent = max(self.extent, float(np.hypot(*(self._high - self._low))))
