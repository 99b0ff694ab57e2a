"""E4: the error of grid-based Markov localization over the size of its cells [Fox01 Fig. 19.5,
§19.2.5; Fox99 Fig. 6a].
"""

import itertools
import math
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mcloc.evaluation.intervals import mean, paired_ratio
from mcloc.events import Event, Scan
from mcloc.experiments.comparisons import compared, graded, listed, ratios, told
from mcloc.experiments.driving import EVERY_SCAN, errors_of, localized
from mcloc.experiments.places import Drive
from mcloc.experiments.study import Claim, Finding, Study, Verdict
from mcloc.experiments.table import Record, Setting, Table
from mcloc.filters.catalog import Composition
from mcloc.filters.markov_grid import LOOKS
from mcloc.localizer import Localizer
from mcloc.localizer.pace import Modelled
from mcloc.simulation import Laser, Scenario, office_world, simulate

if TYPE_CHECKING:
    from matplotlib.figure import Figure

CELLS = (4, 8, 16, 32, 64)  # cm
GRID, MCL = "grid", "MCL"
LENGTH = 15.0  # m
SIGMA = (0.2, 0.2, math.radians(5.0))  # of the start
MOST = 2.0  # m; a robot that is farther off is lost
SCANS_EVERY = 0.2  # s, of the simulator
SAMPLES = 1000  # with which MCL was best in E5

SONARS, REACH, CONE, NOISE = 24, 3.0, math.radians(20.0), 0.05
SONAR = Laser(
    beams=SONARS,
    fov=2.0 * math.pi * (SONARS - 1) / SONARS,
    range_max=REACH,
    sigma=0.0,
    sigma_relative=NOISE,
    cone=CONE,
    missing=0.05,
    mount=(0.0, 0.0, 0.0),
    source="sonars",
)
SENSORS: dict[str, tuple[Laser, str, dict[str, Any]]] = {
    "laser": (Laser(), "likelihood-field", {}),
    "sonar": (
        SONAR,
        "beam-fox01",
        {
            "ranges": "table",
            "cone": CONE,
            "sigma_hit": 0.1,
            "sigma_relative": NOISE,
        },
    ),
}
"""What the robot has; the sensor model, and its parameters."""

ABOUT = f"""
A robot that knows its start drives {LENGTH:g} m through a generated office, another floor for each
seed, and tracks its pose by grid-based Markov localization with cells of 4 to 64 cm. Nothing is
lost: the paper's figure was not made in real time either. The pose is the mean of the best mode of
the grid, the error the mean over all scans of the distance to the truth, up to {MOST:g} m.

- *laser*: 181 beams half around, of which 60 are used, by the likelihood field with mcloc's
  defaults. *sonar*: a ring of {SONARS} (Fox99 has robots with 7 to 24) of the kind that Yee
  describes, {math.degrees(CONE):.0f}° wide, up to {REACH:g} m, 5 % noise; 5 % are missed. Their
  model is that of Fox01 with the nearest wall in the cone, and takes them for 12 independent
  readings, as the other does its beams. Both drive the same way on the same floor. That walls
  reflect sound like mirrors, of which real sonars suffer most, the simulator does not know.
- The paper does not tell the resolution in θ. It is 4° throughout; cells of 8, 16 and 32 cm are
  tried with 2° too, to see what of the error is that of the headings.
- Each scan is used and counts in full, as in the papers. The start is known to 0.2 m and 5°.
- *{MCL}* tracks the same drives with {SAMPLES:,} samples, the number with which it was best under
  real-time conditions in E5, where it loses no scan.
- Whether a grid keeps up is modelled, as in E5, so that it depends on no machine of today:
  3.3 µs for each active cell and beam. That is generous to the grid, which looks expected ranges up
  but has to blur its cells as well, and to average the likelihood over the map, for which the
  paper's had a table. Scans come every {SCANS_EVERY:g} s. Counted are the cells that are weighed in
  the second half of a drive, when the robot is localized: the selective update.
"""


@lru_cache(maxsize=2)
def driven(sensor: str, seed: int) -> Drive:
    """The drive with one of the sensors."""
    scenario = Scenario(length=LENGTH, lasers=(SENSORS[sensor][0],))
    made = simulate(office_world(seed), seed, scenario)
    return Drive(made.grid, made.events, made.truth)


