"""Where the wheels alone say that the robot went, for the distance driven and for kidnappings."""

from collections.abc import Iterable, Iterator

import numpy as np

from mcloc.events import Event, Odometry
from mcloc.geometry import Pose
from mcloc.trajectory import Trajectory


class Wheels:
    """Odometry poses picked out of a stream of events.

    Of a log whose scans carry poses of their own these are taken, else those of its odometry
    events. Late and repeated stamps and poses that are not finite are left out.
    """

    def __init__(self) -> None:
        self._scans: list[tuple[float, Pose]] = []
        self._odometry: list[tuple[float, Pose]] = []

    def watch(self, events: Iterable[Event]) -> Iterator[Event]:
        """The events, noted as they pass."""
        for event in events:
            if isinstance(event, Odometry):
                _note(self._odometry, event.t, event.pose)
            elif event.odometry is not None:
                _note(self._scans, event.t, event.odometry)
            yield event

    @property
    def trajectory(self) -> Trajectory | None:
        """In the odometry's own frame; None where nothing is known."""
        noted = self._scans or self._odometry
        if not noted:
            return None
        return Trajectory(np.array([t for t, _ in noted]), np.array([pose for _, pose in noted]))


def _note(noted: list[tuple[float, Pose]], t: float, pose: Pose) -> None:
    if np.isfinite(t) and np.isfinite(pose).all() and (not noted or t > noted[-1][0]):
        noted.append((t, pose))
