"""Regions of a kd-tree: halves, keys, borders and margins, also around circles."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from mcloc.filters.hierarchical.region import (
    OUTSIDE,
    ROOT,
    Region,
    depth_of,
    keys_of,
    region_of,
    wrapped,
)
from mcloc.statespace import LINE, PLANE, SE2, StateSpace

ARM = StateSpace(("shoulder", "reach"), ("rad", "m"), (True, False))
CLOCK = StateSpace(("hour", "minute"), ("rad", "rad"), (True, True))
SPACES = {"line": LINE, "plane": PLANE, "poses": SE2, "arm": ARM, "clock": CLOCK}


def whole(space):
    """From −3 to 5 along straight axes, all around the others."""
    circular = np.array(space.circular)
    return Region(space, np.where(circular, -np.pi, -3.0), np.where(circular, np.pi, 5.0))


WHOLES = {name: whole(space) for name, space in SPACES.items()}
spaces = st.sampled_from(list(SPACES))


@st.composite
def regions(draw):
    """A region of any sides, within a circle on circular axes."""
    space = SPACES[draw(spaces)]
    ends = []
    for circular in space.circular:
        most = np.pi if circular else 10.0
        side = st.floats(-most, most)
        low, high = sorted((draw(side), draw(side)))
        assume(high - low > 1e-3)
        ends.append((low, high))
    low, high = np.array(ends).T
    return Region(space, low, high)


seeds = st.integers(0, 2**32 - 1)
margins = st.floats(0.01, 2.0)


def states(region, seed, n=200):
    """(D, n): states anywhere, many of them in the region or on its border."""
    rng = np.random.default_rng(seed)
    d, circular = region.space.dimension, np.array(region.space.circular)[:, None]
    low, high = region.low[:, None], region.high[:, None]
    x = np.where(circular, np.pi * (1 - 2 * rng.random((d, n))), rng.uniform(-15, 15, (d, n)))
    x = np.where(rng.random((d, n)) < 0.6, low + (high - low) * rng.random((d, n)), x)
    middle = region.centre[:, None]
    for end in (low, high, middle):
        x = np.where(rng.random((d, n)) < 0.03, end, x)
    return np.where(circular & (x <= -np.pi), np.pi, x)


def by_axis(region, x):
    """(D, N): whether low < x ≤ high, written out."""
    pairs = zip(region.low, region.high, x, strict=True)
    return np.array([[low < v <= high for v in row] for low, high, row in pairs])


def angle(x):
    """In (−π, π], but for rounding."""
    return np.angle(np.exp(1j * x))


@given(regions(), seeds)
def test_halves_cover_a_region_and_do_not_overlap(region, seed):
    x = states(region, seed)
    holds = by_axis(region, x).all(axis=0)
    assert np.array_equal(region.holds(x), holds)
    for axis in range(region.space.dimension):
        first, second = (half.holds(x) for half in region.halves(axis))
        assert np.array_equal(first | second, holds)
        assert not (first & second).any()
        expected = np.where(first, 0, np.where(second, 1, OUTSIDE))
        assert np.array_equal(region.which_half(x, axis), expected)


@given(regions())
def test_halves_are_half_as_long_along_one_axis(region):
    for axis in range(region.space.dimension):
        other = np.arange(region.space.dimension) != axis
        for half in region.halves(axis):
            assert half.space is region.space
            assert half.sides[axis] == pytest.approx(0.5 * region.sides[axis])
            assert np.array_equal(half.low[other], region.low[other])
            assert np.array_equal(half.high[other], region.high[other])


@given(spaces, seeds, st.integers(0, 12))
def test_the_key_of_a_state_is_that_of_the_region_which_holds_it(name, seed, depth):
    domain = WHOLES[name]
    x = states(domain, seed, 60)
    keys = keys_of(domain, x, depth)
    assert np.array_equal(keys > 0, domain.holds(x))
    for key, column in zip(keys.tolist(), x.T[:, :, None], strict=True):
        if key > 0:
            assert depth_of(key) == depth
            assert region_of(domain, key).holds(column).all()


@pytest.mark.parametrize("name", SPACES)
def test_the_regions_of_a_depth_divide_the_domain(name):
    """Each state is in one of them alone, and its key is that one's."""
    domain = WHOLES[name]
    x = states(domain, 3, 500)
    for depth in range(6):
        keys = range(2**depth, 2 ** (depth + 1))
        inside = np.array([region_of(domain, key).holds(x) for key in keys])
        assert np.array_equal(inside.sum(axis=0), domain.holds(x))
        held = inside.any(axis=0)
        expected = np.where(held, 2**depth + inside.argmax(axis=0), 0)
        assert np.array_equal(keys_of(domain, x, depth), expected)


