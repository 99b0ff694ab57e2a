"""What other robots tell."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from mcloc.errors import ConfigError
from mcloc.events.measured import Measured
from mcloc.geometry import Pose


@dataclass(frozen=True, eq=False, slots=True)
class Message(Measured):
    """What another robot told of where this one is: a density tree, of places x, y or of poses x,
    y, θ, map frame.

    t: seconds, of the moment that it is about. low … weight: the tree, as of DensityTree, and
    floor. p_false: the chance that the detection behind it was none; then each place, or pose, has
    the density `even` (1/m² or 1/(m² rad)), > 0. odometry, novelty, source: as of a Scan; the
    source names the other robot. Raises ConfigError for a tree of no such axes.
    """

    called: ClassVar[str] = "message"
    empty: ClassVar[str] = "message that says nothing"
    repeats: ClassVar[bool] = False
    own: ClassVar[bool] = False  # it is the other one who may be lost
    conclusive: ClassVar[bool] = False

    t: float
    low: NDArray[np.float64]
    side: NDArray[np.float64]
    axis: NDArray[np.uint64]
    split: NDArray[np.float64]
    child: NDArray[np.uint64]
    corner: NDArray[np.float64]
    width: NDArray[np.float64]
    weight: NDArray[np.float64]
    floor: float
    p_false: float
    even: float
    source: str
    odometry: Pose | None = None
    novelty: float = 1.0

    def __post_init__(self) -> None:
        if len(self.low) not in (2, 3):
            raise ConfigError(
                f"a message is of places x, y or poses x, y, θ, got {len(self.low)} axes"
            )

    @property
    def useful(self) -> bool:
        """Whether anything is told."""
        return self.p_false < 1.0
