"""E2: p(y | x) of one laser scan over all places of a map  [Fox01 §19.2.2, Fig. 19.2]."""

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mcloc.evaluation.intervals import mean
from mcloc.events import Scan
from mcloc.experiments.places import files, recorded
from mcloc.experiments.places import missing as missing_log
from mcloc.experiments.study import Claim, Finding, Study, Verdict
from mcloc.experiments.table import Record, Setting, Table
from mcloc.geometry import Pose, compose
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.report.picture import BELIEVED, LOST, TRUE, draw_grid
from mcloc.sensors.beam_presets import Fox01Beams
from mcloc.simulation import Laser, office_world
from mcloc.simulation.office import CORRIDOR

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage

OFFICE, WEAN = "generated office", "wean"
LOGS = ("wean-1", "wean-3", "wean-4")
BEAMS = (4.0, 12.0, 60.0)  # that the 60 used ones are worth
OWN = 12.0  # of mcloc
RASTER = 0.2  # m
HEADINGS = 180
NEAR = 1.0  # m
CLEAR = 0.35  # m from the robot's centre to a wall
TURNED = float(np.deg2rad(15.0))  # at most, from the way of the corridor
EXPECTED = 4.0  # m, of the beam whose density is drawn
NOT_FREE = "#cfe0f3"
FAINTEST = -20.0  # log10 of p(y | x) to the best, in the picture

ABOUT = """
One scan that was taken in the main corridor, and no knowledge of the place: the posterior over all
free places of the map and all headings, which is p(y | x) normalized. Places are 0.2 m apart,
headings 2°; half of each changed the part in the corridor by 0.03 at most, in five scans of Wean
Hall. The sensor model is the paper's: ray casting in the map, then a mixture of the correct
reading with Gaussian noise, a max-range reading, and exponential noise (`beam-fox01`; the paper
gives no weights, these are mcloc's: 0.8, 0.1 and 0.1).

- The paper does not say how the beams of a scan are combined. mcloc counts the 60 beams that it
  uses as 12 independent ones, since neighbours see the same surface. *beams* = 60 is the full
  product, 4 a much smoother likelihood.
- *generated office*: another floor for each seed, and a scan with 181 beams up to 10 m from
  anywhere in its corridor, 0.35 m clear of the walls, either way along it and turned by up to 15°.
  There is one corridor.
- *wean*: for each seed one of the scans of three recorded logs that were taken in the long corridor
  in which all three drive: the strip within 1.5 m of the straight line from (5, 42.9) to
  (56, 38.9) m, its middle in the map. The map has other corridors, and people walk in one log.
- *In the corridor* is the part of the posterior there, beside the part of the free floor that the
  corridor is. *Near the truth* is the part within 1 m of it: the claim is that the robot is
  somewhere in the corridor, not that it knows where.
"""


