"""Trees against brute-force counts in their boxes; look-ups against a walk in plain NumPy."""

import numpy as np
import pytest

from mcloc.kernels.density_tree import grow, look_up, to_unit_cube

N = 300
LEAF = 7
AXES = [1, 2, 3, 6]


def grown(unit, weights, leaf=LEAF, least=1e-6, room=4000):
    """Number of nodes, order, first and (axis, split, child, corner, width, weight)."""
    d, n = unit.shape
    order, first = np.arange(n, dtype=np.uint64), np.empty((room, 2), dtype=np.int64)
    axis, child = np.empty((2, room), dtype=np.uint64)
    split, weight = np.empty((2, room))
    corner, width = np.empty((2, room, d))
    nodes = axis, split, child, corner, width, weight
    k = grow(unit, weights, leaf, np.full(d, least), order, first, *nodes)
    return k, order, first[:k], tuple(a[:k] for a in nodes)


@pytest.fixture(params=AXES)
def samples(request):
    """Weighted samples on two hills within the unit cube."""
    d = request.param
    rng = np.random.default_rng(d)
    hills = rng.uniform(0.2, 0.8, (d, 2))
    unit = np.clip(hills[:, rng.integers(0, 2, N)] + 0.04 * rng.normal(size=(d, N)), 0.0, 1.0)
    return unit, rng.exponential(size=N)


def inside(unit, corner, width):
    """(N,): which samples lie in a box; none lies on an upper face."""
    return ((unit >= corner[:, None]) & (unit < (corner + width)[:, None])).all(axis=0)


def test_leaves_hold_the_samples_that_lie_in_them(samples):
    unit, weights = samples
    k, order, first, (_, split, child, corner, width, weight) = grown(unit, weights)
    assert sorted(order.tolist()) == list(range(N))
    for i in range(k):
        held = inside(unit, corner[i], width[i])
        assert sorted(order[slice(*first[i])].tolist()) == np.flatnonzero(held).tolist()
        is_leaf = child[i] == i
        assert is_leaf == (held.sum() <= LEAF)
        assert np.isnan(split[i]) == is_leaf  # else a point at ∞ would go on from a leaf
        assert weight[i] == pytest.approx(weights[held].sum() if is_leaf else 0.0, rel=1e-12)


def test_leaves_fill_the_cube_exactly(samples):
    _, _, _, (_, _, child, _, width, _) = grown(*samples)
    leaves = child == np.arange(len(child))
    assert width.prod(axis=1)[leaves].sum() == 1.0


def crowded(places):
    """The variance of places in 0 … 1, or the mean one within the halves, in half sides."""
    halves = places < 0.5
    within = sum(4.0 * h.sum() * places[h].var() for h in (halves, ~halves) if h.any())
    return min(places.var(), within / len(places))


def test_children_are_the_halves_on_the_most_crowded_axis(samples):
    unit, weights = samples
    k, _, _, (axis, split, child, corner, width, _) = grown(unit, weights)
    judged = 0
    for i in range(k):
        if child[i] == i:
            continue
        a, left, right = int(axis[i]), int(child[i]), int(child[i]) + 1
        assert split[i] == corner[i, a] + width[i, a] / 2.0
        half, upper = width[i].copy(), corner[i].copy()
        half[a] /= 2.0
        upper[a] = split[i]
        assert np.array_equal([corner[left], corner[right]], [corner[i], upper])
        assert np.array_equal([width[left], width[right]], [half, half])
        held = inside(unit, corner[i], width[i])
        if held.sum() <= 64:  # else a part of them is looked at
            side = (unit[:, held] - corner[i][:, None]) / width[i][:, None]
            spread = np.array([crowded(places) for places in side])
            assert spread[a] <= spread.min() * (1.0 + 1e-9)
            judged += 1
    assert judged > 5


