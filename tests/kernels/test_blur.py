"""Blurring in blocks against sums over all taps in NumPy."""

from itertools import pairwise

import numpy as np
import pytest

from mcloc.kernels.blur import SIDE, gather, mark_active, mark_reached, put, scale

SHAPE = (5, 4 * SIDE, 3 * SIDE)
LEAST = np.float32(0.5)


def some_taps(seed, count):
    """Of 5 slices: from any slice, by up to twice the grid; what leaves a cell adds up to 1."""
    rng = np.random.default_rng(seed)
    slices = np.stack([rng.permutation(SHAPE[0]) for _ in range(count)], axis=1)
    rows, columns = rng.integers(-2 * SHAPE[1], 2 * SHAPE[1], (2, SHAPE[0], count))
    rows[:, :2] = columns[:, 0] = 0
    share = rng.dirichlet(np.ones(count), SHAPE[0])  # of each source
    weights = np.take_along_axis(share.T, slices.T, axis=1).T.astype(np.float32)
    more = np.zeros((SHAPE[0], 2))  # unused ones at the end
    of_more = more.astype(np.intp)
    return (
        *(np.hstack([a, of_more]) for a in (slices, rows, columns)),
        np.hstack([weights, more.astype(np.float32)]),
    )


def blocks_of(marks):
    return np.stack(np.nonzero(marks))


def whole(marks):
    """Of each cell whether its block is marked."""
    return marks.repeat(SIDE, axis=1).repeat(SIDE, axis=2)


def blurred(cells, taps, pieces=1):
    """By the kernels, in so many pieces."""
    cells = cells.copy()
    active = np.zeros((SHAPE[0], SHAPE[1] // SIDE, SHAPE[2] // SIDE), dtype=np.bool_)

    def run(kernel, n, *given):
        edges = np.linspace(0, n, pieces + 1).astype(int)
        for start, stop in pairwise(edges):
            kernel(*given, start, stop)

    run(mark_active, SHAPE[0], cells, LEAST, active)
    before, reached, blocks = active.copy(), active.copy(), blocks_of(active)
    starts = np.searchsorted(blocks[0], np.arange(SHAPE[0] + 1))
    run(mark_reached, SHAPE[0], blocks, starts, *taps, reached)
    blocks = blocks_of(reached)
    out = np.full((blocks.shape[1], SIDE, SIDE), np.nan, dtype=np.float32)
    run(gather, len(out), cells, out, active, blocks, *taps)
    run(put, len(out), out, blocks, LEAST, cells, active)
    return cells, before, reached, active


def by_numpy(cells, active, taps):
    """Cells of active blocks are sent whole, on a torus; others stay."""
    sent = np.where(whole(active), cells, 0.0).astype(np.float64)
    found = cells - sent
    for k in range(SHAPE[0]):
        for source, row, column, weight in zip(*(t[k] for t in taps), strict=True):
            found[k] += weight * np.roll(sent[source], (row, column), axis=(0, 1))
    return found


@pytest.fixture(params=["all", "some", "one", "none"])
def cells(request):
    rng = np.random.default_rng(2)
    cells = rng.random(SHAPE, dtype=np.float32) * LEAST
    if request.param == "all":
        cells += LEAST
    elif request.param == "some":
        cells[rng.random(SHAPE) < 0.02] = 3.0
    elif request.param == "one":
        cells[3, -1, 0] = 1.0  # in a corner
    return cells


@pytest.mark.parametrize("seed", range(4))
def test_it_is_the_sum_over_taps_and_conserves_mass(cells, seed):
    taps = some_taps(seed, 9)
    found, active, _, _ = blurred(cells, taps)
    expected = cells.reshape(SHAPE[0], SHAPE[1] // SIDE, SIDE, -1, SIDE).max(axis=(2, 4)) > LEAST
    assert np.array_equal(active, expected)
    assert found == pytest.approx(by_numpy(cells, active, taps), rel=1e-5, abs=1e-6)
    total = cells.sum(dtype=np.float64)
    assert found.sum(dtype=np.float64) == pytest.approx(total, rel=1e-6)


@pytest.mark.parametrize("seed", range(4))
def test_where_nothing_comes_to_nothing_changes(cells, seed):
    found, active, reached, _ = blurred(cells, some_taps(seed, 3))
    coming = by_numpy(np.where(whole(active), cells, 0.0), active, some_taps(seed, 3)) > 0.0
    assert not (coming & ~whole(reached)).any()
    untouched = ~whole(reached | active)
    assert found[untouched].tobytes() == cells[untouched].tobytes()


def test_active_is_what_lies_above_after_each_round(cells):
    """Also where a block falls below, or rises above."""
    found, before, _, after = blurred(cells, some_taps(5, 9))
    again = np.zeros_like(after)
    mark_active(found, LEAST, again, 0, SHAPE[0])
    assert np.array_equal(after, again)
    assert before.all() == before.any() or (before != after).any()


@pytest.mark.parametrize("pieces", [2, 3, 7])
def test_pieces_do_not_matter(cells, pieces):
    taps = some_taps(1, 9)
    one, other = blurred(cells, taps), blurred(cells, taps, pieces)
    assert all(np.array_equal(a, b) for a, b in zip(one, other, strict=True))


def test_a_move_without_noise_is_a_roll():
    cells = np.random.default_rng(3).random(SHAPE, dtype=np.float32) + LEAST
    taps = (*(np.full((SHAPE[0], 1), k) for k in (0, 11, -5)), np.ones((SHAPE[0], 1), np.float32))
    taps[0][:, 0] = (np.arange(SHAPE[0]) - 2) % SHAPE[0]
    found = blurred(cells, taps)[0]
    assert np.array_equal(found, np.roll(cells, (2, 11, -5), axis=(0, 1, 2)))


def test_scale_and_what_it_adds_up_to():
    cells = np.random.default_rng(4).random(SHAPE, dtype=np.float32)
    found, totals = cells.copy(), np.full(SHAPE[:2], np.nan)
    for start, stop in ((0, 2), (2, 5)):
        scale(found, np.float32(0.75), np.float32(0.01), totals, start, stop)
    assert found == pytest.approx(0.75 * cells + 0.01, rel=1e-6)
    assert totals == pytest.approx(found.sum(axis=2, dtype=np.float64), rel=1e-6)
