"""Grid-based Markov localization and Monte Carlo localization believe the same: in a small room,
with the same motion, sensor and environment, masses of boxes of poses are compared. The grid's are
extrapolated from three sizes of cells, MCL's have the standard error of independent repeats.

The selective update is switched off but for one check: it is an approximation of its own. So is
the chance in the moments of a move, which are taken from many more moves here than usually.
"""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.stats import chi2

from mcloc.density import Gaussian
from mcloc.draws import Draws
from mcloc.environment import FreeSpace
from mcloc.events import Scan
from mcloc.filters.markov_grid import MarkovGridFilter
from mcloc.filters.particle_filter import Part, ParticleFilter
from mcloc.filters.recovery import NoRandomParticles
from mcloc.geometry import compose
from mcloc.kernels.blur import SIDE
from mcloc.maps.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from mcloc.maps.pose_lattice import PoseLattice
from mcloc.motion import MOTIONS
from mcloc.proposals.forward import Forward
from mcloc.resampling import Systematic
from mcloc.sample_size import Fixed
from mcloc.sensors.likelihood_field import LikelihoodField
from mcloc.simulation import ranges

NOISE = {
    "omnidirectional": {"sigma_trans_min": 0.08, "sigma_rot_min": 0.06},
    "odometry": {"sigma_trans_min": 0.05, "sigma_rot_min": 0.05},
}
SIZES = ((0.2, 45), (0.1, 90), (0.05, 180))  # m, and slices of 8°, 4°, 2°
OFF = 1e-9  # for the shares that make the update selective, and carry robots off
MOVES = [np.array(u) for u in ([0.3, 0, 0.2], [0.3, 0, 0.4], [0.25, 0, -0.3], [0.35, 0, 0.1])]
START = np.array([0.8, 1.2, -0.3])
REPEATS, PARTICLES = 60, 20_000
DRAWS, FEW = 1500, 500  # of the G-test: repeats that give one pose each, by so many particles


def room():
    """4 m × 3 m, a corner of which is walled off, with a box at a wall; all else is unknown."""
    cells = np.full((80, 100), UNKNOWN, dtype=np.int8)
    cells[8:72, 8:92] = OCCUPIED
    cells[10:70, 10:90] = FREE
    cells[50:70, 70:90] = OCCUPIED
    cells[10:22, 38:50] = OCCUPIED
    return OccupancyGrid(cells, 0.05, np.array([-0.5, -0.5, 0.0]))


ROOM = room()
SPACE = FreeSpace(ROOM)
SENSOR = LikelihoodField(ROOM, sigma_hit=0.5, effective_beams=2.0)


def scans():
    """Of a robot that moves as it is told, with six beams."""
    angles, pose, found = np.linspace(-2.4, 2.4, 6), START, []
    for u in MOVES:
        pose = compose(pose, u)
        found.append(Scan(0.0, ranges(ROOM, pose[None], angles, 8.0)[0], angles, 8.0))
    return found


SCANS = scans()


