"""Beam models of sonars: beams that are cones, and noise that grows with the range."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm

from mcloc.draws import Draws
from mcloc.environment import FreeSpace
from mcloc.errors import ConfigError
from mcloc.events import Scan
from mcloc.geometry import compose
from mcloc.maps.occupancy import FREE, OCCUPIED, OccupancyGrid
from mcloc.sensors import SENSORS
from mcloc.sensors.beam_presets import FourPartBeams
from mcloc.simulation import office_world
from mcloc.simulation.ranges import ranges

BEAMS = [name for name in SENSORS if name.startswith("beam-")]
REACH, CONE, RELATIVE = 3.0, np.radians(20.0), 0.05
RING = np.arange(16) * np.pi / 8.0
SONAR = {"cone": CONE, "sigma_relative": RELATIVE, "effective_beams": 16.0}


def room():
    """6 m × 3 m with walls around, and a pillar."""
    cells = np.full((30, 60), FREE, dtype=np.int8)
    cells[[0, -1]] = OCCUPIED
    cells[:, [0, -1]] = OCCUPIED
    cells[12:15, 20:22] = OCCUPIED
    return OccupancyGrid(cells, 0.1, np.zeros(3))


def expected_ranges(grid, x, cone=CONE):
    """(n, 16): the least of the simulator's rays, 7 for a cone of 20°."""
    fan = np.linspace(-cone / 2.0, cone / 2.0, 7)
    return np.min([ranges(grid, x.T, RING + aside, REACH) for aside in fan], axis=0)


def sonar_scan(grid, pose, rng):
    e = expected_ranges(grid, pose[:, None])[0]
    return Scan(0.0, e * (1.0 + RELATIVE * rng.normal(size=16)), RING, REACH)


def some_poses(rng, n):
    return np.ascontiguousarray(rng.uniform([0.3, 0.3, -3.0], [5.7, 2.7, 3.0], (n, 3)).T)


@pytest.mark.parametrize("sigma_relative", [0.0, RELATIVE])
@pytest.mark.parametrize("name", BEAMS)
def test_is_its_equation_at_the_least_range_of_the_cone(name, sigma_relative):
    """log p(z | e) − max_e log p(z | e), to the 0.03 a beam of the table, but where p jumps."""
    rng = np.random.default_rng(1)
    model = SENSORS.make(name, room(), **{**SONAR, "sigma_relative": sigma_relative})
    x, knot = some_poses(rng, 60), model.sigma_hit / 4.0
    e = expected_ranges(model.grid, x)
    comb = np.append(np.arange(0.0, REACH + 1.0, 0.002), [np.inf, np.nan])
    for k, r in enumerate([0.25, 0.8, 1.3, 2.2, 2.9, np.inf]):
        readings, z = np.full(16, np.nan), np.array(min(r, REACH))
        readings[k] = r
        best = max(model.density(z, np.append(comb, [z, z + 1e-9]), REACH))
        wanted = np.log(model.density(z, e[:, k], REACH) / best)
        smooth = (np.abs(e[:, k] - z) > 2 * knot) & (np.abs(e[:, k] - REACH) > 2 * knot)
        found = model.log_likelihood(x, Scan(0.0, readings, RING, REACH))
        assert np.abs(found - wanted)[smooth].max() < 0.03
        assert smooth.sum() > 20
        assert (found <= 0.0).all()


