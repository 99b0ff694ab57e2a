"""E8: how its claims are decided, and the world that it shares with E9 and E10."""

import numpy as np
import pytest

from mcloc.draws import Draws
from mcloc.evaluation.intervals import Interval
from mcloc.experiments import e08_sensor_noise as e08
from mcloc.experiments import object_in_space as world
from mcloc.experiments.comparisons import Comparison, compared, graded, ratios
from mcloc.experiments.study import Verdict
from mcloc.experiments.table import Row, Table

U = (0.5, 0.4, 0.3, 0.15, 0.3, 0.9)  # best at 10 %
RISING = (0.1, 0.2, 0.3, 0.4, 0.5, 0.9)


def table_of(curves: dict[int, tuple[float, ...]], fixed: float = 0.25, seeds: int = 30) -> Table:
    """Errors around a curve over NOISES for each error of the wheels; the fixed model's around one
    figure.
    """
    rng = np.random.default_rng(0)
    rows = []
    for moved, curve in curves.items():
        for model in e08.MODELS:
            for noise, error in zip(world.NOISES, curve, strict=True):
                setting = {"moved_mm": moved, "model": model, "noise": noise}
                if not e08.applies(setting):
                    continue
                mean = error if model == "true" else fixed
                rows += [
                    Row(setting, seed, {"error_m": mean * float(np.exp(0.05 * chance))})
                    for seed, chance in enumerate(rng.standard_normal(seeds))
                ]
    return Table(rows)


@pytest.mark.parametrize(
    ("curves", "shape", "optimum"),
    [
        ((U, U, U), Verdict.REPRODUCED, Verdict.REPRODUCED),
        ((U, U, RISING), Verdict.IN_PART, Verdict.IN_PART),
        ((RISING, RISING, RISING), Verdict.NOT, Verdict.NOT),
        ((U[::-1], RISING, RISING), Verdict.IN_PART, Verdict.NOT),  # a U, best at 5 %
    ],
)
def test_verdicts_follow_the_curves(
    curves: tuple[tuple[float, ...], ...], shape: Verdict, optimum: Verdict
) -> None:
    table = table_of(dict(zip(e08.MOVED_MM, curves, strict=True)))
    assert e08.u_shape(table).verdict is shape
    assert e08.optimum(table).verdict is optimum


def test_the_verdict_says_with_which_wheels() -> None:
    found = e08.u_shape(table_of({1: U, 3: RISING, 10: RISING}))
    assert "With 1 mm it holds, 3 mm it does not hold, 10 mm it does not hold." in found.note


def test_the_best_noise_has_an_interval_in_percent() -> None:
    assert e08.optimum(table_of({1: U})).figure == Interval(10.0, 10.0, 10.0)


@pytest.mark.parametrize(
    ("fixed", "verdict"),
    [(0.2, Verdict.REPRODUCED), (0.35, Verdict.IN_PART), (0.6, Verdict.NOT)],
)
def test_the_fixed_model_has_to_be_better_at_each_noise(fixed: float, verdict: Verdict) -> None:
    assert e08.inflated(table_of({1: U}, fixed=fixed)).verdict is verdict


def test_one_seed_is_enough_for_a_look() -> None:
    table = table_of({1: U}, seeds=1)
    assert all(claim.decide(table).verdict for claim in e08.STUDY.claims)


def test_the_fixed_model_is_tried_below_its_own_noise_alone() -> None:
    settings = e08.STUDY.settings()
    assert len(settings) == 3 * (len(world.NOISES) + 3)
    assert max(s["noise"] for s in settings if s["model"] != "true") == 0.05


def test_a_seed_gives_the_same_record() -> None:
    setting = {"moved_mm": 1, "model": "fixed at 10 %", "noise": 0.02}
    assert e08.run(setting, 1) == e08.run(setting, 1)
    assert e08.run(setting, 1) != e08.run(setting, 2)
    assert e08.run(setting, 1) != e08.run({**setting, "model": "true"}, 1)


def test_models_differ_by_their_noise_alone() -> None:
    one, other = (world.filter_named("MCL", 1000, noise, 0.001) for noise in (0.01, 0.1))
    assert (one.sensor.noise, other.sensor.noise) == (0.01, 0.1)
    assert (one.motion, one.environment, one.parts) == (
        other.motion,
        other.environment,
        other.parts,
    )


@pytest.mark.parametrize("samples", [50, 1000])
@pytest.mark.parametrize("name", world.FILTERS)
def test_filters_have_the_stated_number_of_samples(name: str, samples: int) -> None:
    robot = world.filter_named(name, samples, 0.1, 0.001)
    bel = robot.start(robot.environment, Draws(0))
    _, z = next(world.drive(0.1, 0.001, 0))
    bel, info = robot.step(bel, world.MOVE, z, Draws(0, 1))
    phi = world.FILTERS[name][0]
    assert info.n == len(bel.particles) == samples
    assert info.sizes[-1] == (samples if phi == 0.0 else round(phi * samples))


def test_the_robot_comes_back_to_where_it_was() -> None:
    """Without errors the object is at the end where it was at first, and is seen where it is."""
    driven = list(world.drive(0.0, 0.0, 3))
    assert len(driven) == world.STEPS
    assert driven[-1][0] == pytest.approx(np.random.default_rng(3).uniform(*world.WITHIN))
    assert all(z == pytest.approx(x[1:] / x[0]) for x, z in driven)


def test_what_weighs_nothing_is_counted() -> None:
    assert world.weightless(np.array([1.0, 0.5, 0.0, 1e-13])) == 0.5
    assert world.weightless(np.zeros(4)) == 1.0


def test_a_filter_without_weight_left_is_counted_and_knows_nothing() -> None:
    """The two samples of this one leave the box."""
    found = world.localized("MCL", 2, 0.01, 1.0, 0)
    assert found["failed"]
    assert found["error_m"] == found["nothing_m"]


def test_a_resampled_tree_is_one_of_equal_weights() -> None:
    robot = world.filter_named("MCL", 4, 0.1, 0.001)
    particles = robot.start(robot.environment, Draws(0)).particles
    weighted = type(particles).normalized(particles.states, np.log([0.5, 0.5, 1e-9, 1e-9]))
    same = type(particles).equal(particles.states[:, [0, 0, 1, 1]])
    assert np.array_equal(
        world.resampled_tree(weighted).log_density(particles.states),
        world.tree(same).log_density(particles.states),
    )


def test_comparisons_are_corrected_for_each_other() -> None:
    rng = np.random.default_rng(1)
    b = 1.0 + 0.1 * rng.random(20)
    pairs = {"more": (2.0 * b + 0.01 * rng.random(20), b), "less": (b, 2.0 * b), "same": (b, b)}
    more, less, same = compared(pairs)
    assert (more.above, more.below) == (True, False)
    assert (less.above, less.below) == (False, True)
    assert (same.above, same.below, same.p) == (False, False, 1.0)
    alone = compared({"more": pairs["more"]})[0]
    assert more.p >= 2.0 * alone.p
    wide, narrow = ratios(pairs)["more"], alone.ratio
    assert wide.low < narrow.low < narrow.value < narrow.high < wide.high
    assert not Comparison("chance", Interval(1.5, 1.1, 2.0), 0.06).above


def test_a_claim_holds_everywhere_somewhere_or_nowhere() -> None:
    assert graded([True, True]) is Verdict.REPRODUCED
    assert graded([True, False]) is Verdict.IN_PART
    assert graded([False, False]) is Verdict.NOT