@dataclass(frozen=True)
class Pools:
    """Boxes of poses over the room: so many along x, y and θ."""

    shape: tuple[int, int, int]

    @property
    def sides(self):
        return np.array([4.0, 3.0, 2.0 * np.pi]) / self.shape

    def of_poses(self, x, weights):
        """(M + 1,): the last is what lies beside the room."""
        at = np.floor(np.stack([x[0], x[1], np.mod(x[2], 2.0 * np.pi)]) / self.sides[:, None])
        within = ((at >= 0) & (at < np.array(self.shape)[:, None]))[:2].all(axis=0)
        at = np.minimum(at, np.array(self.shape)[:, None] - 1).astype(int)
        box = (at[0] * self.shape[1] + at[1]) * self.shape[2] + at[2]
        count = int(np.prod(self.shape))
        return np.bincount(np.where(within, box, count), weights, count + 1)

    def of_grid(self, bel):
        """The same of cells, each of which is spread evenly over its sides."""
        lattice, found = bel.lattice, np.zeros(self.shape)
        step = lattice.sides[2]
        for k, heading in enumerate(lattice.headings(bel.turn)):
            low = np.mod(heading - 0.5 * step, 2.0 * np.pi)
            parts = [
                overlap(
                    (np.mod(np.arange(n) + bel.offsets[k, axis], n) - SIDE) * lattice.cell - 0.5,
                    lattice.cell,
                    self.sides[axis],
                    self.shape[axis],
                )
                for axis, n in enumerate(lattice.shape[:0:-1])
            ]
            turned = overlap(np.array([low, low - 2.0 * np.pi]), step, self.sides[2], self.shape[2])
            placed = parts[0].T @ bel.cells[k].T.astype(np.float64) @ parts[1]
            found += placed[:, :, None] * turned.sum(axis=0)
        return np.append(found.ravel(), 1.0 - found.sum())


def overlap(low, width, side, count):
    """(n, count): which part of each interval lies in each of the boxes, from 0 on."""
    edges = side * np.arange(count + 1)
    ends = np.minimum(low[:, None] + width, edges[1:]), np.maximum(low[:, None], edges[:-1])
    return np.maximum(ends[0] - ends[1], 0.0) / width


def run(filtered, start, seed):
    """The belief after all scans."""
    bel = filtered.start(start, Draws(seed))
    for step, (u, z) in enumerate(zip(MOVES, SCANS, strict=True), 1):
        bel, _ = filtered.step(bel, u, z, Draws(seed, step))
    return bel


def by_grid(motion, size, start, active=OFF, carried_off=OFF):
    lattice = PoseLattice(ROOM, *size)
    return run(MarkovGridFilter(lattice, motion, SENSOR, SPACE, active, carried_off), start, 1)


def by_mcl(motion, particles, start, seed):
    part = Part(1.0, Forward(Systematic()), Fixed(particles))
    recovery = NoRandomParticles(doubt_below=0.0)
    return run(ParticleFilter(motion, SENSOR, SPACE, (part,), recovery), start, seed).particles


def mean_and_error(motion, start, pools):
    """Of each box by MCL."""
    found = np.array(
        [
            pools.of_poses(p.states, p.weights)
            for p in (by_mcl(motion, PARTICLES, start, 1000 + k) for k in range(REPEATS))
        ]
    )
    return found.mean(axis=0), found.std(axis=0, ddof=1) / np.sqrt(REPEATS)


def apart(a, b):
    """Total variation."""
    return 0.5 * float(np.abs(a - b).sum())


NEAR = Pools((16, 12, 12))
TOLD = Gaussian(START, np.eye(3) * 0.12**2)


@pytest.fixture(scope="module", params=list(NOISE))
def motion(request):
    return MOTIONS.make(request.param, **NOISE[request.param])


@pytest.fixture(scope="module")
def many_moves():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("mcloc.motion.moments.MOVES", 1 << 17)
        patch.setattr("mcloc.filters.markov_grid.STARTING", 1 << 20)
        yield


@pytest.fixture(scope="module")
def grids(motion, many_moves):
    """For each size of the cells, finer and finer."""
    return [NEAR.of_grid(by_grid(motion, size, TOLD)) for size in SIZES]


def extrapolated(grids):
    """From errors in proportion to the squared size; and what the finest cells changed of it."""
    coarse, middle, fine = grids
    one, two = (4.0 * middle - coarse) / 3.0, (4.0 * fine - middle) / 3.0
    return two, np.abs(two - one)


@pytest.fixture(scope="module")
def by_repeats(motion):
    return mean_and_error(motion, TOLD, NEAR)