def test_a_hill_gets_boxes_of_its_shape():
    """Deviations of 1 : 0.1 : 0.01 of the same range, a few samples anywhere."""
    rng = np.random.default_rng(8)
    deviation = np.array([0.1, 0.01, 0.001])
    unit = 0.4 + deviation[:, None] * np.clip(rng.normal(size=(3, 2000)), -3.0, 3.0)
    unit[:, :60] = rng.random((3, 60))
    _, _, _, (_, _, child, corner, width, _) = grown(unit, np.ones(2000), 20)
    leaves = child == np.arange(len(child))
    near = leaves & (np.abs(corner + width / 2.0 - 0.4) < 2.0 * deviation).all(axis=1)
    sides = np.log(width[near] / deviation).mean(axis=0)
    # Halving stops within a factor of 2, so equal sides would differ by 4.6 here, these by 0.7.
    assert np.ptp(sides) < np.log(2.0)


def test_identical_samples_are_not_halved_for_ever():
    unit = np.full((2, 50), 0.3)
    k, _, _, (_, _, child, _, width, weight) = grown(unit, np.ones(50), least=1e-3)
    heavy = np.flatnonzero(weight)
    assert weight[heavy].tolist() == [50.0]
    assert width[heavy[0]].tolist() == [2.0**-9, 2.0**-9]  # halves would be 2⁻¹⁰ < 10⁻³
    assert k == 1 + 2 * 2 * 9
    assert child[heavy[0]] == heavy[0]


def test_too_little_room_is_told(samples):
    k, *_ = grown(*samples)
    assert grown(*samples, room=k)[0] == k
    assert grown(*samples, room=k - 1)[0] == -1
    assert grown(*samples, room=1)[0] == -1


def walked(x, axis, split, child, values):
    """The value at one point."""
    if np.isnan(x).any():
        return np.nan
    if (x < 0.0).any() or (x > 1.0).any():
        return -np.inf
    k = 0
    while child[k] != k:
        k = int(child[k]) + int(x[int(axis[k])] >= split[k])
    return values[k]


def points(d):
    """(d, 200): inside, outside, on the faces of the cube and of boxes, infinitely far, and NaN."""
    x = np.random.default_rng(d).uniform(-0.1, 1.1, (d, 200))
    x[:, 60:] = np.clip(x[:, 60:], 0.0, 1.0)
    x[:, 150:180] = np.round(x[:, 150:180] * 8.0) / 8.0
    x[d // 2, 190:] = np.nan
    x[0, 180:190] = np.repeat([-np.inf, np.inf], 5)
    return x


def test_a_look_up_is_a_walk_down_the_tree(samples):
    _, _, _, (axis, split, child, *_) = grown(*samples)
    values = np.arange(len(axis)) + 0.5
    x = points(len(samples[0]))
    out = np.empty(200)
    look_up(x, axis, split, child, values, out, 0, 200)
    expected = [walked(p, axis, split, child, values) for p in x.T]
    assert np.isneginf(out[180:190]).all()
    assert np.array_equal(out, expected, equal_nan=True)
    assert len(set(out[np.isfinite(out)])) > 5


def test_any_split_gives_the_same_bits(samples):
    _, _, _, (axis, split, child, *_) = grown(*samples)
    values = np.arange(len(axis)) + 0.5
    x = points(len(samples[0]))
    whole, parts = np.empty(200), np.full(200, -7.0)
    look_up(x, axis, split, child, values, whole, 0, 200)
    for start, stop in ((66, 200), (66, 66), (1, 66), (0, 1)):
        look_up(x, axis, split, child, values, parts, start, stop)
        assert (parts[:start] == -7.0).all()
    assert np.array_equal(whole, parts, equal_nan=True)


def test_a_circular_axis_has_no_end():
    """Places within a box of 4 × 2π with its low corner at (−1, 0.5)."""
    rng = np.random.default_rng(2)
    x = np.stack([rng.uniform(-3.0, 5.0, 90), rng.uniform(-20.0, 20.0, 90)])
    low, side = np.array([-1.0, 0.5]), np.array([4.0, 2.0 * np.pi])
    out = np.empty_like(x)
    for start, stop in ((0, 40), (40, 90)):
        to_unit_cube(x, low, side, np.array([False, True]), out, start, stop)
    assert out[0] == pytest.approx((x[0] + 1.0) / 4.0)
    assert out[1] == pytest.approx(np.mod(x[1] - 0.5, 2.0 * np.pi) / (2.0 * np.pi))
    assert (out[1] >= 0.0).all()
    assert (out[1] <= 1.0).all()
