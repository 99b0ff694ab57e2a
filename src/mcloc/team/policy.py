"""When what two robots tell each other is used, and how much of it is news  [Fox01 §19.4.1]."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from mcloc.geometry import Pose
from mcloc.localizer.policy import LEAST_NOVELTY
from mcloc.registry import Configurable, param


@dataclass(frozen=True)
class TeamPolicy(Configurable):
    """When a detection is used, and how finely the wheels are followed in between.

    Two robots that see each other again tell each other what they told before, and what they had
    from each other. So a detection of the same two is ignored within a window of time, unless one
    of them has moved far enough since the last one that was used [Fox01 §19.4.1]. After the window
    it counts by what the wheels have made new: as much as the farther one of them has moved of that
    distance. On MRCLAM 6 with landmarks for one robot that took the NEES of the others from 17 to
    10, and their errors were the same; of the wheels alone it is 15.
    """

    window: float = param(10.0, "s", "between two detections of the same robots", low=0, high=1e5)
    distance: float = param(
        2.5, "m", "that one of them has to move to have news", above=0, high=1e5
    )
    coast: float = param(
        0.5, "m", "update by the wheels alone after driving (or m·rad turning) so far", above=0,
        high=1e3,
    )  # fmt: skip

    def due(self, since: float, moved: float) -> bool:
        """Whether a detection is used, so many seconds after the last one of the same robots, of
        which one has moved so far (m).
        """
        return since >= self.window or moved >= self.distance

    def novelty(self, moved: float) -> float:
        """How much of what the two tell is news, LEAST_NOVELTY … 1."""
        return min(max(moved / self.distance, LEAST_NOVELTY), 1.0)


class Used(NamedTuple):
    """A detection that was used: at t (s), with the wheels of both, by name."""

    t: float
    at: Mapping[str, Pose]


def farther(at: Mapping[str, Pose], before: Mapping[str, Pose]) -> float:
    """Metres that the one of several robots has moved that has moved farthest, by their wheels."""
    return max(float(np.hypot(*(at[name] - before[name])[:2])) for name in at)
