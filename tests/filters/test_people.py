"""Filters for people against their equations, and on a floor full of visitors."""

import math

import numpy as np
import pytest
from scipy.stats import norm

from mcloc.draws import Draws
from mcloc.environment import FreeSpace
from mcloc.events import Scan
from mcloc.filters.catalog import Composition
from mcloc.filters.people import DistanceFilter, EntropyFilter, NoPeopleFilter
from mcloc.geometry import compose
from mcloc.maps.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from mcloc.particles import Particles
from mcloc.simulation import office_world
from mcloc.simulation.drive import Scenario, simulate
from mcloc.simulation.ranges import ranges

REACH = 8.0
ANGLES = np.linspace(-1.2, 1.2, 41)


def room():
    """6 m × 3 m with walls around and a pillar."""
    cells = np.full((30, 60), FREE, dtype=np.int8)
    cells[[0, -1]] = OCCUPIED
    cells[:, [0, -1]] = OCCUPIED
    cells[12:15, 40:42] = OCCUPIED
    return OccupancyGrid(cells, 0.1, np.zeros(3))


def belief(pose=(1.5, 1.2, 0.0), sigma=(0.1, 0.1, 0.05), n=200, seed=0):
    """Weighted particles around a pose."""
    rng = np.random.default_rng(seed)
    states = np.ascontiguousarray(rng.normal(pose, sigma, (n, 3)).T)
    return Particles.normalized(states, rng.normal(0.0, 1.0, n))


def scan_at(grid, pose, rng, factor=1.0):
    """What a laser measures there, each range times `factor` (B,)."""
    exact = ranges(grid, np.atleast_2d(pose), ANGLES, REACH)[0]
    measured = exact * factor + rng.normal(0.0, 0.02, len(exact))
    return Scan(0.0, measured, ANGLES, REACH)


def left_out(filter_, z, bel):
    """(B,): which readings were left out; and the share that the filter says."""
    cleaned, share = filter_.without_people(z, lambda n: bel)
    same = np.isclose(cleaned.ranges, z.ranges, rtol=0.0, atol=0.0, equal_nan=True)
    assert (same | np.isnan(cleaned.ranges)).all()
    return ~same, share


def test_the_distance_filter_is_its_equation():
    """Σ_x Φ((e(x) − z) / σ) Bel(x) > γ, beam by beam."""
    rng, bel = np.random.default_rng(1), belief()
    z = scan_at(room(), (1.5, 1.2, 0.0), rng, factor=rng.uniform(0.5, 1.1, 41))
    expected = ranges(room(), bel.states.T, ANGLES, REACH)
    for gamma in (0.2, 0.9, 0.99):
        chance = [
            np.sum(bel.weights * norm.sf(z.ranges[k], expected[:, k], 0.15)) for k in range(41)
        ]
        found, share = left_out(DistanceFilter(room(), sigma_hit=0.15, gamma=gamma), z, bel)
        assert 5 < found.sum() < 41
        assert found.tolist() == [p > gamma for p in chance]
        assert share == pytest.approx(found.mean())


def test_the_entropy_filter_is_its_equation():
    """H(Bel(x | z_k)) > H(Bel(x)) over bins of poses, by counting in a dictionary."""
    rng, bel = np.random.default_rng(2), belief()
    z = scan_at(room(), (1.5, 1.2, 0.0), rng, factor=rng.uniform(0.7, 1.1, 41))
    entropy_filter = EntropyFilter(room(), bin_length=0.2, bin_angle=0.06)
    expected = ranges(room(), bel.states.T, ANGLES, REACH)

    def entropy(weights):
        mass = {}
        for (x, y, theta), w in zip(bel.states.T, weights / weights.sum(), strict=True):
            where = math.floor(x / 0.2), math.floor(y / 0.2), math.floor(theta / 0.06)
            mass[where] = mass.get(where, 0.0) + w
        return -sum(p * math.log(p) for p in mass.values() if p > 0.0)

    before = entropy(bel.weights)
    after = [
        entropy(bel.weights * entropy_filter._model.density(z.ranges[k], expected[:, k], REACH))
        for k in range(41)
    ]
    found, _ = left_out(entropy_filter, z, bel)
    assert 2 < found.sum() < 39
    assert found.tolist() == [h > before * (1.0 + 1e-9) for h in after]


