"""The beam models against their equation, beam by beam, with ranges by the simulator's caster."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from mcloc.errors import ConfigError
from mcloc.events import Scan
from mcloc.geometry import compose
from mcloc.maps.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from mcloc.sensors import SENSORS
from mcloc.sensors.beam_presets import FourPartBeams, Fox01Beams, YeeBeams
from mcloc.simulation.ranges import ranges

CELL, REACH = 0.1, 8.0
BEAMS = [name for name in SENSORS if name.startswith("beam-")]


def room(origin=(0.0, 0.0, 0.0)):
    """6 m × 3 m with walls around but for a gap in the left one, and a pillar."""
    cells = np.full((30, 60), FREE, dtype=np.int8)
    cells[[0, -1]] = OCCUPIED
    cells[:, [0, -1]] = OCCUPIED
    cells[10:13, 0] = UNKNOWN
    cells[12:15, 20:22] = OCCUPIED
    return OccupancyGrid(cells, CELL, np.array(origin))


def scan(ranges, angles, range_max=REACH, **more):
    return Scan(0.0, np.asarray(ranges, float), np.asarray(angles, float), range_max, **more)


def best_density(model, r, range_max):
    """max_e p(r | e), over a fine comb of e."""
    comb = np.concatenate([np.arange(0.0, REACH + 1.0, 0.002), [r, r + 1e-9, np.inf, np.nan]])
    return model.density(r, comb, range_max).max()


def exact(model, x, z):
    """β Σ log( p(z_k | e_k) / max_e p(z_k | e) )."""
    used = model.used_beams(z)
    expected = ranges(model.grid, compose(x.T, z.mount), z.angles, z.range_max)
    total = np.zeros(x.shape[1])
    for k in used:
        r = z.ranges[k]
        if z.returned[k] or r >= z.range_max:
            p = model.density(np.array(r), expected[:, k], z.range_max)
            total += np.log(p / best_density(model, r, z.range_max))
    return total * model.effective_beams * z.novelty / len(used)


def some_poses(rng, n, origin):
    """(3, n) poses from which no beam leaves the room."""
    local = rng.uniform([0.3, 0.3, -0.4], [5.7, 2.7, 0.4], (n, 3))
    return np.ascontiguousarray(compose(origin, local).T)


@pytest.mark.parametrize("range_max", [2.0, REACH])
@pytest.mark.parametrize("origin", [(0.0, 0.0, 0.0), (-7.0, 3.0, 0.8)])
@pytest.mark.parametrize("name", BEAMS)
def test_is_its_equation(name, origin, range_max):
    """But for the table: at most 0.03 a beam from straight lines between knots, before β. At its
    jumps log p is anything between both sides: those beams are left out.
    """
    rng = np.random.default_rng(8)
    model = SENSORS.make(name, room(origin), effective_beams=9.0)
    x = some_poses(rng, 40, origin)
    readings = rng.uniform(0.1, range_max, 41)
    readings[::7] = [np.inf, np.nan, -np.inf, range_max, 0.0, 81.9]
    angles = np.linspace(-1.2, 1.2, 41)
    mount = np.array([0.1, -0.05, 0.2])
    expected = ranges(model.grid, compose(x.T, mount), angles, range_max)
    knot = model.sigma_hit / 4.0
    # The densities jump where e = z, where e = range_max, and where short readings begin.
    beside = np.abs(expected - np.nan_to_num(readings, posinf=range_max)) < 2 * knot
    beside |= np.abs(expected - range_max) < 2 * knot
    for k in range(41):
        alone = np.full(41, np.nan)
        alone[k] = readings[k]
        z = scan(alone, angles, range_max, mount=mount, novelty=0.5)
        found, wanted = model.log_likelihood(x, z), exact(model, x, z)
        allowed = 0.03 * 9.0 * 0.5 / 41
        assert (np.abs(found - wanted) < allowed)[~beside[:, k]].all()
    whole = model.log_likelihood(x, scan(readings, angles, range_max, mount=mount))
    parts = [
        model.log_likelihood(
            x, scan(np.where(np.arange(41) == k, readings, np.nan), angles, range_max, mount=mount)
        )
        for k in range(41)
    ]
    assert whole == pytest.approx(np.sum(parts, axis=0), rel=1e-4)


@pytest.mark.parametrize("sigma", [0.02, 0.2, 1.0])
@pytest.mark.parametrize("name", BEAMS)
def test_the_table_errs_by_less_than_it_says(name, sigma):
    """Halfway between knots, where straight lines err most, against the density itself."""
    model = SENSORS.make(name, room(), sigma_hit=sigma)
    knot = sigma / 4.0
    readings = np.array([0.5, 1.234, 3.0, 6.1, REACH])
    table = model.log_table(readings, REACH).astype(float)
    e = knot * (np.arange(table.shape[1] - 3) + 0.5)
    exactly = np.log(model.density(readings[:, None], e, REACH))
    peak = np.log([[best_density(model, np.array(r), REACH)] for r in readings])
    between = (table[:, :-3] + table[:, 1:-2]) / 2.0
    smooth = (np.abs(e - readings[:, None]) > knot) & (np.abs(e - REACH) > knot)
    assert np.abs(between - (exactly - peak))[smooth].max() < 0.03
    assert table.max() <= 0.0


@pytest.mark.parametrize("name", BEAMS)
def test_the_likelihood_is_one_for_a_perfect_scan_and_less_otherwise(name):
    model, angles = SENSORS.make(name, room()), np.linspace(-1.2, 1.2, 60)
    x = np.array([[1.0], [1.0], [0.1]])
    perfect = scan(ranges(model.grid, x.T, angles, REACH)[0], angles)
    assert np.isfinite(perfect.ranges).all()
    # The best knot is at most σ/8 off: 1/128 a beam; short readings take a little more.
    assert model.log_likelihood(x, perfect)[0] == pytest.approx(0.0, abs=0.02 * 12)
    rng = np.random.default_rng(9)
    others = model.log_likelihood(some_poses(rng, 200, (0.0, 0.0, 0.0)), perfect)
    assert (others <= 1e-6).all()
    assert others.max() < -1.0
    half = replace(perfect, novelty=0.5)
    assert model.readings(half) == model.readings(perfect) / 2.0
    assert model.log_likelihood(x + 0.1, half) == pytest.approx(
        model.log_likelihood(x + 0.1, perfect) / 2.0
    )


@pytest.mark.parametrize("bad", [np.nan, -np.inf, 0.0, -1.0, 0.15])
@pytest.mark.parametrize("name", BEAMS)
def test_an_error_counts_and_says_nothing(name, bad):
    model, x = SENSORS.make(name, room()), np.array([[1.0, 2.0], [1.0, 2.0], [0.3, 0.1]])
    with_bad = scan([0.7, bad, 0.9], [-0.4, 0.0, 0.4], range_min=0.2)
    without = scan([0.7, 0.9], [-0.4, 0.4], range_min=0.2)
    assert model.log_likelihood(x, with_bad) == pytest.approx(
        model.log_likelihood(x, without) * 2.0 / 3.0
    )


@pytest.mark.parametrize("none", [np.inf, REACH, 81.9])
@pytest.mark.parametrize("name", BEAMS)
def test_no_return_is_information(name, none):
    """A beam that returns nothing looks along the room rather than at the near wall."""
    model = SENSORS.make(name, room(), effective_beams=1.0)
    x = np.array([[1.0, 1.0], [0.5, 0.5], [0.0, -np.pi / 2]])
    z = scan([none], [0.0], 3.0)
    far, near = model.log_likelihood(x, z)
    assert far == 0.0
    assert near < -1.5


@pytest.mark.parametrize("range_max", [np.inf, 3.4e38])
@pytest.mark.parametrize("name", BEAMS)
def test_a_laser_without_a_limit_reaches_across_the_map(name, range_max):
    model, diagonal = SENSORS.make(name, room()), CELL * np.hypot(30, 60)
    x = some_poses(np.random.default_rng(10), 50, (0.0, 0.0, 0.0))
    readings, angles = [0.7, 2.0, 5.0, 20.0, np.inf, np.nan], np.linspace(-1.2, 1.2, 6)
    found = model.log_likelihood(x, scan(readings, angles, range_max))
    assert np.ptp(found) > 1.0
    np.testing.assert_array_equal(found, model.log_likelihood(x, scan(readings, angles, diagonal)))
    stated = scan(readings, angles, 80.0)
    assert (model.log_likelihood(x, stated) != found).all()  # a limit that may be is believed


def test_what_lies_behind_the_unknown_does_not_matter():
    """Out of the gap: no return has p_max_unknown, every return the same density."""
    model = FourPartBeams(room(), p_max_unknown=0.3, effective_beams=1.0)
    x = np.array([[1.0], [1.15], [np.pi]])
    density = model.density(np.array([0.5, 3.0, 7.9, REACH]), np.array(np.nan), REACH)
    assert density == pytest.approx([0.7 / REACH] * 3 + [0.3])
    for r, p in zip((0.5, 3.0, REACH), (0.7 / REACH, 0.7 / REACH, 0.3), strict=True):
        best = best_density(model, np.array(r), REACH)
        found = model.log_likelihood(x, scan([r], [0.0]))[0]
        assert found == pytest.approx(np.log(p / best), abs=1e-4)


def test_people_surprise_the_four_part_model_less_than_the_others():
    """Something before the wall at 4.9 m, half-way, against something behind it."""
    x = np.array([[1.0], [0.55], [0.0]])
    before, behind = (scan([r], [0.0]) for r in (2.4, 7.4))
    four, fox, yee = (
        {k: m.log_likelihood(x, z)[0] for k, z in (("before", before), ("behind", behind))}
        for m in (FourPartBeams(room()), Fox01Beams(room()), YeeBeams(room()))
    )
    assert four["before"] > four["behind"] + 1.0
    assert fox["before"] > fox["behind"]  # its noise falls off with the distance
    assert yee["behind"] > yee["before"] + 0.1  # a miss


def test_explained_is_the_share_of_returns_near_the_expected_range():
    model = FourPartBeams(room(), sigma_hit=0.05)  # near: within 0.15 m
    x = np.array([[1.0], [0.55], [0.0]])
    z = scan([4.9, 5.04, 4.74, 2.0, np.nan, np.inf], [0.0] * 6)
    assert model.explained(x, z) == pytest.approx([0.5])
    assert np.isnan(model.explained(x, scan([np.nan, np.inf], [0.0, 0.1]))).all()
    out = np.array([[1.0], [1.15], [np.pi]])  # by the gap
    assert model.explained(out, scan([1.0], [0.0])) == pytest.approx([0.0])


def test_a_scan_of_errors_alone_says_nothing():
    for name in BEAMS:
        model = SENSORS.make(name, room())
        for z in (scan([np.nan, 0.0], [0.0, 0.1]), scan([], [])):
            assert model.log_likelihood(np.ones((3, 5)), z).tolist() == [0.0] * 5


def test_weights_are_relative_to_their_sum():
    grid, z, e = room(), np.linspace(0.1, REACH, 50), np.array(3.0)
    once = FourPartBeams(grid, z_hit=0.4, z_short=0.05, z_max=0.02, z_rand=0.03)
    twice = FourPartBeams(grid, z_hit=0.8, z_short=0.1, z_max=0.04, z_rand=0.06)
    assert once.density(z, e, REACH) == pytest.approx(twice.density(z, e, REACH))


def test_the_density_is_the_book_s():
    """Table 6.1 by hand, for readings within reach: Gaussian, truncated exponential, uniform."""
    model = FourPartBeams(
        room(), sigma_hit=0.3, z_hit=0.6, z_short=0.2, z_max=0.1, z_rand=0.1, lambda_short=0.5
    )
    z, e = np.array([0.5, 1.9, 2.1, 4.0]), 2.0
    shortened = 0.5 * np.exp(-0.5 * z) / (1.0 - np.exp(-0.5 * e)) * (z < e)
    by_hand = 0.6 * norm.pdf(z, e, 0.3) + 0.2 * shortened + 0.1 / REACH
    assert model.density(z, np.array(e), REACH) == pytest.approx(by_hand, rel=1e-9)


@pytest.mark.parametrize("sigma", [0.0, -0.1, np.nan])
def test_a_deviation_that_cannot_be(sigma):
    with pytest.raises(ConfigError, match=r"FourPartBeams\.sigma_hit"):
        FourPartBeams(room(), sigma_hit=sigma)