@pytest.mark.parametrize("name", BEAMS)
def test_is_near_to_that_of_exact_ranges_where_they_are_looked_up(name):
    """All over an office of 5-cm cells and around the true pose. Measured for 4 scans and the three
    models: a correlation of 0.9896 or more, 0.054 a beam in the mean; twice of that is allowed.
    Rays instead of cones differ by 0.146 or more.
    """
    world = office_world(2)
    settings = {**SONAR, "sigma_hit": 0.1}
    exact, table = (SENSORS.make(name, world, ranges=r, **settings) for r in ("exact", "table"))
    anywhere = FreeSpace(world)
    for seed in range(2):
        rng = np.random.default_rng(seed)
        true = anywhere.sample(Draws(9, seed), 0, 1)
        z = sonar_scan(world, true[:, 0], rng)
        near = true + rng.normal(0.0, [[0.5], [0.5], [0.2]], (3, 1000))
        for x in (anywhere.sample(Draws(1, seed), 0, 1000), near):
            a, b = exact.log_likelihood(x, z), table.log_likelihood(x, z)
            assert np.corrcoef(a, b)[0, 1] > 0.979
            assert np.abs(b - a).mean() / 16.0 < 0.11
            as_rays = SENSORS.make(name, world, **{**settings, "cone": 0.0}).log_likelihood(x, z)
            assert np.abs(b - as_rays).mean() / 16.0 > 0.11


@pytest.mark.parametrize("ranges", ["exact", "table"])
def test_explained_goes_by_the_cone_and_the_deviation(ranges):
    """The wall 2 m ahead, seen at 2 m. 3 √(0.05² + 0.1²) = 0.335 m are near to it."""
    model = FourPartBeams(
        room(), sigma_hit=0.05, sigma_relative=0.05, cone=np.radians(60.0), ranges=ranges
    )
    x = np.array([[3.9], [2.0], [0.0]])  # the upper wall is 0.9 m away, at 1.8 m within the cone
    ahead = Scan(0.0, np.array([1.8, 2.0, 1.4, 2.6]), np.zeros(4), REACH)
    assert model.explained(x, ahead) == pytest.approx([0.5])
    unlimited = Scan(0.0, np.array([1.8, 2.0, 1.4, 2.6]), np.zeros(4), np.inf)
    assert model.explained(x, unlimited) == pytest.approx([0.5])
    narrow = FourPartBeams(room(), sigma_hit=0.05, sigma_relative=0.05, ranges=ranges)
    assert narrow.explained(x, Scan(0.0, np.array([2.0, 1.7, 2.35]), np.zeros(3), REACH)) == (
        pytest.approx([2.0 / 3.0])
    )


@pytest.mark.parametrize("e", [0.0, 0.1, 1.0, 2.9, 3.0, 8.0, np.inf, np.nan])
@pytest.mark.parametrize("name", BEAMS)
def test_the_density_has_integral_1_with_relative_noise(name, e):
    model = SENSORS.make(name, room(), sigma_hit=0.05, sigma_relative=0.2)

    def p(z):
        return float(model.density(np.array(z), np.array(e), REACH))

    around = np.nan_to_num(np.clip(e + np.array([-0.5, -0.1, 0.0, 0.05, 0.1, 0.5]), 0, REACH))
    edges = np.unique([0.0, *around, REACH])
    pieces = [
        quad(p, low, high, limit=200)[0]
        for low, high in zip(edges[:-1], np.nextafter(edges[1:], 0.0), strict=True)
    ]
    assert sum(pieces) + p(REACH) == pytest.approx(1.0, abs=1e-6)


def test_the_deviation_is_that_of_both_causes():
    model = FourPartBeams(room(), sigma_hit=0.03, sigma_relative=0.04, z_short=0.0)
    z, e = np.array([1.8, 2.0, 2.1]), np.array(1.0)
    for wall in (0.5, 1.0, 2.0):
        sigma = np.sqrt(0.03**2 + (0.04 * wall) ** 2)
        by_hand = (0.95 * norm.pdf(z, wall, sigma) + 0.05 / REACH) / 1.05
        assert model.density(z, wall * e, REACH) == pytest.approx(by_hand, rel=1e-9)
    assert model.deviation(np.array([5.0, np.inf]), REACH) == pytest.approx(np.hypot(0.03, 0.12))


