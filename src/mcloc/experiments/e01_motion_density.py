"""E1: where wheels alone lead, p(x' | x, u) of long moves and of a path  [Fox01 §19.2.2, Fig. 19.1;
Fox99 Fig. 1].
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mcloc.draws import Draws
from mcloc.evaluation.intervals import Interval, mean, paired_ratio
from mcloc.experiments.study import Claim, Finding, Study, Verdict
from mcloc.experiments.table import Record, Setting, Table
from mcloc.motion.odometry import OdometryMotion
from mcloc.registry import parameters
from mcloc.statespace import States

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Move = NDArray[np.float64]

SAMPLES = 10_000
MOVES = (40.0, 80.0)  # m, straight ahead
LEGS = (15.0, 15.0, 30.0)  # m of the path, between them a quarter turn to the left
STOPS = (10.0, 20.0, 30.0, 40.0, 50.0, 60.0)  # m along the path
STEPS = (0.25, 1.0)  # m
NOISES = (0.5, 1.0, 2.0)  # times mcloc's own
CLEARLY = -0.5  # correlation
MOST_TOLD = 3  # settings in which a claim fails
COMMAND = "#c0392b"

ABOUT = """
A robot that knows its start exactly drives by odometry alone: 10,000 samples are moved step by
step with mcloc's odometry motion model, and no scan is ever used. It drives 80 m straight ahead,
of which the first 40 m are the shorter move; and a path of 60 m with two quarter turns to the
left, whose sample sets are looked at each 10 m.

- The papers give neither the noise nor how often it is drawn. Here it is mcloc's default (for each
  metre of a step 0.05 rad in heading and 10 % in distance, at least 0.01 rad and 0.01 m), drawn
  each 0.25 m, which is about how often mcloc takes a step. Errors of steps are independent, so
  longer steps make more noise: with 1 m headings vary 1.6 times as much. Both are swept: steps of
  0.25 and 1 m, half and twice the noise. A quarter turn is made on the spot, in pieces of no more
  radians than a step has metres.
- *Bend* says how much of a banana a density is: the correlation, over the samples, of the
  deviation along the way with the square of that across it. Samples far to the side of a banana
  lie back, so it is negative; in a Gaussian it is 0 whatever the covariance, and one with the same
  covariance is sampled beside it. For a heading that walks at random, and no other noise, it would
  be −0.98.
- *Across* is the standard deviation across the way. Its closed form is told beside what was
  sampled; for small angles it grows with distance^1.5.
- *Spread* along the path is the root of the mean squared distance of the samples to their mean,
  which is what the eye takes for the size of a set. The area of their covariance would be nearly 0
  for a thin banana, and leap where the robot turns. Neither must grow for ever: where a robot comes
  back, the errors of its heading on the way out cancel. So the path leads away from its start.
  What the area does is told too.
"""


def model(noise: float) -> OdometryMotion:
    """mcloc's odometry motion model with `noise` times its deviations."""
    usual = OdometryMotion()
    kept = ("p_reverse", "loose")
    deviations = [f.name for f in parameters(usual) if f.name not in kept]
    return replace(usual, **{name: noise * getattr(usual, name) for name in deviations})


def straight(length: float, step: float) -> list[Move]:
    """Steps straight ahead."""
    return [np.array([step, 0.0, 0.0])] * round(length / step)


def path(step: float) -> list[Move]:
    """The path with turns, in steps."""
    pieces = math.ceil(np.pi / 2 / step)
    turn = [np.array([0.0, 0.0, np.pi / 2 / pieces])] * pieces
    first, *others = (straight(leg, step) for leg in LEGS)
    return first + [move for leg in others for move in turn + leg]


def sample_sets(
    moves: Sequence[Move], motion: OdometryMotion, seed: int, stops: Sequence[float]
) -> list[States]:
    """(3, N) samples each time that so many metres have been driven, from a start at 0, 0, 0."""
    x, driven, found = np.zeros((3, SAMPLES)), 0.0, list[States]()
    for n, move in enumerate(moves):
        x = motion.sample(x, move, Draws(seed, n), 0)
        driven += float(move[0])
        # The tolerance is for the rounding of a sum of many steps.
        if len(found) < len(stops) and driven > stops[len(found)] - 1e-6:
            found.append(x)
    return found


