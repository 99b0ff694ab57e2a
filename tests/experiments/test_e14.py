"""E14: how its claims are decided, and what a teleport does."""

import math
from dataclasses import replace

import numpy as np
import pytest

from mcloc.events import Scan
from mcloc.experiments import e14_adaptive_sizes as e14
from mcloc.experiments.places import drive
from mcloc.experiments.study import Verdict
from mcloc.experiments.table import Row, Table
from mcloc.filters.particle_filter import ParticleBelief
from mcloc.geometry import between
from mcloc.localizer import Localizer
from mcloc.particles import Particles
from mcloc.trajectory import Trajectory

PLACES = (e14.MUSEUM, "fhw")


def table_of(
    adaptive: dict[str, float],
    fixed: float = 0.4,
    tracking: float = 0.0,
    *,
    of_adaptive: float = 0.0,
    seeds: int = 20,
) -> Table:
    """Shares of time lost around these, by place; adaptive sets with a threshold of 10 suit."""
    rng = np.random.default_rng(0)
    rows = []
    for place, lost in adaptive.items():
        for size in e14.SIZES:
            is_adaptive = size.startswith("adaptive")
            for teleports in (True, False):
                setting = {"place": place, "teleports": teleports, "pace": "1999", "size": size}
                if teleports:
                    mean = lost if is_adaptive else fixed
                else:
                    mean = of_adaptive if is_adaptive else tracking
                samples = 100.0 * float(size.split()[1]) if is_adaptive else float(size)
                rows += [
                    Row(
                        setting,
                        seed,
                        {"lost": mean + 0.02 * noise * (mean > 0), "samples": samples},
                    )
                    for seed, noise in enumerate(rng.standard_normal(seeds))
                ]
    return Table(rows)


def test_the_largest_threshold_that_the_machine_can_do_is_chosen() -> None:
    table = table_of(dict.fromkeys(PLACES, 0.2))
    assert e14.suited(table, e14.MUSEUM) == "adaptive 10"  # 1,000 samples; 30 takes 3,000
    too_many = Table(
        [
            replace(row, record={**row.record, "samples": 5000.0})
            for row in table.rows
            if row.record is not None
        ]
    )
    assert e14.suited(too_many, e14.MUSEUM) == "adaptive 1"


@pytest.mark.parametrize(
    ("lost", "verdict"),
    [
        ((0.2, 0.2), Verdict.REPRODUCED),
        ((0.2, 0.4), Verdict.IN_PART),
        ((0.4, 0.2), Verdict.IN_PART),
        ((0.6, 0.5), Verdict.NOT),
    ],
)
def test_beating_is_decided_by_the_hardest_fixed_size(
    lost: tuple[float, float], verdict: Verdict
) -> None:
    found = e14.beats(table_of(dict(zip(PLACES, lost, strict=True))))
    assert found.verdict is verdict
    assert found.figure.value == pytest.approx(100 * (0.4 - lost[0]), abs=2.0)


def test_tracking_alike_is_no_difference() -> None:
    found = e14.no_difference(table_of(dict.fromkeys(PLACES, 0.2)))
    assert found.verdict is Verdict.REPRODUCED
    assert "in 10 of 10 comparisons" in found.note


def test_tracking_worse_is_a_difference() -> None:
    found = e14.no_difference(table_of(dict.fromkeys(PLACES, 0.2), of_adaptive=0.1))
    assert found.verdict is Verdict.NOT
    assert found.figure.value == pytest.approx(-10.0, abs=2.0)


def test_a_teleport_moves_samples_and_hypotheses_each_in_its_own_frame() -> None:
    driven = drive(e14.MUSEUM, 0, 20.0)
    robot = Localizer(driven.grid, seed=1, initial=driven.truth.poses[0])
    believed = list(robot.run(driven.events[:40]))[-1].pose
    states = robot.belief.particles.states
    move = np.array([2.0, 0.0, math.pi])
    e14.displace(robot, move)
    moved = between(states.T, robot.belief.particles.states.T)
    np.testing.assert_allclose(moved[:, :2], np.tile(move[:2], (len(moved), 1)), atol=1e-9)
    np.testing.assert_allclose(np.abs(moved[:, 2]), math.pi, atol=1e-9)
    assert robot.update is not None
    carried_along = between(believed, robot.update.hypotheses[0].mean)
    assert np.hypot(*carried_along[:2]) == pytest.approx(2.0, abs=0.25)  # and the way since


class Recorder:
    """What Teleports needs of a localizer."""

    def __init__(self) -> None:
        self.belief, self.update = ParticleBelief(Particles.equal(np.zeros((3, 1)))), None


def test_teleports_are_of_2_metres_and_about_half_a_turn_at_the_rate_of_the_paper() -> None:
    driven = drive(e14.MUSEUM, 0, 20.0)
    length = 20_000.0  # m: enough for some 200 teleports
    truth = Trajectory(np.linspace(0.0, 1e4, 20_001), np.zeros((20_001, 3)))
    truth.poses[:, 0] = np.linspace(0.0, length, 20_001)
    far = replace(driven, truth=truth)
    scan = next(event for event in driven.events if isinstance(event, Scan))
    teleports, robot, moves = e14.Teleports(far, 5), Recorder(), []
    for t in truth.t:
        before = robot.belief.particles.states.T
        teleports(robot, replace(scan, t=float(t)))  # type: ignore[arg-type]
        after = robot.belief.particles.states.T
        if not np.array_equal(before, after):
            moves.append(between(before, after)[0])
    expected = e14.PER_METRE * length
    assert abs(teleports.made - expected) < 4.0 * math.sqrt(expected)  # Poisson
    single = np.array(moves)
    distance, turn = np.hypot(single[:, 0], single[:, 1]), np.abs(single[:, 2])
    # Two between the same two scans, if there are any, are seen as one.
    alone = np.isclose(distance, 2.0)
    assert alone.sum() >= 0.97 * len(moves)
    assert (turn[alone] >= math.pi / 2 - 1e-9).all()
    again = e14.Teleports(far, 5)
    assert [t for t, _ in again._moves][:3] == [t for t, _ in e14.Teleports(far, 5)._moves][:3]


def test_without_teleports_nothing_is_moved() -> None:
    driven = drive(e14.MUSEUM, 0, 20.0)
    robot, teleports = Recorder(), e14.Teleports(driven, None)
    before = robot.belief
    for event in driven.events:
        teleports(robot, event)  # type: ignore[arg-type]
    assert robot.belief is before
    assert teleports.made == 0


def test_a_seed_gives_the_same_record(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(e14, "LENGTH", 30.0)
    setting = {"place": e14.MUSEUM, "teleports": True, "pace": "1999", "size": "adaptive 30"}
    assert e14.run(setting, 1) == e14.run(setting, 1)
