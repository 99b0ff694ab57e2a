"""Stamps: what is usual, and which faults of a clock are told from it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mcloc.inspection.stamps import Stamps, inspect_overlap, inspect_stamps

STEADY = 100.0 + 0.1 * np.arange(500)


def stamps_of(t: np.ndarray | list[float]) -> Stamps:
    stamps = Stamps()
    for stamp in t:
        stamps.add(float(stamp))
    return stamps


def checks(t: np.ndarray | list[float]) -> list[str]:
    return [finding.check for finding in inspect_stamps("laser", stamps_of(t))]


@given(st.lists(st.floats(-1e5, 1e5), min_size=1, max_size=60))
def test_counts_against_numpy(t: list[float]) -> None:
    stamps, steps = stamps_of(t), np.diff(t)
    assert stamps.count == len(t)
    assert (stamps.first, stamps.last) == (min(t), max(t))
    assert stamps.repeated == (steps == 0.0).sum()
    assert stamps.backward == (steps < 0.0).sum()
    longest = [step.length for step in stamps.longest]
    assert longest == sorted(steps[steps > 0.0], reverse=True)[:5]
    if (steps < 0.0).any():
        assert stamps.furthest_back is not None
        assert stamps.furthest_back.length == steps.min()


@given(st.lists(st.floats(1e-5, 1e5), min_size=1, max_size=59).filter(lambda p: len(p) % 2 == 1))
def test_the_period_is_the_median_step(periods: list[float]) -> None:
    t = np.concatenate([[0.0], np.cumsum(periods)])
    steps = np.diff(t)
    if (steps > 0.0).all():
        assert stamps_of(t).period == pytest.approx(np.median(steps), rel=0.07)


def test_a_steady_clock_is_right() -> None:
    assert checks(STEADY) == []
    assert checks(STEADY + np.random.default_rng(1).uniform(0.0, 0.09, 500)) == []


def test_too_few_stamps_say_nothing() -> None:
    assert checks([0.0, 1.0, 0.0, 3600.0]) == []
    assert checks([]) == []


@pytest.mark.parametrize("jump", [15.0, 3600.0, 1e9])
def test_a_jump_forward(jump: float) -> None:
    t = np.where(np.arange(500) < 300, STEADY, STEADY + jump)
    (finding,) = inspect_stamps("laser", stamps_of(t))
    assert finding.check == "clock-jumps-forward"
    assert f"{jump + 0.1:.1f} s" in finding.what
    assert "t = 129.900 s" in finding.evidence
    assert checks(np.where(np.arange(500) < 400, t, t + jump)) == ["clock-jumps-forward"]


def test_pauses_of_many_lengths_are_no_jump() -> None:
    """As a log has them that grows only while the robot moves."""
    pauses = np.full(500, 0.5)
    pauses[::50] = [40.0, 80.0, 20.0, 10.0, 230.0, 35.0, 100.0, 60.0, 45.0, 5.0]
    assert checks(np.cumsum(pauses)) == []
    assert checks(STEADY + np.where(np.arange(500) < 300, 0.0, 9.0)) == []


@pytest.mark.parametrize("jump", [-5.0, -3600.0])
def test_a_jump_back(jump: float) -> None:
    t = np.where(np.arange(500) < 300, STEADY, STEADY + jump)
    (finding,) = inspect_stamps("laser", stamps_of(t))
    assert finding.check == "clock-jumps-back"
    assert f"{-jump - 0.1:.1f} s" in finding.what


@pytest.mark.parametrize(("share", "found"), [(0.004, []), (0.1, ["stamps-reordered"])])
def test_reordered_stamps(share: float, found: list[str]) -> None:
    t = STEADY.copy()
    first = np.arange(0, 498, 4)[: round(share * 500)]
    t[first], t[first + 1] = STEADY[first + 1], STEADY[first]
    assert checks(t) == found


@pytest.mark.parametrize(("share", "found"), [(0.004, []), (0.1, ["stamps-repeated"])])
def test_repeated_stamps(share: float, found: list[str]) -> None:
    t = STEADY.copy()
    first = np.arange(0, 498, 4)[: round(share * 500)]
    t[first + 1] = t[first]
    assert checks(t) == found


@pytest.mark.parametrize(
    ("shift", "apart"), [(0.0, False), (5.0, False), (-20.0, False), (30.0, True), (-1e9, True)]
)
def test_clocks_apart(shift: float, apart: bool) -> None:
    odometry, laser = stamps_of(STEADY), stamps_of(STEADY[::2] + shift)
    finding = inspect_overlap(odometry, "laser", laser)
    assert (finding is not None) == apart
    if finding is not None:
        assert finding.check == "clocks-apart"
        assert f"{shift:.3f} s after" in finding.remedy
    assert inspect_overlap(Stamps(), "laser", laser) is None
