"""What E15 and E16 measure of a run, and the claims that both decide."""

import numpy as np
import pytest

from mcloc.experiments import yee_claims as claims
from mcloc.experiments import yee_runs as runs
from mcloc.experiments import yee_world as yee
from mcloc.experiments.places import Drive
from mcloc.experiments.study import Verdict
from mcloc.experiments.table import Row, Table
from mcloc.filters.grid_proposal import GridProposalFilter
from mcloc.trajectory import Trajectory

NAN = np.nan


def curve_of(
    lost: dict[tuple[str, int], float], error: dict[int, float], *, told: float = 1.0
) -> Table:
    """Loss rates around 0.5 of MCL and 0.04 of the other, errors around 0.02 m, but for those given
    by method and samples; told: what is lost without withheld ones, of that with them.
    """
    rng = np.random.default_rng(0)
    usual = {runs.MCL: 0.5, runs.RENEWING: 0.04}
    rows = []
    for path in range(4):
        for method, share in usual.items():
            for n in runs.SIZES:
                for seed in range(12):
                    rate = lost.get((method, n), share) * (1.0 + 0.1 * rng.standard_normal())
                    record = {
                        "lost": rate,
                        "lost_told": told * rate if method == runs.RENEWING else rate,
                        "error_m": error.get(n, 0.02) * (1.0 + 0.1 * rng.standard_normal()),
                    }
                    rows.append(Row({"path": path, "method": method, "samples": n}, seed, record))
    return Table(rows)


@pytest.mark.parametrize(
    ("errors", "expected"),
    [
        ([0.1, 0.3, 0.7, 0.1], (0.25, 0.25, 0.0, 0.5 / 3.0)),
        ([NAN, NAN, 0.7, 0.1], (0.75, 0.5, 0.5, 0.1)),
        ([NAN, NAN], (1.0, 1.0, 1.0, None)),
        ([0.9, 0.8], (1.0, 1.0, 0.0, None)),
    ],
)
def test_withheld_estimates_count_in_both_ways(
    errors: list[float], expected: tuple[float | None, ...]
) -> None:
    found = runs.measured(np.array(errors))
    names = ("lost", "lost_told", "withheld", "error_m")
    assert [found[name] for name in names] == [pytest.approx(e) for e in expected]


@pytest.mark.parametrize(
    ("near", "after", "waited"),
    [
        ([0] * 3 + [1] * 17, 4 * 0.3, 4 * 0.3),
        ([1] * 20, 0.3, 0.3),
        ([1] * 9 + [0] + [1] * 10, 11 * 0.3, 11 * 0.3),  # nine in a row are chance
        ([0] * 11 + [1] * 9, None, 20 * 0.3),
    ],
)
def test_a_robot_is_found_where_ten_estimates_in_a_row_are_near(
    near: list[int], after: float | None, waited: float
) -> None:
    before = np.zeros((15, 3))
    there = np.tile([9.0, 0.0, 0.0], (20, 1))
    poses = np.concatenate([before, there]) + 0.15 * np.arange(35)[:, None] * [1.0, 0.0, 0.0]
    drive = Drive(yee.yee_world(), (), Trajectory(0.3 * np.arange(35), poses))
    errors = np.concatenate([np.full(15, 0.1), np.where(near, 0.1, NAN)])
    found = runs.recovery(drive, errors)
    assert found.after == (None if after is None else pytest.approx(after))
    assert found.waited == pytest.approx(waited)


def test_the_kidnapping_is_where_the_world_has_it() -> None:
    for k in range(len(yee.PATHS)):
        drive = yee.kidnapped(k, 0)
        at = len(yee.path(k)) // 2
        errors = np.where(np.arange(len(drive.truth)) < at, 0.1, 3.0)
        assert runs.recovery(drive, errors).after is None
        errors[at:] = 0.1
        assert runs.recovery(drive, errors).after == pytest.approx(0.3)