def predicted_across(length: float, step: float, motion: OdometryMotion) -> float:
    """The standard deviation across a straight move, exactly: √Var of Σ_k (d + η_k) sin θ_k.

    θ_k, the heading in which step k is driven, is the sum of 2k − 1 turning errors of variance s²,
    and the cosine of a normal angle of variance v has the mean exp(−v/2).
    """
    one = motion.decompose(np.array([step, 0.0, 0.0]))
    k = np.arange(1, round(length / step) + 1)
    apart = 2.0 * np.abs(np.subtract.outer(k, k)) * one.sd_rot1**2
    together = 4.0 * (2.0 * np.minimum.outer(k, k) - 1.0) * one.sd_rot1**2 + apart
    driven = step**2 + one.sd_trans**2 * np.eye(len(k))
    return math.sqrt(0.5 * float(np.sum(driven * (np.exp(-apart / 2) - np.exp(-together / 2)))))


def bend(x: States) -> float:
    """Correlation of the deviation along the x axis with the square of that across it."""
    along, across = x[:2] - x[:2].mean(axis=1, keepdims=True)
    return float(np.corrcoef(along, across**2)[0, 1])


def spread(x: States) -> float:
    """Metres: root of the mean squared distance to the mean."""
    return math.sqrt(float(x[:2].var(axis=1).sum()))


def area(x: States) -> float:
    """m²: √det of the covariance of the positions."""
    return math.sqrt(float(np.linalg.det(np.cov(x[:2]))))


def run(setting: Setting, seed: int) -> Record:
    """Move one sample set straight ahead, and one along the path."""
    step, motion = float(setting["step"]), model(float(setting["noise"]))
    near, far = sample_sets(straight(MOVES[-1], step), motion, seed, MOVES)
    along_path = sample_sets(path(step), motion, seed, STOPS)
    gaussian = np.random.default_rng(seed).multivariate_normal(
        far[:2].mean(axis=1), np.cov(far[:2]), SAMPLES
    )
    return {
        "bend_40": bend(near),
        "bend_80": bend(far),
        "bend_gaussian": bend(gaussian.T),
        "across_40_m": float(near[1].std()),
        "predicted_40_m": predicted_across(MOVES[0], step, motion),
        "across_80_m": float(far[1].std()),
        "predicted_80_m": predicted_across(MOVES[1], step, motion),
        "spread_end_m": spread(along_path[-1]),
        "spreads_m": [round(spread(x), 4) for x in along_path],
        "areas_m2": [round(area(x), 4) for x in along_path],
    }


def by_setting(table: Table) -> list[tuple[str, bool, Table]]:
    """Each setting in words, whether its noise is mcloc's, and its rows."""
    return [
        (
            f"steps of {step:g} m, noise × {noise:g}",
            noise == 1.0,
            table.where(step=step, noise=noise),
        )
        for step in table.values("step")
        for noise in table.values("noise")
    ]


def judged(found: list[tuple[Interval, bool, str, bool]], what: str, worst: int) -> Finding:
    """The verdict of many figures: (figure, whether it shows the claim, where, mcloc's noise).

    Those with mcloc's noise decide. worst: which of their ends is nearest to failing, 1 the
    highest, −1 the lowest.
    """
    own = [one for one in found if one[3]]
    holds = [shown for _, shown, _, _ in own]
    figure, _, where, _ = max(own, key=lambda one: worst * one[0].value)
    values = [one[0].value for one in found]
    failed = [w for _, shown, w, _ in found if not shown]
    which = f"; not so {'; '.join(failed[:MOST_TOLD])}" if failed else ""
    note = (
        f"Over all settings {min(values):.2f} to {max(values):.2f}; it holds in "
        f"{len(found) - len(failed)} of {len(found)}{which}{', …' if failed[MOST_TOLD:] else ''}."
    )
    verdict = Verdict.REPRODUCED if all(holds) else Verdict.IN_PART if any(holds) else Verdict.NOT
    return Finding(verdict, f"{what} ({where})", figure, note)


def bananas(table: Table) -> Finding:
    """Samples to the side lie back."""
    found = []
    for where, own, rows in by_setting(table):
        for move in MOVES:
            figure = mean(rows.column(f"bend_{move:.0f}"))
            found.append((figure, figure.high < CLEARLY, f"after {move:.0f} m, {where}", own))
    gaussian = float(np.abs(table.column("bend_gaussian")).max())
    finding = judged(found, "the bend that is nearest to 0", 1)
    return replace(finding, note=f"{finding.note} A Gaussian has at most ±{gaussian:.2f}.")


