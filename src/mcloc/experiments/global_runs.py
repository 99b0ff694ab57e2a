"""What E3 changes, where its robots start, and what they believe on the way."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from functools import cache, lru_cache

import numpy as np
from numpy.typing import NDArray

from mcloc.estimate import Hypothesis
from mcloc.evaluation.intervals import LEVEL, Interval, proportion
from mcloc.experiments.driving import EVERY_SCAN
from mcloc.experiments.look import Look
from mcloc.experiments.places import RECORDED, Drive, drive, recorded
from mcloc.experiments.table import Record, Setting, Table, Value
from mcloc.filters.catalog import Composition
from mcloc.geometry import Pose
from mcloc.localizer import Localizer, UpdatePolicy
from mcloc.particles import Particles
from mcloc.simulation import Scenario, SonarRing, office_world, simulate
from mcloc.simulation.derived_sonar import DerivedSonar

OFFICE, SYMMETRIC = "generated office", "symmetric office"
LASER, SONAR, DERIVED = "laser", "sonar", "derived sonar"
SIZES = (10_000, 100_000)
RANDOM = (0.0, 0.02)  # share of random samples
FACTORS: dict[str, tuple[Value, ...]] = {
    "place": (OFFICE, "freiburg-079", "intel", "wean-1", SYMMETRIC),
    "sensor": (SONAR, DERIVED, LASER),
    "scans": ("all", "decorrelated"),
    "samples": SIZES,
    "random": RANDOM,
}
AS_IN_PAPER = "as in the paper"
LENGTH = 10.0  # m that are left to drive at any start
LOOKS = tuple(0.5 * k for k in range(11))  # m since the start
SOON, LATER = 1.0, 3.0  # m, where the paper looks
SONARS, REACH = 24, 5.0  # of a ring; m
OFTEN = 0.5  # of the runs
RING = SonarRing(beams=SONARS, range_max=REACH)
TABLE: dict[str, Value] = {"ranges": "table"}

Seen = tuple[Particles, tuple[Hypothesis, ...], Pose]
"""A belief, what it says, and the truth."""


def changes(setting: Setting) -> list[str]:
    """What a setting has otherwise than the paper, in words."""
    whether = {
        LASER: setting["sensor"] == LASER,
        "decorrelated scans": setting["scans"] != "all",
        f"{setting['samples']:,} samples": setting["samples"] != SIZES[0],
        f"{100.0 * float(setting['random']):g} % random": setting["random"] != RANDOM[0],
    }
    return [what for what, is_so in whether.items() if is_so]


def applies(setting: Setting) -> bool:
    """Recorded logs have derived sonars. One change at a time, but lasers in both sizes."""
    recorded_log = setting["place"] in RECORDED
    if setting["sensor"] == (SONAR if recorded_log else DERIVED):
        return False
    return len(changes(setting)) <= 1 or changes(setting) == [LASER, f"{SIZES[1]:,} samples"]


def told(setting: Setting) -> str:
    """A setting in words."""
    changed = [what for what in changes(setting) if what != LASER]
    own = [AS_IN_PAPER] if not changes(setting) else changed
    return ", ".join([str(setting["place"]), str(setting["sensor"]), *own])


def settings(table: Table) -> Iterator[tuple[Setting, Table]]:
    """Each setting with its rows."""
    for items in dict.fromkeys(tuple(row.setting.items()) for row in table.rows):
        yield dict(items), table.where(**dict(items))


def share(rows: Table, metric: str, level: float = LEVEL) -> Interval:
    """Of the runs that are so."""
    found = rows.column(metric)
    return proportion(int(np.count_nonzero(found)), len(found), level)


def started(setting: Setting, seed: int) -> tuple[Drive, int]:
    """A drive, and at which of the poses of its truth it starts."""
    place, sensor = str(setting["place"]), str(setting["sensor"])
    if place not in RECORDED:
        return _simulated(place, sensor, seed), 0
    driven = _derived(place) if sensor == DERIVED else drive(place, seed, LENGTH)
    left = travelled(driven)[-1] - travelled(driven)
    return driven, int(np.random.default_rng(seed).integers(np.count_nonzero(left >= LENGTH)))


@lru_cache(maxsize=4)
def _simulated(place: str, sensor: str, seed: int) -> Drive:
    world = office_world(seed, symmetric=place == SYMMETRIC)
    scenario = Scenario(length=LENGTH)
    if sensor == SONAR:
        scenario = replace(scenario, lasers=(RING,))
    made = simulate(world, seed, scenario)
    return Drive(made.grid, made.events, made.truth)


@cache
def _derived(place: str) -> Drive:
    driven = recorded(place)
    ring = DerivedSonar(SONARS, RING.cone, REACH)
    return Drive(driven.grid, tuple(ring.instead(iter(driven.events), Counter())), driven.truth)


def travelled(driven: Drive) -> NDArray[np.float64]:
    """(N,): metres of the true path up to each of its poses."""
    steps = np.diff(driven.truth.poses[:, :2], axis=0)
    return np.append(0.0, np.cumsum(np.hypot(steps[:, 0], steps[:, 1])))


def composition(setting: Setting) -> Composition:
    """The paper's filter, with the sensor model of mcloc's for that sensor."""
    filtered = Composition(
        "mcl",
        size="fixed",
        recovery="random",
        settings={
            "size": {"particles": int(setting["samples"])},
            "recovery": {"doubt_below": 0.0, "share": setting["random"]},
        },
    )
    if setting["sensor"] == LASER:
        return filtered
    return replace(filtered, sensor="sonar", settings={**filtered.settings, "sensor": TABLE})


def looks(driven: Drive, first: int, setting: Setting, seed: int) -> Iterator[Seen]:
    """The belief before the first scan, and then at the first scan from each of LOOKS on."""
    localizer = Localizer(
        driven.grid,
        composition(setting),
        seed=seed,
        policy=EVERY_SCAN if setting["scans"] == "all" else UpdatePolicy(),
    )
    particles, truth = localizer.belief.particles, driven.truth
    yield particles, localizer.filter.hypotheses(localizer.belief), truth.poses[first]
    path, k = travelled(driven), 1
    start = truth.t[first] - 1e-3  # stamps of logs and references differ in their last digits
    events = (event for event in driven.events if event.t >= start)
    for estimate in localizer.run(events):
        metres = float(np.interp(estimate.t, truth.t, path)) - path[first]
        while k < len(LOOKS) and metres >= LOOKS[k]:
            yield (
                estimate.update.particles,
                estimate.hypotheses,
                truth.at(np.array([estimate.t]))[0],
            )
            k += 1
        if k == len(LOOKS):
            return


def run(setting: Setting, seed: int) -> Record:
    """Localize one robot."""
    seen = [
        Look.at(found, truth) for _, found, truth in looks(*started(setting, seed), setting, seed)
    ]
    soon, later = seen[LOOKS.index(SOON)], seen[LOOKS.index(LATER)]
    return {
        "places_0": seen[0].places,
        "places_1": soon.places,
        "best_1": round(soon.best, 3),
        "few_1": soon.few,
        "places_3": later.places,
        "best_3": round(later.best, 3),
        "unique_3": later.unique,
        "found_3": later.found,
        "true": [round(look.true, 3) for look in seen],
        "best": [round(look.best, 3) for look in seen],
        "places": [look.places for look in seen],
    }
