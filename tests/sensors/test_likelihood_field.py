"""The likelihood field against its equation, beam by beam in plain Python."""

import math
from dataclasses import replace

import numpy as np
import pytest

from mcloc.errors import ConfigError
from mcloc.events import Scan
from mcloc.geometry import compose
from mcloc.maps.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from mcloc.sensors import LikelihoodField

CELL = 0.1


def room(origin=(0.0, 0.0, 0.0)):
    """4 m × 3 m with walls around, a pillar, and a corner that nobody has seen."""
    cells = np.full((30, 40), FREE, dtype=np.int8)
    cells[[0, -1]] = OCCUPIED
    cells[:, [0, -1]] = OCCUPIED
    cells[12:15, 20:22] = OCCUPIED
    cells[20:28, 2:9] = UNKNOWN
    return OccupancyGrid(cells, CELL, np.array(origin))


def scan(ranges, angles=None, **more):
    ranges = np.asarray(ranges, dtype=np.float64)
    if angles is None:
        angles = np.linspace(-np.pi / 2, np.pi / 2, len(ranges))
    return Scan(0.0, ranges, np.asarray(angles, dtype=np.float64), 8.0, **more)


def by_hand(model, pose, z):
    """β Σ log((1 − z) exp(−d²/2σ²) + z), distances by looking at every wall cell."""
    grid = model.grid
    walls = np.argwhere(grid.occupied)
    used = sorted(
        {round(k) for k in np.linspace(0, len(z.ranges) - 1, min(len(z.ranges), model.max_beams))}
    )
    total = 0.0
    for k in used:
        r = z.ranges[k]
        if not (math.isfinite(r) and 0.0 < r < z.range_max):
            continue
        sensor = compose(pose, z.mount)
        angle = sensor[2] + z.angles[k]
        end = [sensor[0] + r * math.cos(angle), sensor[1] + r * math.sin(angle), 0.0]
        row, column = (int(v) for v in grid.cell_of(end))
        height, width = grid.cells.shape
        off = not (0 <= row < height and 0 <= column < width)
        d = grid.resolution * np.hypot(*(walls - (row, column)).T).min()
        floor = model.z_unknown if off or grid.unknown[row, column] else model.z_rand
        total += math.log((1.0 - floor) * math.exp(-0.5 * (d / model.sigma_hit) ** 2) + floor)
    return total * model.effective_beams / len(used)


@pytest.mark.parametrize("origin", [(0.0, 0.0, 0.0), (-7.0, 3.0, 0.8)])
@pytest.mark.parametrize("beams", [1, 7, 60, 181])
@pytest.mark.parametrize("mount", [(0.0, 0.0, 0.0), (0.25, -0.1, 0.3)])
def test_is_its_equation(origin, beams, mount):
    rng = np.random.default_rng(beams)
    grid = room(origin)
    local = np.stack([rng.uniform(0.2, 3.8, 8), rng.uniform(0.2, 2.8, 8), rng.uniform(-3, 3, 8)])
    x = np.ascontiguousarray(compose(origin, local.T).T)
    ranges = rng.uniform(0.1, 5.0, beams)  # some end off the map, some where it is unknown
    bad = [np.nan, np.inf, -np.inf, 0.0, -1.0, 8.0, 8.1]
    if beams > 30:
        ranges[rng.choice(beams, len(bad), replace=False)] = bad
    z = scan(ranges, mount=np.array(mount))
    model = LikelihoodField(grid, sigma_hit=0.2, z_rand=0.07, z_unknown=0.3, effective_beams=9.0)
    expected = [by_hand(model, pose, z) for pose in x.T]
    # Each beam: half a step of 16 bits, and 10⁻⁶ of walls that are too far to be told.
    beam = 0.5 * math.log(1.0 / 0.07) / 65535 + 1e-6
    assert np.abs(model.log_likelihood(x, z) - expected).max() <= 9.0 * beam


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 0.0, -1.0, 8.0, 8.19])
def test_a_reading_that_is_no_return_counts_and_says_nothing(bad):
    model, x = LikelihoodField(room()), np.array([[1.0], [1.0], [0.3]])
    angles = [-0.4, 0.0, 0.4]
    with_bad = model.log_likelihood(x, scan([0.7, bad, 0.9], angles))
    without = model.log_likelihood(x, scan([0.7, 0.9], [-0.4, 0.4]))
    assert with_bad == pytest.approx(without * 2.0 / 3.0)


def test_a_scan_without_returns_says_nothing():
    model, x = LikelihoodField(room()), np.ones((3, 5))
    for z in (scan([np.nan, np.inf, 9.0]), scan([])):
        assert model.log_likelihood(x, z).tolist() == [0.0] * 5
        assert np.isnan(model.explained(x, z)).all()


