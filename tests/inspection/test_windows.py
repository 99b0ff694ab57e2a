"""Windows: scans a move apart, in a few parts of a log."""

import numpy as np

from mcloc.events import Scan
from mcloc.inspection.windows import LEAST, LENGTH, MOST, USED, Windows


def drive(n: int, step: float) -> Windows:
    windows = Windows()
    for k in range(n):
        at = np.array([k * step, 0.0, 0.0])
        windows.add(Scan(float(k), np.ones(5), np.zeros(5), 10.0, odometry=at))
    return windows


def test_few_windows_spread_over_the_log() -> None:
    chosen = drive(100 * LENGTH, 0.25).chosen
    assert len(chosen) == USED
    assert {len(window) for window in chosen} == {LENGTH}
    starts = [window[0].t / LENGTH for window in chosen]
    assert starts[0] == 0.0
    assert starts[-1] >= 50.0
    assert starts == sorted(starts)
    assert len(set(starts)) == USED


def test_scans_are_a_move_apart() -> None:
    (window, *_) = drive(2 * MOST * LENGTH, 0.05).chosen
    steps = np.diff([scan.odometry[0] for scan in window if scan.odometry is not None])
    assert (steps >= 0.2 - 1e-9).all()
    assert (steps < 0.25 + 1e-9).all()


def test_a_short_log_is_one_window_and_a_shorter_one_none() -> None:
    assert [len(window) for window in drive(LEAST, 0.25).chosen] == [LEAST]
    assert drive(LEAST - 1, 0.25).chosen == []
    assert drive(1000, 0.0).chosen == []


def test_scans_that_cannot_be_used_are_left_out() -> None:
    windows = Windows()
    for k in range(20):
        at = np.array([float(k), 0.0, 0.0])
        windows.add(Scan(float(k), np.full(5, np.nan), np.zeros(5), 10.0, odometry=at))
        windows.add(Scan(float(k), np.ones(5), np.zeros(5), 10.0))
    assert windows.chosen == []