@pytest.mark.parametrize("kind", [DistanceFilter, EntropyFilter])
def test_what_is_no_return_stays_and_so_does_the_scan_given(kind):
    rng = np.random.default_rng(3)
    z = scan_at(room(), (1.5, 1.2, 0.0), rng, factor=0.5)
    z.ranges[:6] = [np.inf, np.nan, -np.inf, 0.0, REACH, 81.0]
    before = z.ranges.copy()
    found, _ = left_out(kind(room()), z, belief())
    assert not found[:6].any()
    assert found[6:].any()
    assert np.array_equal(z.ranges, before, equal_nan=True)
    nothing = Scan(0.0, np.full(3, np.inf), ANGLES[:3], REACH)
    assert kind(room()).without_people(nothing, lambda n: belief()) == (nothing, 0.0)


def test_where_no_wall_is_known_a_reading_stays():
    cells = np.where(room().occupied, UNKNOWN, FREE).astype(np.int8)
    nowhere = OccupancyGrid(cells, 0.1, np.zeros(3))
    z = scan_at(room(), (1.5, 1.2, 0.0), np.random.default_rng(4), factor=0.5)
    assert not left_out(DistanceFilter(nowhere), z, belief())[0].any()


def test_a_wall_out_of_reach_makes_every_return_short():
    z = Scan(0.0, np.array([1.0]), np.zeros(1), 2.0)
    bel = belief(sigma=(0.01, 0.01, 0.01))
    assert left_out(DistanceFilter(room()), z, bel)[0].all()


def test_without_a_filter_nothing_is_asked_for():
    def predictive(n):
        raise AssertionError

    z = scan_at(room(), (1.5, 1.2, 0.0), np.random.default_rng(5))
    assert NoPeopleFilter().without_people(z, predictive) == (z, 0.0)


@pytest.fixture(scope="module")
def crowded():
    """A drive among 40 people, two thirds of whom gather around the robot: the floor, some of the
    scans, where they were taken, and which readings people caused.
    """
    drive = simulate(office_world(1), 1, Scenario(length=30.0, people=40, visitors=0.67))
    scans = [e for e in drive.events if isinstance(e, Scan)][::8]
    poses = drive.truth.at(np.array([z.t for z in scans]))
    people = []
    for z, pose in zip(scans, poses, strict=True):
        walls = ranges(drive.grid, compose(pose, z.mount)[None], z.angles, z.range_max)[0]
        people.append(z.returned & (z.ranges < walls - 0.1))  # 5 deviations of the laser
    return drive.grid, scans, poses, people


def test_the_distance_filter_recognises_people(crowded):
    """With a robot known to 5 cm and 1°: nearly all readings that it leaves out are people, and it
    leaves out nearly all that are more than Φ⁻¹(γ) σ + 3 · 5 cm before the wall.
    """
    grid, scans, poses, people = crowded
    distance = DistanceFilter(grid)
    far = float(norm.ppf(distance.gamma)) * distance.sigma_hit + 3 * 0.05
    right = wrong = clear = missed = 0
    for z, pose, person in zip(scans, poses, people, strict=True):
        found, _ = left_out(distance, z, belief(pose, (0.05, 0.05, np.deg2rad(1.0))))
        walls = ranges(grid, compose(pose, z.mount)[None], z.angles, z.range_max)[0]
        right += int((found & person).sum())
        wrong += int((found & ~person).sum())
        clearly = person & (z.ranges < walls - far)
        clear += int(clearly.sum())
        missed += int((clearly & ~found).sum())
    assert right + wrong > 1000
    assert wrong / (right + wrong) < 0.01
    assert missed / clear < 0.05


@pytest.mark.parametrize("kind", [DistanceFilter, EntropyFilter])
def test_a_filter_that_knows_nothing_yet_leaves_a_scan_alone(crowded, kind):
    """Poses all over the floor explain what a sure filter takes for people."""
    grid, scans, _, people = crowded
    everywhere = Particles.equal(FreeSpace(grid).sample(Draws(1), 0, 500))
    gone = [left_out(kind(grid), z, everywhere)[0] for z in scans]
    assert np.mean(np.concatenate(people)) > 0.2
    assert np.mean(np.concatenate(gone)) < 0.02


@pytest.mark.parametrize("people", ["distance", "entropy"])
def test_a_filter_that_leaves_nothing_out_changes_nothing(people):
    """Looking at the scan beforehand takes no random number from the filter."""
    grid = room()
    plain, looking = (Composition(people=name).build(grid) for name in ("none", people))
    z = Scan(0.0, np.full(41, REACH), ANGLES, REACH)
    z.ranges[20] = 4.45
    start = plain.start(FreeSpace(grid), Draws(3))
    a, info_a = plain.step(start, np.zeros(3), z, Draws(3, 1))
    b, info_b = looking.step(start, np.zeros(3), z, Draws(3, 1))
    assert info_a.filtered == info_b.filtered == 0.0
    assert np.array_equal(a.particles.states, b.particles.states)
    assert np.array_equal(a.particles.log_weights, b.particles.log_weights)