def run(setting: Setting, seed: int) -> Record:
    """Track one drive."""
    sensor = str(setting["sensor"])
    drive = driven(sensor, seed)
    _, name, of_sensor = SENSORS[sensor]
    settings: dict[str, Any] = {"sensor": of_sensor, "recovery": {"doubt_below": 0.0}}
    if setting["filter"] == GRID:
        headings = round(360.0 / float(setting["degrees"]))
        settings["filter"] = {"cell": 0.01 * float(setting["cell"]), "headings": headings}
        composition = Composition("markov-grid", sensor=name, recovery="none", settings=settings)
    else:
        settings["size"] = {"particles": SAMPLES}
        composition = Composition(
            "mcl", sensor=name, recovery="none", size="fixed", settings=settings
        )
    active: list[int] = []
    busy: list[float] = []

    def note(localizer: Localizer, event: Event) -> None:
        if localizer.update is not None and isinstance(event, Scan):
            info = localizer.update.info
            active.append(info.weighed - (LOOKS if setting["filter"] == GRID else 0))
            beams = localizer.filter.sensor.beams(event)
            busy.append(Modelled().particle_beam * active[-1] * beams)

    history = localized(
        drive,
        composition,
        seed,
        initial=drive.truth.poses[0],
        initial_sigma=SIGMA,
        policy=EVERY_SCAN,
        before=note,
    )
    errors = errors_of(drive, history)
    second_half = slice(len(active) // 2, None)
    return {
        "error_m": float(np.mean(np.minimum(errors.position, MOST))),
        "heading_deg": float(np.degrees(np.mean(np.abs(errors.heading)))),
        "lost": errors.lost_fraction(MOST),
        "states": float(np.median(active[second_half])),
        "busy_s": float(np.median(busy[second_half])),
    }


def applies(setting: Setting) -> bool:
    """MCL has no cells; 2° is tried with some."""
    if setting["filter"] == MCL:
        return setting["cell"] == 0 and setting["degrees"] == 4
    return setting["cell"] != 0 and (setting["degrees"] == 4 or setting["cell"] in (8, 16, 32))


def errors(table: Table, sensor: str, cell: int) -> NDArray[np.float64]:
    """(seeds,): of a grid with 4°, or of MCL with cell 0."""
    return table.where(sensor=sensor, cell=cell, degrees=4).column("error_m")


def grows(table: Table) -> Finding:
    """The error from each size of cells to the next."""
    pairs = {
        f"{sensor}, {large} to {small} cm": (
            errors(table, sensor, large),
            errors(table, sensor, small),
        )
        for sensor in SENSORS
        for small, large in itertools.pairwise(CELLS)
    }
    found = compared(pairs)
    ends = {
        sensor: paired_ratio(errors(table, sensor, CELLS[-1]), errors(table, sensor, CELLS[0]))
        for sensor in SENSORS
    }
    whole = all(end.low > 1.0 for end in ends.values())
    verdict = Verdict.IN_PART if any(end.low > 1.0 for end in ends.values()) else Verdict.NOT
    if whole and not any(comparison.below for comparison in found):
        verdict = Verdict.REPRODUCED
    least = min(ends, key=lambda sensor: ends[sensor].low)
    return Finding(
        verdict,
        f"the error with cells of 64 cm to that with 4 cm, {least}",
        ends[least],
        f"Both: {told(ends)}. From size to size: {listed(found)}.",
    )


def laser_better(table: Table) -> Finding:
    """Sonar against laser, size by size."""
    found = compared(
        {
            f"{cell} cm": (errors(table, "sonar", cell), errors(table, "laser", cell))
            for cell in CELLS
        }
    )
    least = min(found, key=lambda comparison: comparison.ratio.low)
    return Finding(
        graded([comparison.above for comparison in found]),
        f"the error with sonar to that with laser, the least, at {least.told}",
        least.ratio,
        f"All: {listed(found)}.",
    )


def real_time(table: Table) -> Finding:
    """Which sizes keep up with the scans."""
    busy = {
        (sensor, cell): mean(table.where(sensor=sensor, cell=cell, degrees=4).column("busy_s"))
        for sensor in SENSORS
        for cell in CELLS
    }
    misses = {key: interval.low > SCANS_EVERY for key, interval in busy.items()}
    keeps = {key: interval.high < SCANS_EVERY for key, interval in busy.items()}
    holds = [
        misses[sensor, 4] and all(keeps[sensor, cell] for cell in CELLS[1:]) for sensor in SENSORS
    ]
    verdict = graded(holds)
    if verdict is Verdict.NOT and any(misses[sensor, 4] for sensor in SENSORS):
        verdict = Verdict.IN_PART
    note = "; ".join(f"{sensor}, {cell} cm: {i} s" for (sensor, cell), i in busy.items())
    return Finding(
        verdict,
        "modelled time for a scan once localized, laser and cells of 4 cm, s",
        busy["laser", 4],
        f"Scans come every {SCANS_EVERY} s. All: {note}.",
    )


def needs_four(table: Table) -> Finding:
    """The grid against MCL."""
    found = ratios(
        {f"{cell} cm": (errors(table, "laser", cell), errors(table, "laser", 0)) for cell in CELLS}
    )
    four, others = found["4 cm"].low <= 1.0, [found[f"{c} cm"].low > 1.0 for c in CELLS[1:]]
    verdict = Verdict.REPRODUCED if four and all(others) else Verdict.NOT
    if verdict is Verdict.NOT and (four or others[-1]):
        verdict = Verdict.IN_PART
    sonar = ratios(
        {f"{cell} cm": (errors(table, "sonar", cell), errors(table, "sonar", 0)) for cell in CELLS}
    )
    return Finding(
        verdict,
        f"the error of the grid with 8 cm to that of MCL with {SAMPLES:,} samples, laser",
        found["8 cm"],
        f"Laser: {told(found)}. Sonar: {told(sonar)}.",
    )


COLORS = {"laser": "#1f5fbf", "sonar": "#c07f1f"}


def draw(table: Table, figure: "Figure") -> None:
    """Error and modelled time over the size of cells."""
    left, right = figure.subplots(1, 2)
    for sensor, color in COLORS.items():
        for degrees, style in ((4, "o-"), (2, "s:")):
            chosen = table.where(sensor=sensor, filter=GRID, degrees=degrees)
            cells = sorted(int(cell) for cell in chosen.values("cell"))
            if not cells:
                continue
            found = [chosen.where(cell=cell) for cell in cells]
            means = [mean(of.column("error_m")) for of in found]
            left.errorbar(
                cells,
                [100.0 * m.value for m in means],
                yerr=100.0 * np.array([[m.value - m.low, m.high - m.value] for m in means]).T,
                fmt=style,
                ms=4,
                lw=1.5,
                capsize=2,
                color=color,
                label=f"{sensor}, {degrees}°",
            )
            busy = [float(of.column("busy_s").mean()) for of in found]
            right.plot(cells, busy, style, ms=4, lw=1.5, color=color)
        of_mcl = errors(table, sensor, 0)
        if len(of_mcl):
            left.axhline(
                100.0 * float(of_mcl.mean()), color=color, ls="--", lw=1.0, label=f"{sensor}, MCL"
            )
    right.axhline(SCANS_EVERY, color="0.4", ls="--", lw=1.0)
    right.annotate("a scan comes", (CELLS[-1], SCANS_EVERY), ha="right", va="bottom")
    for axes in (left, right):
        axes.set(xscale="log", yscale="log", xlabel="side of a cell [cm]")
        axes.set_xticks(CELLS, [str(cell) for cell in CELLS])
        axes.minorticks_off()
        axes.grid(alpha=0.3)
    left.set_yticks((1, 2, 5, 10, 20, 50), ("1", "2", "5", "10", "20", "50"))
    left.set(ylabel="mean error [cm]", title="Error over the size of cells (95 %)")
    right.set(ylabel="modelled time for a scan [s]", title="Once localized, on a machine of 1999")
    figure.legend(loc="outside lower center", ncols=6, frameon=False)


STUDY = Study(
    number="E4",
    title="Grid-based localization over the size of its cells",
    source="Fox01 §19.2.5 and Fig. 19.5; Fox99 Fig. 6a",
    about=ABOUT,
    factors={
        "sensor": tuple(SENSORS),
        "filter": (GRID, MCL),
        "cell": (*CELLS, 0),
        "degrees": (4, 2),
    },
    run=run,
    metrics={
        "error_m": "mean error, m",
        "heading_deg": "mean error of the heading, °",
        "lost": "share of time > 2 m off",
        "states": "cells weighed, or samples, once localized",
        "busy_s": "modelled time for a scan, s",
    },
    claims=(
        Claim(
            "The error grows with the size of the cells, with sonar and with laser",
            "from some 5 to 10 cm at 4 cm up to some 20 to 35 cm at 64 cm (curves)",
            "holds. Reproduced: the 95 % interval of the ratio of the errors with 64 and with 4 cm "
            "is above 1 for both sensors, and from no size to the next larger one the error "
            "certainly falls (Holm); in part: the ratio is above 1 for some sensor",
            grows,
        ),
        Claim(
            "Laser is more accurate than sonar",
            "at every size (curves)",
            "not reproduced: these sonars look all around and know no mirrors, and in a pilot of "
            "one drive they were better than the laser. Reproduced: the error with sonar is "
            "certainly larger at every size (Holm); in part: at some",
            laser_better,
        ),
        Claim(
            "Cells below 8 cm do not permit updating in real time, even with selective update",
            "below 8 cm",
            "in part: what a cell costs is modelled, so where the limit lies follows from the "
            "number of beams as much as from the cells. Reproduced: for some sensor a scan takes "
            "certainly longer than 0.2 s with 4 cm and certainly less from 8 cm on, and for the "
            "other too; in part: that is so for one, or 4 cm takes too long for some",
            real_time,
        ),
        Claim(
            "To be as accurate as MCL at its best, the grid has to have cells of 4 cm",
            "4 cm",
            "in part: MCL is within a centimetre of the simulator's noise, where a mean over cells "
            "may get too. Reproduced: the interval of the ratio to MCL (laser, Bonferroni) reaches "
            "down to 1 at 4 cm, and lies above it at all other sizes; in part: the one, or above "
            "it at 64 cm",
            needs_four,
        ),
    ),
    draw=draw,
    seeds=20,
    applies=applies,
)