def test_seeds_are_means_over_paths_of_what_is_known() -> None:
    rows = [
        Row({"path": path, "samples": 1}, seed, record)
        for path, seed, record in (
            (0, 0, {"y": 1.0}),
            (1, 0, {"y": 3.0}),
            (0, 1, {"y": None}),
            (1, 1, {"y": 4.0}),
            (0, 2, None),
            (1, 2, {"y": 5.0}),
            (0, 3, {"y": None}),
        )
    ]
    (found,) = claims.by_seed(Table(rows), "y", {"samples": 1})
    assert found.tolist() == [2.0, 4.0]


def test_settings_try_other_parameters_with_few_sizes() -> None:
    other = next(iter(runs.OTHER_THRESHOLDS))
    for method, n, does in (
        (runs.MCL, 30_000, True),
        (runs.RENEWING, 300, True),
        (other, 300, False),
        (other, 1000, True),
    ):
        assert runs.applies({"method": method, "samples": n}) is does


def test_filters_are_what_the_study_tells_of_them() -> None:
    grid = yee.yee_world()
    for method in (runs.RENEWING, *runs.OTHER_THRESHOLDS):
        built = runs.composition(method, 300).build(grid)
        assert isinstance(built, GridProposalFilter)
        assert built.particles == 300
        assert built.gain * built.threshold == pytest.approx(built.most)
    for method, share in runs.SHARES.items():
        mcl = runs.composition(method, 300).build(grid)
        assert mcl.parts[0].size.fixed == 300
        assert mcl.recovery.share == share
        assert mcl.recovery.doubt_below == 0.0


def test_a_run_tells_how_far_off_it_is_at_each_scan(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = yee.driven(1, 3)
    truth = Trajectory(whole.truth.t[:20], whole.truth.poses[:20])
    drive = Drive(whole.grid, whole.events[:20], truth)
    errors, took = runs.tracked(drive, runs.composition(runs.RENEWING, 300), 0)
    assert len(errors) == 20
    assert (errors[np.isfinite(errors)] < runs.LOST).mean() > 0.9
    assert took is not None
    monkeypatch.setattr(runs, "COLLAPSED", 1e-3)
    errors, took = runs.tracked(drive, runs.composition(runs.RENEWING, 300), 0)
    assert np.isnan(errors).all()
    assert took is None


@pytest.mark.parametrize(
    ("lost", "error", "verdict"),
    [
        ({}, {}, Verdict.REPRODUCED),
        ({(runs.RENEWING, 100): 0.2}, {}, Verdict.IN_PART),
        ({}, {100: 0.09}, Verdict.IN_PART),
        ({(runs.RENEWING, runs.SIZES[-1]): 0.5}, {runs.SIZES[-1]: 0.2}, Verdict.NOT),
    ],
)
def test_flat_is_within_the_margins_with_every_size(
    lost: dict[tuple[str, int], float], error: dict[int, float], verdict: Verdict
) -> None:
    found = claims.flat(curve_of(lost, error))
    assert found.verdict is verdict
    if (runs.RENEWING, 100) in lost:
        assert "with 100 samples than with 100,000" in found.what
        assert found.figure.value == pytest.approx(16.0, abs=1.0)


@pytest.mark.parametrize(
    ("lost", "told", "verdict"),
    [
        ({}, 1.0, Verdict.REPRODUCED),
        ({(runs.RENEWING, 100): 0.15}, 1.0, Verdict.REPRODUCED),  # 70 %
        ({(runs.RENEWING, 100): 0.35}, 1.0, Verdict.IN_PART),  # 30 %
        ({(runs.RENEWING, 100): 0.35}, 0.1, Verdict.IN_PART),  # 93 % in one count
        ({(runs.RENEWING, 100): 0.6}, 1.0, Verdict.NOT),
        ({(runs.RENEWING, 300): 0.6}, 1.0, Verdict.REPRODUCED),
    ],
)
def test_as_much_as_60_percent_less_is_with_100_samples(
    lost: dict[tuple[str, int], float], told: float, verdict: Verdict
) -> None:
    assert claims.less_with_few(curve_of(lost, {}, told=told)).verdict is verdict