def test_the_finer_the_grid_the_nearer_it_is_to_mcl(motion, grids, by_repeats):
    """And in the end as near as MCL is to itself. Where the noise across the way is that of turning
    alone, as of wheels, merging slices cost more, and it takes smaller cells.
    """
    mean, error = by_repeats
    off = [apart(grid, mean) for grid in grids]
    assert off[0] > 2.0 * off[1] > 4.0 * off[2]
    assert off[2] < (0.006 if "strafe" in repr(motion.decompose(MOVES[0])) else 0.025)
    assert 0.5 * error.sum() < 0.005


@pytest.mark.parametrize("motion", ["omnidirectional"], indirect=True)
def test_the_extrapolated_grid_agrees_with_mcl_within_their_errors(grids, by_repeats):
    """In each box, 4.5 standard errors. What merging slices cost falls slower than extrapolation
    takes for granted, until slices are much smaller than the noise: with wheels at less than 2°.
    """
    (mean, error), (grid, uncertain) = by_repeats, extrapolated(grids)
    large = mean > 2e-3
    assert large.sum() > 25
    assert mean[large].sum() > 0.95
    assert (np.abs(grid - mean) <= 4.5 * error + uncertain)[large].all()
    assert apart(grid, mean) < 0.006
    assert np.abs(grid - mean)[~large].max() < 2e-3


def g_test(counts, expected):
    """p of G = 2 Σ o log(o / e) ~ χ²; boxes with e < 5 are one."""
    expected = np.maximum(expected, 0.0) / np.maximum(expected, 0.0).sum() * counts.sum()
    enough = expected >= 5.0
    o, e = (np.append(a[enough], a[~enough].sum()) for a in (counts, expected))
    if e[-1] < 5.0:
        o, e = (np.append(a[:-2], a[-2:].sum()) for a in (o, e))
    g = 2.0 * np.sum(o[o > 0] * np.log(o[o > 0] / e[o > 0]))
    return float(chi2.sf(g, len(o) - 1)), len(o)


@pytest.fixture(scope="module")
def counts(motion):
    """One pose of each repeat of MCL, by weight: independent draws from what it believes."""
    rng, found = np.random.default_rng(3), 0.0
    for k in range(DRAWS):
        particles = by_mcl(motion, FEW, TOLD, 5000 + k)
        one = rng.choice(FEW, p=particles.weights)
        found = found + NEAR.of_poses(particles.states[:, [one]], np.ones(1))
    return found


def test_draws_of_mcl_are_draws_from_the_grid(grids, counts):
    p, boxes = g_test(counts, extrapolated(grids)[0])
    assert counts.sum() == DRAWS
    assert boxes > 20
    assert p > 0.01


@pytest.mark.parametrize("factor", [0.75, 1.25, 2.0])
def test_they_would_not_be_if_the_grid_took_noise_for_more_or_less(motion, counts, factor):
    """A quarter of it is seen already."""
    names = [name for name in vars(motion) if name.startswith(("alpha", "sigma"))]
    other = replace(motion, **{name: factor * getattr(motion, name) for name in names})
    p, _ = g_test(counts, NEAR.of_grid(by_grid(other, SIZES[1], TOLD)))
    assert p < 1e-3


def test_the_selective_update_changes_little(motion, grids):
    """With the defaults."""
    found = NEAR.of_grid(by_grid(motion, SIZES[1], TOLD, 1e-3, 1e-4))
    assert apart(found, grids[1]) < 0.005


def test_from_anywhere_in_the_room(many_moves):
    """A uniform start: what remains of it after four scans is here and there."""
    motion, far = MOTIONS.make("odometry", **NOISE["odometry"]), Pools((4, 3, 4))
    grids = [far.of_grid(by_grid(motion, size, SPACE)) for size in SIZES]
    mean, error = mean_and_error(motion, SPACE, far)
    grid, uncertain = extrapolated(grids)
    assert (mean > 1e-3).sum() > 25
    assert (np.abs(grid - mean) <= 4.5 * error + uncertain + 1e-4).all()
    assert apart(grid, mean) < 0.006