def widen(table: Table) -> Finding:
    """After 80 m the density is wider than after 40 m."""
    found = []
    for where, own, rows in by_setting(table):
        figure = paired_ratio(rows.column("across_80_m"), rows.column("across_40_m"))
        found.append((figure, figure.low > 1.0, where, own))
    return judged(found, "deviation across the way after 80 m to that after 40 m, the least", -1)


def spreading(table: Table) -> Finding:
    """Each set along the path is larger than the one before."""
    found = []
    least_area = math.inf
    for where, own, rows in by_setting(table):
        spreads, areas = stacked(rows, "spreads_m"), stacked(rows, "areas_m2").mean(axis=0)
        least_area = min(least_area, float((areas[1:] / areas[:-1]).min()))
        for k in range(1, len(STOPS)):
            figure = paired_ratio(spreads[:, k], spreads[:, k - 1])
            found.append((figure, figure.low > 1.0, f"at {STOPS[k]:.0f} m, {where}", own))
    finding = judged(found, "spread of a set to that of the one 10 m before, the least", -1)
    note = f"{finding.note} The area grows by {least_area:.2f} at least."
    return replace(finding, note=note)


def stacked(rows: Table, metric: str) -> NDArray[np.float64]:
    """(seeds, stops): a metric along the path."""
    return np.array([record[metric] for record in rows.records()])


def draw(table: Table, figure: "Figure") -> None:
    """Both densities as in Fox01, the sets along the path as in Fox99, and how they grow."""
    seed, step, motion = table.rows[0].seed, STEPS[0], model(1.0)
    cells = figure.add_gridspec(2, 6, height_ratios=(1.25, 1.0))
    near, far, along = (figure.add_subplot(cells[0, k : k + 2]) for k in (0, 2, 4))
    sets = sample_sets(straight(MOVES[-1], step), motion, seed, MOVES)
    for axes, x, move in zip((near, far), sets, MOVES, strict=True):
        _draw_density(axes, x, move)
    _draw_path(along, sample_sets(path(step), motion, seed, STOPS))
    _draw_across(figure.add_subplot(cells[1, :3]), table)
    _draw_spreads(figure.add_subplot(cells[1, 3:]), table)
    figure.legend(loc="outside lower center", ncols=3, frameon=False)


def _draw_density(axes: "Axes", x: States, move: float) -> None:
    """The darker, the more samples."""
    across, up = (-55.0, 55.0), (-8.0, 92.0)
    axes.hist2d(-x[1], x[0], bins=(110, 100), range=(across, up), cmap="Greys", norm="log", cmin=1)
    axes.plot([0.0, 0.0], [0.0, move], color=COMMAND, lw=1.2)
    axes.plot(0.0, 0.0, "o", color=COMMAND, ms=4)
    axes.set(
        xlim=across,
        ylim=up,
        aspect="equal",
        xlabel="across [m]",
        ylabel="along [m]",
        title=f"p(x' | x, u) after {move:.0f} m",
    )


