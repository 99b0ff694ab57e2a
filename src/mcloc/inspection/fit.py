"""Does the log fit the map? A robot that is searched for on the whole map, from several moments of
the log on, is found at least once, if this is the map.

How well it is found, the share of returns tells that end at walls. It says much where it is large,
and little where it is not: a search may fail on the right map, too.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mcloc.events import Scan
from mcloc.filters.catalog import Composition
from mcloc.inspection.faults import Fault
from mcloc.inspection.finding import Finding
from mcloc.inspection.log_inspection import LogInspection
from mcloc.inspection.path import Path
from mcloc.localizer import Localizer
from mcloc.maps.occupancy import OccupancyGrid

SEED = 1
PARTICLES = 100_000
FOUND = 0.9  # share of returns at walls; recorded logs reached 0.94 and more on their own maps …
ELSEWHERE = 0.75  # … and 0.44 to 0.86 on those of other places: below this, it is another one
LARGER = 1.5  # × the diagonal of the free space, to allow for the drift of wheels

# How the names of checks begin whose findings do not keep from comparing.
HARMLESS = ("clock", "stamps", "returns")

Window = Sequence[Scan]

_MIRROR = np.array([1.0, -1.0, -1.0])
_FLIPPED = "mirrored map"
TOGETHER = "map and log"


@dataclass(frozen=True, slots=True)
class Fit:
    """verdict: "fits", "undecided", "does not fit", or "not compared" where the log is too short or
    map or log look wrong by themselves. explained: the best share of returns that end at walls,
    0 … 1; None where it was not looked for. windows: parts of the log that were tried.
    """

    verdict: str
    explained: float | None = None
    windows: int = 0


def inspect_fit(
    grid: OccupancyGrid, log: LogInspection, before: Iterable[Finding]
) -> tuple[Fit, list[Finding]]:
    """Look for the robot on the map; where it is not found, with other faults mended, too.

    before: what was found in the map and in the log.
    """
    if any(not finding.check.startswith(HARMLESS) for finding in before):
        return Fit("not compared"), []
    too_small = inspect_path(grid, log.path)
    if too_small is not None:
        return Fit("does not fit"), [too_small]
    windows = log.windows.chosen
    if not windows:
        return Fit("not compared"), []
    stated = _best(grid, windows)
    if stated >= FOUND:
        return Fit("fits", stated, len(windows)), []
    shares: dict[str, float] = {}
    for name, scans in _mended(windows, log.open_faults()):
        shares[name] = _best(grid, scans)
        if shares[name] >= FOUND:
            finding = _explained_by(name, stated, shares[name])
            return Fit("does not fit", stated, len(windows)), [finding]
    if stated >= ELSEWHERE:
        return Fit("undecided", stated, len(windows)), []
    return Fit("does not fit", stated, len(windows)), [_nowhere(stated, len(windows), shares)]


def inspect_path(grid: OccupancyGrid, path: Path) -> Finding | None:
    """A robot cannot drive farther across than the free space reaches."""
    rows, columns = np.nonzero(grid.free)
    diagonal = float(np.hypot(np.ptp(rows) + 1, np.ptp(columns) + 1)) * grid.resolution
    if path.extent <= LARGER * diagonal:
        return None
    return Finding(
        "map-too-small",
        TOGETHER,
        "the robot drives over more ground than the map's free space covers",
        f"{path.extent:.1f} m across by its odometry, {diagonal:.1f} m across on the map",
        "check that the map is of this place, its resolution, and the unit of the odometry",
    )


def _mended(
    windows: Sequence[Window], faults: Iterable[Fault]
) -> Iterator[tuple[str, list[list[Scan]]]]:
    """The windows as they are if everything is mirrored, and under each fault of the laser."""
    yield _FLIPPED, [[_mirrored(scan) for scan in window] for window in windows]
    for fault in faults:
        yield fault.name, [[_with(scan, fault) for scan in window] for window in windows]


def _best(grid: OccupancyGrid, windows: Iterable[Window]) -> float:
    """The share of returns at walls in the best window, or in the first that is good enough."""
    best = 0.0
    for window in windows:
        best = max(best, _search(grid, window))
        if best >= FOUND:
            break
    return best


def _search(grid: OccupancyGrid, window: Window) -> float:
    """The mean share of returns at walls in the second half of a window."""
    filter = Composition("mcl", settings={"size": {"maximum": PARTICLES}})
    localizer = Localizer(grid, filter, seed=SEED)
    shares = [e.update.explained for e in localizer.run(window) if e.updated]
    late = np.array(shares[len(shares) // 2 :])
    return float(np.nanmean(late)) if np.isfinite(late).any() else 0.0


def _with(scan: Scan, fault: Fault) -> Scan:
    """The scan as it is if its laser has this fault."""
    angles = -scan.angles if fault.mirrored else scan.angles
    return replace(scan, angles=angles, mount=scan.mount + np.array([0.0, 0.0, fault.yaw]))


def _mirrored(scan: Scan) -> Scan:
    """Laser and wheels in the mirror: the same as a flipped map."""
    assert scan.odometry is not None
    return replace(
        scan, angles=-scan.angles, mount=_MIRROR * scan.mount, odometry=_MIRROR * scan.odometry
    )


def _explained_by(name: str, stated: float, mended: float) -> Finding:
    flipped = name == _FLIPPED
    return Finding(
        "map-mirrored" if flipped else "laser-does-not-fit-map",
        TOGETHER,
        "map and log are mirror images" if flipped else f"the laser seems to be wrong: {name}",
        f"searched for on the whole map, the robot sees {100 * stated:.0f} % of its returns end at"
        f" walls as it is, and {100 * mended:.0f} % so",
        "flip the map's image; or swap left and right in scans and odometry"
        if flipped
        else "give the laser's true pose with --mount; reverse the beams if they are mirrored",
    )


def _nowhere(stated: float, windows: int, mended: dict[str, float]) -> Finding:
    """Nothing explains it."""
    others = ", ".join(f"{name} {100 * share:.0f} %" for name, share in mended.items())
    return Finding(
        "log-does-not-fit-map",
        TOGETHER,
        "the robot is found nowhere on the map",
        f"searched for with up to {windows} parts of the log, it sees at best {100 * stated:.0f} %"
        f" of its returns end at walls, where {100 * FOUND:.0f} % are usual; with a {others}",
        "check that the map is of this place, its resolution, and the laser's --mount",
    )