@pytest.mark.parametrize("sigma_relative", [0.02, 0.1, 0.3])
@pytest.mark.parametrize("sigma", [0.02, 0.2])
@pytest.mark.parametrize("name", BEAMS)
def test_the_table_s_knots_are_near_enough(name, sigma, sigma_relative):
    """Halfway between knots, where straight lines err most, against the density itself; and no
    expected range explains a reading better than the knots do, by more than the 1/128 that half a
    knot costs and the s²/2 by which a nearer wall, of less noise, may be likelier.
    """
    model = SENSORS.make(name, room(), sigma_hit=sigma, sigma_relative=sigma_relative)
    knot = sigma / 4.0
    readings = np.array([0.1, 0.5, 1.234, 2.7, REACH])
    table = model.log_table(readings, REACH).astype(float)
    e = knot * (np.arange(table.shape[1] - 3) + 0.5)
    exactly = np.log(model.density(readings[:, None], e, REACH))
    at_knots = np.log(model.density(readings[:, None], knot * np.arange(len(e) + 1), REACH))
    peak = at_knots[:, :1] - table[:, :1]
    between = (table[:, :-3] + table[:, 1:-2]) / 2.0
    smooth = (np.abs(e - readings[:, None]) > knot) & (np.abs(e - REACH) > knot)
    assert np.abs(between - (exactly - peak))[smooth].max() < (
        0.03 if sigma_relative <= 0.1 else 0.04
    )
    assert table.max() <= 0.0
    comb = np.arange(0.0, REACH, knot / 20.0)
    best = np.log(model.density(readings[:, None], comb, REACH)).max(axis=1)
    assert (best - peak[:, 0] < 1.0 / 128.0 + sigma_relative**2 / 2.0).all()


@pytest.mark.parametrize("name", BEAMS)
def test_no_pose_is_too_odd_for_a_cone(name):
    odd = [np.nan, np.inf, -np.inf, 1e300, -1e300, 1e18, 1e5, 0.0, np.pi, 7.0]
    x = np.array(np.meshgrid(odd, odd, odd)).reshape(3, -1)
    readings = np.array([0.5, np.nan, np.inf, -np.inf, 0.0, 3.0])
    z = Scan(0.0, readings, RING[:6], REACH, np.array([0.2, 0.0, 0.1]))
    for looked_up in ("exact", "table"):
        model = SENSORS.make(name, room(), ranges=looked_up, **SONAR)
        with np.errstate(all="ignore"):
            assert np.isfinite(model.log_likelihood(x, z)).all()


def test_a_scan_of_errors_alone_says_nothing():
    for name in BEAMS:
        model = SENSORS.make(name, room(), **SONAR)
        for z in (
            Scan(0.0, np.array([np.nan, 0.0]), RING[:2], REACH),
            Scan(0.0, np.empty(0), np.empty(0), REACH),
        ):
            assert model.log_likelihood(np.ones((3, 5)), z).tolist() == [0.0] * 5


@pytest.mark.parametrize(
    "wrong", [{"cone": -0.1}, {"cone": 3.2}, {"sigma_relative": -0.1}, {"sigma_relative": 0.4}]
)
def test_what_cannot_be_right_is_refused(wrong):
    with pytest.raises(ConfigError, match=rf"FourPartBeams\.{next(iter(wrong))}"):
        FourPartBeams(room(), **wrong)


def test_threads_and_blocks_change_nothing():
    model = SENSORS.make("beam-yee", room(), **SONAR)
    x = some_poses(np.random.default_rng(2), 300)
    z = sonar_scan(model.grid, x[:, 0], np.random.default_rng(3))
    whole = model.log_likelihood(x, z)
    parts = [model.log_likelihood(np.ascontiguousarray(p), z) for p in np.split(x, 3, axis=1)]
    assert np.array_equal(whole, np.concatenate(parts))
    moved = compose(x.T, np.array([0.2, 0.1, 0.5]))
    assert not np.array_equal(whole, model.log_likelihood(np.ascontiguousarray(moved.T), z))