@given(spaces, st.integers(1, 40), st.data())
def test_axes_are_halved_in_turn(name, depth, data):
    """depth mod k: along the axis of its level a region is half as long as the one above."""
    domain = WHOLES[name]
    key = data.draw(st.integers(2**depth, 2 ** (depth + 1) - 1))
    above, region = region_of(domain, key >> 1), region_of(domain, key)
    shorter = np.ones(domain.space.dimension)
    shorter[(depth - 1) % domain.space.dimension] = 0.5
    assert region.sides == pytest.approx(shorter * above.sides)
    halvings = [len(range(k, depth, domain.space.dimension)) for k in range(len(shorter))]
    assert region.sides == pytest.approx(domain.sides * 0.5 ** np.array(halvings))
    end = "high" if key % 2 else "low"  # the second half keeps the upper end
    assert np.array_equal(getattr(region, end), getattr(above, end))


def test_the_root_is_the_whole():
    assert region_of(WHOLES["poses"], ROOT) is WHOLES["poses"]
    assert depth_of(ROOT) == 0


@given(regions(), seeds)
def test_beyond_is_how_far_it_is_to_the_region(region, seed):
    """Straight: past the nearer end. Around a circle: the shorter of the ways to its two ends."""
    x = states(region, seed)
    e, within = region.beyond(x), by_axis(region, x)
    assert (e[within] == 0.0).all()
    for k, circular in enumerate(region.space.circular):
        out = ~within[k]
        up, down = x[k] - region.high[k], region.low[k] - x[k]
        if circular:
            up, down = np.abs(angle(up)), np.abs(angle(down))
            apart = np.minimum(up, down)
            side = np.where(up < down, 1, -1)
            sure = out & (np.abs(up - down) > 1e-9) & (apart > 1e-9)
        else:
            apart = np.maximum(up, down)
            side = np.where(up > down, 1, -1)
            sure = out & (apart > 0.0)
        assert np.abs(e[k, out]) == pytest.approx(apart[out], abs=1e-9)
        assert np.array_equal(np.sign(e[k, sure]), side[sure])


@given(regions(), seeds, margins)
def test_collected_states_are_near_and_as_spread_out_as_they_were(region, seed, margin):
    """Moved by whole margins, on the side where they were; those within a margin are left alone."""
    x = states(region, seed)
    width = margin * np.arange(1.0, region.space.dimension + 1.0)
    before, found = x.copy(), region.collected(x, width)
    assert np.array_equal(x, before)
    e, after = region.beyond(x), region.beyond(found)
    near = np.abs(e) <= width[:, None]
    assert (np.abs(after) <= width[:, None] + 1e-9).all()
    circular = np.array(region.space.circular)
    straight = ~circular[:, None] & near
    assert np.array_equal(found[straight], x[straight])
    for k in range(region.space.dimension):
        moved = x[k] - found[k]
        if circular[k]:
            # By which way: as far as it was beyond, less what is left.
            moved = np.where(near[k], angle(moved), e[k] - after[k])
            assert np.abs(angle(x[k] - moved - found[k])) == pytest.approx(0.0, abs=1e-9)
            assert (-np.pi < found[k]).all()
            assert (found[k] <= np.pi).all()
        assert moved[near[k]] == pytest.approx(0.0, abs=1e-9)
        whole_margins = moved / width[k]
        assert whole_margins == pytest.approx(np.rint(whole_margins), abs=1e-6)
        kept = np.abs(after[k]) > 1e-9
        assert np.array_equal(np.sign(after[k, kept]), np.sign(e[k, kept]))


def test_states_just_past_half_a_turn_are_collected_the_short_way():
    """The arc from −π to −π/2: 3.0 is 0.14 from −π, not 4.57 above −π/2."""
    arc = Region(SE2, np.array([0.0, 0.0, -np.pi]), np.array([1.0, 1.0, -np.pi / 2]))
    x = np.array([[0.5, 0.5, 0.5], [0.5, 0.5, 0.5], [3.0, 2.0, 0.3]])
    assert arc.beyond(x)[2] == pytest.approx([3.0 - np.pi, 2.0 - np.pi, 0.3 + np.pi / 2])
    found = arc.collected(x, np.full(3, 0.5))
    assert found[2] == pytest.approx([3.0, 3.0, 0.3 - 1.5])


def test_the_widest_side_is_a_straight_one():
    assert WHOLES["poses"].widest() == 8.0  # not 2 π of another unit
    narrow = Region(ARM, np.array([-np.pi, 0.0]), np.array([np.pi, 0.25]))
    assert narrow.widest() == 0.25
    assert Region(CLOCK, np.array([0.0, 1.0]), np.array([1.0, 3.0])).widest() == 2.0


def test_angles_are_wrapped_and_nothing_else():
    x = np.array([[7.0, -9.0], [7.0, -9.0], [7.0, -np.pi]])
    found = wrapped(x.copy(), SE2)
    assert np.array_equal(found[:2], x[:2])
    assert found[2] == pytest.approx([7.0 - 2.0 * np.pi, np.pi])
