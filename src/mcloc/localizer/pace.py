"""How long an update keeps the filter busy; the scans that come meanwhile are lost, under the
real-time conditions of [Fox01 §19.2.5; Fox99].
"""

from dataclasses import dataclass
from typing import ClassVar, Protocol

from mcloc.localizer.estimate import Update
from mcloc.registry import Configurable, Registry, param


class Pace(Protocol):
    """How fast the robot's computer is."""

    @property
    def clocked(self) -> bool:
        """Whether it goes by the time that updates take here."""

    def seconds(self, update: Update, beams: int) -> float:
        """How long the filter is busy with an update, in the time of the log.

        update: what it found, and by how much work. beams: used of its scan.
        """


@dataclass(frozen=True)
class Offline(Configurable):
    """The replay waits for the filter: no scan is ever lost."""

    clocked: ClassVar[bool] = False

    def seconds(self, update: Update, beams: int) -> float:
        return 0.0


@dataclass(frozen=True)
class Measured(Configurable):
    """An update takes as long as it took here, times slowdown. What is lost depends on the machine
    and on what else it does: no function of the seed.
    """

    clocked: ClassVar[bool] = True

    slowdown: float = param(
        1.0, "", "how many times slower the robot's computer is", above=0, high=1e6
    )

    def seconds(self, update: Update, beams: int) -> float:
        return self.slowdown * update.duration


@dataclass(frozen=True)
class Modelled(Configurable):
    """An update takes particle_beam for each pose weighed and beam used, whatever it took here:
    one seed, one result.

    A step that is drawn twice costs twice; what a filter for people looks at is not counted. The
    default is a machine of 1999: 1,000 particles take 0.2 s for 60 beams, so that scans at the 5 Hz
    of the simulator are lost above 1,000, as they were in [Fox01 §19.2.5]; 5,000 take 1.0 s, where
    the paper says "consistently less than 3 seconds".
    """

    clocked: ClassVar[bool] = False

    particle_beam: float = param(
        3.3e-6, "s", "time for each pose weighed and beam used", above=0, high=1
    )

    def seconds(self, update: Update, beams: int) -> float:
        return self.particle_beam * update.info.weighed * beams


PACES: Registry[Pace] = Registry(
    "pace", {"offline": Offline, "measured": Measured, "modelled": Modelled}
)
