"""A few short parts of a log, evenly spread over it, as scans that a localizer would use."""

from mcloc.events import Scan
from mcloc.geometry import Pose, between
from mcloc.inspection.thinned import Thinned
from mcloc.localizer import UpdatePolicy

LENGTH = 40  # scans; a robot is mostly found after ten
LEAST = 10
MOST = 8  # kept while streaming, for …
USED = 4  # … windows in the end


class Windows:
    """Scans with their odometry, each a move after the last one, in windows of LENGTH."""

    def __init__(self) -> None:
        self._policy = UpdatePolicy()
        self._complete: Thinned[list[Scan]] = Thinned(MOST)
        self._current: list[Scan] = []
        self._last: Pose | None = None

    def add(self, scan: Scan) -> None:
        """The next scan, with its odometry."""
        if scan.odometry is None or not scan.returned.any():
            return
        if self._last is not None and not self._policy.due(between(self._last, scan.odometry)):
            return
        self._last = scan.odometry
        self._current.append(scan)
        if len(self._current) == LENGTH:
            self._complete.add(self._current)
            self._current = []

    @property
    def chosen(self) -> list[list[Scan]]:
        """At most USED windows; of a short log what there is, if that is at least LEAST scans."""
        complete = list(self._complete)
        if not complete:
            return [self._current] if len(self._current) >= LEAST else []
        used = min(len(complete), USED)
        return [complete[k * (len(complete) - 1) // max(used - 1, 1)] for k in range(used)]