def distance_at(end_x):
    """Metres to the wall, read back from the likelihood of one beam that ends at (end_x, 1.05)."""
    model = LikelihoodField(room(), sigma_hit=0.3, z_rand=1e-9, z_unknown=1e-9, effective_beams=1.0)
    x = np.array([[1.0], [1.05], [0.0]])
    log_p = model.log_likelihood(x, scan([end_x - 1.0], [0.0]))[0]
    return 0.3 * math.sqrt(-2.0 * log_p)


@pytest.mark.parametrize(
    ("end_x", "distance"),
    [(3.95, 0.0), (3.901, 0.0), (3.999, 0.0), (3.85, CELL), (3.899, CELL), (3.75, 2 * CELL)],
)
def test_no_half_cell_offset(end_x, distance):
    """Anywhere in a wall's cell, x = 3.9 … 4, is distance 0; in the next cell, one resolution."""
    assert distance_at(end_x) == pytest.approx(distance, abs=1e-4)


def test_just_off_the_map_is_one_cell_from_its_outer_wall():
    assert distance_at(4.05) == pytest.approx(CELL, abs=1e-4)


def test_far_off_the_map_is_unknown():
    """A beam that goes on for 3 m behind the outer wall has no wall near its end."""
    model = LikelihoodField(room(), z_unknown=0.2, effective_beams=1.0)
    x = np.array([[1.0], [1.05], [0.0]])
    assert model.log_likelihood(x, scan([6.0], [0.0])) == pytest.approx([math.log(0.2)], abs=1e-3)
    assert model.explained(x, scan([6.0], [0.0])) == [0.0]


def test_uses_beams_evenly_up_to_the_limit():
    model = LikelihoodField(room(), max_beams=60)
    used = model.used_beams(scan(np.ones(361)))
    assert len(used) == model.beams(scan(np.ones(361))) == 60
    assert (used[0], used[-1]) == (0, 360)
    assert set(np.diff(used)) == {6, 7}  # 360 / 59 = 6.1
    assert np.array_equal(model.used_beams(scan(np.ones(12))), np.arange(12))
    assert model.beams(scan(np.ones(12))) == 12


def test_the_likelihood_is_one_for_a_perfect_scan_and_tempered_otherwise():
    x = np.array([[1.0], [1.05], [0.0]])
    perfect = scan([2.95], [0.0])
    assert LikelihoodField(room()).log_likelihood(x, perfect)[0] == pytest.approx(0.0, abs=1e-6)
    wrong = scan(np.full(90, 0.3))
    one, ten = (LikelihoodField(room(), effective_beams=b) for b in (1.0, 10.0))
    assert ten.log_likelihood(x, wrong) == pytest.approx(10.0 * one.log_likelihood(x, wrong))
    assert one.log_likelihood(x, wrong)[0] < -0.1
    assert ten.readings(wrong) == 10.0


def test_a_scan_that_is_half_old_counts_half():
    model, x = LikelihoodField(room()), np.ones((3, 4))
    z = scan(np.linspace(0.3, 2.0, 40))
    half = replace(z, novelty=0.5)
    assert model.readings(half) == model.readings(z) / 2.0
    assert model.log_likelihood(x, half) == pytest.approx(model.log_likelihood(x, z) / 2.0)


def test_unknown_has_a_chance_of_its_own():
    """Beams that end far from any wall: z_rand on free cells, z_unknown on unknown ones."""
    model = LikelihoodField(room(), sigma_hit=0.05, z_rand=0.1, z_unknown=0.3, effective_beams=1.0)
    x = np.array([[0.75], [1.2], [np.pi / 2]])
    ahead = model.log_likelihood(x, scan([0.95], [0.0]))
    right = model.log_likelihood(x, scan([0.3], [-np.pi / 2]))
    assert np.exp(ahead) == pytest.approx([0.3], rel=1e-5)
    assert np.exp(right) == pytest.approx([0.1], rel=1e-5)


def test_explained_is_the_share_of_ends_near_a_wall():
    model = LikelihoodField(room(), sigma_hit=0.05)  # near: within 0.15 m
    x = np.array([[1.0], [1.05], [0.0]])
    ends = [3.95, 3.85, 3.75, 2.6]  # at 0, 0.1, 0.2 and over 1 m from a wall
    z = scan([e - 1.0 for e in ends] + [np.nan], [0.0] * 5)
    assert model.explained(x, z) == pytest.approx([0.5])


def test_a_map_without_walls_leaves_chance_alone():
    grid = OccupancyGrid(np.zeros((10, 10), dtype=np.int8), CELL, np.zeros(3))
    model = LikelihoodField(grid, z_rand=0.05, effective_beams=1.0)
    assert model.log_likelihood(np.full((3, 1), 0.5), scan([0.1])) == pytest.approx(
        [math.log(0.05)]
    )


@pytest.mark.parametrize("sigma", [0.0, -0.1, math.nan])
def test_a_deviation_that_cannot_be(sigma):
    with pytest.raises(ConfigError, match=r"LikelihoodField\.sigma_hit"):
        LikelihoodField(room(), sigma_hit=sigma)