class Strip(NamedTuple):
    """A corridor: all within `half` metres of the line from start to end, metres, map frame."""

    start: tuple[float, float]
    end: tuple[float, float]
    half: float

    def holds(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """(N,): which of the points (N, 2) lie in it."""
        way = np.subtract(self.end, self.start)
        length = float(np.hypot(*way))
        x, y = (points - self.start).T / length
        ahead, aside = way[0] * x + way[1] * y, way[0] * y - way[1] * x
        inside: NDArray[np.bool_] = (ahead >= 0) & (ahead <= length) & (np.abs(aside) <= self.half)
        return inside

    def outline(self) -> NDArray[np.float64]:
        """(5, 2): its corners, the first one twice."""
        way = np.subtract(self.end, self.start)
        aside = self.half * np.array([-way[1], way[0]]) / np.hypot(*way)
        corners = [self.start + aside, self.end + aside, self.end - aside, self.start - aside]
        return np.array([*corners, corners[0]])


OFFICE_CORRIDOR = Strip(
    (0.0, sum(CORRIDOR) / 2), (20.0, sum(CORRIDOR) / 2), (CORRIDOR[1] - CORRIDOR[0]) / 2
)
WEAN_CORRIDOR = Strip((5.0, 42.9), (56.0, 38.9), 1.5)


@dataclass(frozen=True, eq=False)
class Case:
    """A scan, where it was truly taken, and the corridor that this was in."""

    grid: OccupancyGrid
    scan: Scan
    truth: Pose
    corridor: Strip


def case(place: str, seed: int) -> Case:
    """The scan of a seed."""
    rng = np.random.default_rng(seed)
    if place == WEAN:
        return _recorded(rng)
    grid, laser = office_world(seed), Laser()
    strip = OFFICE_CORRIDOR
    x = rng.uniform(strip.start[0] + 0.5, strip.end[0] - 0.5)
    y = rng.uniform(CORRIDOR[0] + CLEAR, CORRIDOR[1] - CLEAR)
    heading = rng.choice([0.0, np.pi]) + rng.uniform(-TURNED, TURNED)
    truth = np.array([x, y, heading])
    ranges = laser.measure(grid, truth[None], rng)[0]
    return Case(
        grid,
        Scan(0.0, ranges, laser.angles, laser.range_max, np.array(laser.mount)),
        truth,
        strip,
    )


def _recorded(rng: np.random.Generator) -> Case:
    """Any scan of the three logs that was taken in the corridor."""
    scans, truths = [], []
    for log in LOGS:
        drive = recorded(log)
        some = [event for event in drive.events if isinstance(event, Scan)]
        scans += some
        truths.append(drive.truth.at(np.array([scan.t for scan in some])))
    poses = np.concatenate(truths)
    chosen = int(rng.choice(np.flatnonzero(WEAN_CORRIDOR.holds(poses[:, :2]))))
    return Case(recorded(LOGS[0]).grid, scans[chosen], poses[chosen], WEAN_CORRIDOR)


def missing(setting: Setting) -> str | None:
    """What a setting lacks here: Wean Hall needs all three logs."""
    if setting["place"] != WEAN:
        return None
    found = (missing_log({"place": log}) for log in LOGS)
    return next((why for why in found if why is not None), None)


def spacing(grid: OccupancyGrid) -> int:
    """Cells from one place to the next."""
    return max(1, round(RASTER / grid.resolution))


def free_places(grid: OccupancyGrid) -> NDArray[np.intp]:
    """(P, 2): row and column of the free cells that are looked at."""
    every = spacing(grid)
    first = every // 2
    return np.argwhere(grid.free[first::every, first::every]) * every + first


def points_of(grid: OccupancyGrid, cells: NDArray[np.intp]) -> NDArray[np.float64]:
    """(P, 2): the middles of cells, metres, map frame."""
    middles = (cells[:, ::-1] + 0.5) * grid.resolution
    return compose(grid.origin, np.insert(middles, 2, 0.0, axis=1))[:, :2]


def log_likelihood(
    given: Case, points: NDArray[np.float64], headings: int = HEADINGS
) -> NDArray[np.float64]:
    """(P, H): log p(y | x) at the points (P, 2) with H headings each, evenly around, for a scan
    that is worth mcloc's number of beams.
    """
    sensor = Fox01Beams(given.grid, effective_beams=OWN)
    around = (np.arange(headings) + 0.5) * 2.0 * np.pi / headings - np.pi
    x = np.empty((3, len(points), headings))
    x[0], x[1], x[2] = points[:, :1], points[:, 1:], around
    return sensor.log_likelihood(x.reshape(3, -1), given.scan).reshape(len(points), headings)


@lru_cache(maxsize=1)  # the settings of a place differ by a factor alone
def computed(place: str, seed: int) -> tuple[Case, NDArray[np.float64], NDArray[np.float64]]:
    """The scan of a seed, the free places (P, 2) and log p(y | x) there (P, H)."""
    given = case(place, seed)
    points = points_of(given.grid, free_places(given.grid))
    return given, points, log_likelihood(given, points)


def posterior(log_p: NDArray[np.float64]) -> NDArray[np.float64]:
    """(P,): p(x | y) of each place, whatever the heading, from a uniform prior."""
    p = np.exp(log_p - log_p.max()).sum(axis=1)
    share: NDArray[np.float64] = p / p.sum()
    return share


def run(setting: Setting, seed: int) -> Record:
    """Where one scan says that the robot may be."""
    given, points, log_p = computed(str(setting["place"]), seed)
    p = posterior(float(setting["beams"]) / OWN * log_p)
    inside = given.corridor.holds(points)
    away = np.hypot(*(points - given.truth[:2]).T)
    return {
        "in_corridor": float(p[inside].sum()),
        "floor": float(inside.mean()),
        "near": float(p[away <= NEAR].sum()),
        "best_off_m": float(away[p.argmax()]),
    }


def corridor(table: Table) -> Finding:
    """More likely there than anywhere else together."""
    found = []
    for place in table.values("place"):
        for beams in table.values("beams"):
            rows = table.where(place=place, beams=beams)
            figure = mean(rows.column("in_corridor"))
            near, floor = rows.column("near").mean(), rows.column("floor").mean()
            told = (
                f"{place}, {beams:g} beams: {figure} on {floor:.2f} of the floor, "
                f"{near:.2f} near the truth"
            )
            found.append((figure, f"{place}, {beams:g} beams", told))
    holds = [figure.low > 0.5 for figure, _, _ in found]
    figure, where, _ = min(found, key=lambda one: one[0].value)
    return Finding(
        Verdict.REPRODUCED if all(holds) else Verdict.IN_PART if any(holds) else Verdict.NOT,
        f"the part of the posterior in the main corridor, the least ({where})",
        figure,
        f"{'; '.join(told for _, _, told in found)}.",
    )


def draw(table: Table, figure: "Figure") -> None:
    """As in the paper: scan in the map, p(y | x) of a reading and over the map. And the shares."""
    cells = figure.add_gridspec(2, 3, width_ratios=(1.2, 1.2, 1.0))
    maps, shown = [], None
    for k, place in enumerate(table.values("place")):
        given, _, log_p = computed(str(place), table.where(place=place).rows[0].seed)
        _draw_scan(figure.add_subplot(cells[k, 0]), given, f"One scan, {place}")
        maps.append(figure.add_subplot(cells[k, 1]))
        shown = _draw_likelihood(maps[-1], given, log_p.max(axis=1))
        if k == 0:
            _draw_density(figure.add_subplot(cells[0, 2]), given)
    if shown is not None:
        bar = figure.colorbar(shown, ax=maps, location="bottom", aspect=30, extend="min")
        bar.set_label("log₁₀ of p(y | x) to that of the best place")
    _draw_shares(figure.add_subplot(cells[1, 2]), table)


def _draw_scan(axes: "Axes", given: Case, title: str) -> None:
    draw_grid(axes, given.grid)
    sensor, seen = compose(given.truth, given.scan.mount), given.scan.returned
    ends = compose(sensor, _polar(given.scan.ranges[seen], given.scan.angles[seen]))
    axes.plot(ends[:, 0], ends[:, 1], ".", color=LOST, ms=2)
    _frame(axes, given, title)


def _polar(r: NDArray[np.float64], angle: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.stack([r * np.cos(angle), r * np.sin(angle), angle], axis=1)


def _draw_likelihood(axes: "Axes", given: Case, best: NDArray[np.float64]) -> "AxesImage":
    """Of the best heading at each place; the darker, the more likely. What is not free is blue."""
    grid, cells = given.grid, free_places(given.grid)
    every = spacing(grid)
    image = np.full(cells.max(axis=0) // every + 1, np.nan)
    image[tuple((cells // every).T)] = (best - best.max()) / np.log(10.0)
    first = (every // 2 + 0.5 - every / 2) * grid.resolution
    height, width = first + np.array(image.shape) * every * grid.resolution
    x, y, _ = grid.origin  # the maps of this study are not turned
    extent = (x + first, x + width, y + first, y + height)
    shown = axes.imshow(image, cmap="Greys", vmin=FAINTEST, vmax=0.0, origin="lower", extent=extent)
    axes.set_facecolor(NOT_FREE)
    _frame(axes, given, "p(y | x), best heading")
    return shown


def _frame(axes: "Axes", given: Case, title: str) -> None:
    """The free floor, the corridor's outline, the truth."""
    points = points_of(given.grid, free_places(given.grid))
    (left, bottom), (right, top) = points.min(axis=0) - 1.0, points.max(axis=0) + 1.0
    axes.plot(*given.corridor.outline().T, "--", color=BELIEVED, lw=1.0)
    axes.plot(*given.truth[:2], "o", color=TRUE, ms=9, mfc="none", mew=1.5)
    axes.set(xlim=(left, right), ylim=(bottom, top), aspect="equal", title=title)
    axes.set(xlabel="x [m]", ylabel="y [m]")


def _draw_density(axes: "Axes", given: Case) -> None:
    """Per metre, and at the end the probability of no return."""
    sensor, reach = Fox01Beams(given.grid), given.scan.range_max
    z = np.linspace(0.0, reach, 1000, endpoint=False)
    density = sensor.density(np.append(z, reach), np.array(EXPECTED), reach)
    axes.plot(z, density[:-1], color=BELIEVED, lw=1.5)
    axes.plot([reach, reach], [0.0, density[-1]], color=BELIEVED, lw=3.0)
    axes.annotate("no return", (reach, density[-1]), (0, 6), textcoords="offset points", ha="right")
    axes.axvline(EXPECTED, color="0.6", lw=0.8, ls="--")
    axes.set(xlabel="reading z [m]", ylabel="p(z | x) [1/m]", ylim=(0.0, None))
    axes.set_title(f"One beam, {EXPECTED:g} m expected")


def _draw_shares(axes: "Axes", table: Table) -> None:
    """A dot for each seed, the mean with its interval, and the corridor's part of the floor."""
    ticks: list[str] = []
    for place in table.values("place"):
        label = str(place).removeprefix("generated ")
        axes.text(len(ticks) + (len(BEAMS) - 1) / 2, 1.07, label, ha="center")
        for beams in table.values("beams"):
            k, rows = len(ticks), table.where(place=place, beams=beams)
            found = rows.column("in_corridor")
            axes.plot(np.full(len(found), k), found, "o", color=BELIEVED, ms=4, alpha=0.25, mew=0)
            told = mean(found)
            ends = np.clip([told.low, told.high], 0.0, 1.0)
            axes.plot([k + 0.25] * 2, ends, color=BELIEVED)
            axes.plot(k + 0.25, told.value, "D", color=BELIEVED, ms=4)
            axes.hlines(rows.column("floor").mean(), k - 0.3, k + 0.4, color=LOST, lw=1.5)
            ticks.append(f"{beams:g}")
    axes.set_xticks(range(len(ticks)), ticks)
    axes.plot([], [], "D", color=BELIEVED, ms=4, label="of the posterior (mean, 95 %)")
    axes.plot([], [], color=LOST, lw=1.5, label="of the floor")
    axes.set(ylim=(-0.05, 1.6), yticks=np.linspace(0.0, 1.0, 6), ylabel="part in the corridor")
    axes.set(xlabel="effective beams", title="How much is in the corridor")
    axes.legend(loc="upper center", frameon=False, fontsize="small")
    axes.grid(axis="y", alpha=0.3)


STUDY = Study(
    number="E2",
    title="What one laser scan says of the place",
    source="Fox01 §19.2.2 and Fig. 19.2",
    about=ABOUT,
    factors={"place": (OFFICE, WEAN), "beams": BEAMS},
    run=run,
    metrics={
        "in_corridor": "part in the corridor",
        "floor": "part of the floor",
        "near": "part within 1 m of the truth",
        "best_off_m": "best place off, m",
    },
    claims=(
        Claim(
            "From a single scan the robot assigns high likelihood to being somewhere in the main "
            "corridor",
            "a picture in which the main corridor is dark",
            "in the office nearly all for 12 and 60 beams, since nothing else there looks like its "
            "one corridor, and the place in it is known too. In Wean Hall about a half: it has "
            "several corridors, and a few metres before their ends these look alike. With 4 beams "
            "about a half in both. Reproduced: the mean part of the posterior in the corridor has "
            "a 95 % interval above 0.5 in every setting; in part: in some",
            corridor,
        ),
    ),
    draw=draw,
    seeds=40,
    missing=missing,
    inputs=files,
)
