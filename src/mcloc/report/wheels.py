"""Where the wheels alone say that the robot went, for the distance driven and for kidnappings."""

from collections.abc import Iterable, Iterator

import numpy as np

from mcloc.events import Event, Odometry
from mcloc.geometry import Pose
from mcloc.report.rows import Rows
from mcloc.trajectory import Trajectory


class Wheels:
    """Odometry poses picked out of a stream of events.

    Of a log whose scans carry poses of their own these are taken, else those of its odometry
    events. Late and repeated stamps and poses that are not finite are left out.
    """

    def __init__(self) -> None:
        self.scans, self.odometry = Rows(4), Rows(4)  # t, x, y, θ

    def watch(self, events: Iterable[Event]) -> Iterator[Event]:
        """The events, noted as they pass."""
        for event in events:
            self.note(event)
            yield event

    def note(self, event: Event) -> None:
        """Pick the pose out of an event."""
        if isinstance(event, Odometry):
            _note(self.odometry, event.t, event.pose)
        elif event.odometry is not None:
            _note(self.scans, event.t, event.odometry)

    @property
    def trajectory(self) -> Trajectory | None:
        """In the odometry's own frame; None where nothing is known."""
        noted = (self.scans if len(self.scans) else self.odometry).table
        return Trajectory(noted[:, 0], noted[:, 1:]) if len(noted) else None


def _note(rows: Rows, t: float, pose: Pose) -> None:
    if np.isfinite(t) and np.isfinite(pose).all() and (not len(rows) or t > rows.last[0]):
        rows.add(t, *pose)
