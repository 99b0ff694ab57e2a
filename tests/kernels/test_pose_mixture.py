"""A Gaussian mixture over poses against the sum over all its components."""

import numpy as np
import pytest

from mcloc.geometry import wrap
from mcloc.kernels.pose_mixture import mixture_density

DEVIATIONS, LIMITS = (0.1, 0.2), (3.0, 2.5)


def in_rows(means):
    """Order, rows, where each begins, and y of row 0."""
    first = means[1].min()
    row = np.floor((means[1] - first) / (LIMITS[0] * DEVIATIONS[0]))
    order = np.lexsort((means[0], row))
    rows, starts = np.unique(row[order], return_index=True)
    return order, rows, np.append(starts, means.shape[1]).astype(np.intp), first


@pytest.mark.parametrize("components", [1, 2, 40, 400])
def test_it_is_the_sum_over_all_components(components):
    rng = np.random.default_rng(components)
    means = rng.uniform(-1.0, 1.0, (3, components)) * np.array([[1.0], [0.7], [np.pi]])
    weights = rng.random(components)
    x = np.concatenate([rng.uniform(-1.5, 1.5, (3, 300)), means[:, :20]], axis=1)
    x[2, :300] *= 2.0 * np.pi / 3.0
    x[:2, 300:] += 0.02
    dx, dy, turn = (x[k][:, None] - means[k] for k in range(3))
    square = (dx**2 + dy**2) / DEVIATIONS[0] ** 2
    off = wrap(turn) / DEVIATIONS[1]
    near = (square <= LIMITS[0] ** 2) & (np.abs(off) <= LIMITS[1])
    expected = np.where(near, np.exp(-0.5 * (square + off**2)), 0.0) @ weights
    assert (expected > 0.0).any()
    order, *rows = in_rows(means)
    table = (*rows, np.ascontiguousarray(means[:, order]), weights[order], DEVIATIONS, LIMITS)
    out, parts = np.full(x.shape[1], np.nan), np.full(x.shape[1], np.nan)
    mixture_density(x, *table, out, 0, x.shape[1])
    assert out == pytest.approx(expected, rel=1e-12, abs=1e-300)
    for start, stop in ((0, 1), (1, 150), (150, x.shape[1])):
        mixture_density(x, *table, parts, start, stop)
    assert np.array_equal(out, parts)