def _draw_path(axes: "Axes", sets: Sequence[States]) -> None:
    """A colour for each set."""
    from matplotlib import colormaps

    turned = np.arange(len(LEGS)) * np.pi / 2
    legs = np.stack([np.cos(turned), np.sin(turned)], axis=1) * np.array(LEGS)[:, None]
    for k, (x, stop) in enumerate(zip(sets, STOPS, strict=True)):
        colour = colormaps["viridis"](k / len(STOPS))
        axes.plot(*x[:2, ::8], ".", ms=1.0, color=colour)
        place = (0.42 + 0.2 * (k // 2), 0.12 - 0.08 * (k % 2))
        axes.text(*place, f"{stop:.0f} m", color=colour, weight="bold", transform=axes.transAxes)
    corners = np.cumsum([np.zeros(2), *legs], axis=0)
    axes.plot(*corners.T, color=COMMAND, lw=1.2)
    axes.plot(0.0, 0.0, "o", color=COMMAND, ms=4)
    axes.set(xlim=(-30.0, 32.0), ylim=(-22.0, 40.0), aspect="equal")
    axes.set(xlabel="x [m]", ylabel="y [m]", title="Sample sets along a path")


def _draw_across(axes: "Axes", table: Table) -> None:
    """Lines: the closed form; dots: the samples."""
    lengths = np.arange(5.0, MOVES[-1] + 1.0, 5.0)
    for k, (step, noise, rows) in _settings(table):
        wide = [predicted_across(length, step, model(noise)) for length in lengths]
        axes.plot(lengths, wide, _style(noise), color=f"C{k}", lw=1.2)
        found = [float(np.mean(rows.column(f"across_{move:.0f}_m"))) for move in MOVES]
        axes.plot(MOVES, found, "o", color=f"C{k}", ms=4)
    axes.set(xscale="log", yscale="log", xlabel="distance [m]", ylabel="deviation across [m]")
    axes.set(title="Straight moves (lines: closed form)")
    _plain(axes, x=(5.0, 10.0, 20.0, 40.0, 80.0), y=(0.1, 1.0, 10.0))


def _draw_spreads(axes: "Axes", table: Table) -> None:
    for k, (step, noise, rows) in _settings(table):
        found = stacked(rows, "spreads_m").mean(axis=0)
        label = f"steps of {step:g} m" if noise == 1.0 else None
        axes.plot(STOPS, found, f"o{_style(noise)}", color=f"C{k}", ms=4, lw=1.2, label=label)
    axes.plot([], [], "k:", lw=1.2, label="half and twice the noise")
    axes.set(yscale="log", xlabel="driven along the path [m]", ylabel="spread [m]")
    axes.set(title="Sample sets along the path")
    _plain(axes, x=STOPS, y=(0.3, 1.0, 3.0, 10.0, 30.0))


def _settings(table: Table) -> Iterator[tuple[int, tuple[float, float, Table]]]:
    """Which step, counted; step, noise and rows of each setting."""
    for k, step in enumerate(table.values("step")):
        for noise in table.values("noise"):
            yield k, (float(step), float(noise), table.where(step=step, noise=noise))


def _style(noise: float) -> str:
    return "-" if noise == 1.0 else ":"


def _plain(axes: "Axes", x: Sequence[float], y: Sequence[float]) -> None:
    """Ticks with plain numbers, also where an axis is logarithmic."""
    axes.set_xticks(x, [f"{tick:g}" for tick in x], minor=False)
    axes.set_yticks(y, [f"{tick:g}" for tick in y], minor=False)
    axes.minorticks_off()
    axes.grid(alpha=0.3)


STUDY = Study(
    number="E1",
    title="Where wheels alone lead: long moves, and a path",
    source="Fox01 §19.2.2 and Fig. 19.1; Fox99 Fig. 1",
    about=ABOUT,
    factors={"step": STEPS, "noise": NOISES},
    run=run,
    metrics={
        "bend_40": "bend after 40 m",
        "bend_80": "bend after 80 m",
        "bend_gaussian": "bend of a Gaussian",
        "across_40_m": "across after 40 m, m",
        "predicted_40_m": "closed form, m",
        "across_80_m": "across after 80 m, m",
        "predicted_80_m": "closed form, m",
        "spread_end_m": "spread at the end of the path, m",
    },
    claims=(
        Claim(
            "The densities after 40 m and 80 m are banana-shaped",
            "two grey-scale pictures, of crescents",
            "a bend of about −0.9, nearer to −1 the more errors of heading outweigh those of "
            "distance. It should fail only where headings vary by more than a radian and the "
            "banana closes to a ring: twice the noise in steps of 1 m. Reproduced: with mcloc's "
            "noise the 95 % interval of the mean bend lies below −0.5 for both moves and both "
            "steps; in part: for some of them",
            bananas,
        ),
        Claim(
            "The density after 80 m is wider than that after 40 m",
            "the second picture shows a wider crescent",
            "2.83 times as wide for small errors (distance^1.5), less for larger ones: by the "
            "closed form 2.76 and 2.66 times for steps of 0.25 and 1 m. Reproduced: with mcloc's "
            "noise the ratio's 95 % interval lies above 1 for both steps; in part: for one",
            widen,
        ),
        Claim(
            "Sample sets along a path spread",
            "a picture of sets that grow from one to the next",
            "holds at each point, most in the beginning. Reproduced: with mcloc's noise each set "
            "is larger than the one before, every ratio's 95 % interval above 1; in part: some are",
            spreading,
        ),
    ),
    draw=draw,
    seeds=20,
)
