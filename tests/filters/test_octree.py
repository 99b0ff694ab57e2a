"""The octree of poses: its leaves, and what it believes against MCL and on simulated drives."""

import tracemalloc

import numpy as np
import pytest
from tests.filters.test_grid_agreement import (
    MOVES,
    NOISE,
    ROOM,
    SCANS,
    SENSOR,
    SPACE,
    Pools,
    apart,
    by_mcl,
)

from mcloc.density import Gaussian
from mcloc.draws import Draws
from mcloc.errors import ConfigError, FilterError
from mcloc.events import Scan
from mcloc.filters.catalog import Composition
from mcloc.filters.octree import OctreeFilter
from mcloc.filters.octree_leaves import AT_ONCE, Leaves, divided, looks, most_bytes, tree_of
from mcloc.filters.recovery import Augmented
from mcloc.geometry import compose, wrap
from mcloc.localizer import Localizer
from mcloc.maps.occupancy import FREE, OCCUPIED, OccupancyGrid
from mcloc.maps.pose_lattice import PoseLattice
from mcloc.motion import MOTIONS
from mcloc.samplers.pose_boxes import PARTS, PoseBoxes
from mcloc.simulation import Scenario, museum_world, office_drive, office_world, simulate

MOTION = MOTIONS.make("odometry", **NOISE["odometry"])


def octree(deepest=3, most=1e-5, carried_off=1e-9):
    boxes = PoseBoxes(ROOM, 32, 8)  # 1.6 m
    return OctreeFilter(boxes, MOTION, SENSOR, SPACE, Augmented(), most, deepest, carried_off)


def volumes(boxes, leaves):
    return np.array([boxes.sides(level).prod() for level in range(12)])[leaves.level]


def ancestors(boxes, leaves, level):
    """The box of that level which each leaf that is not above it lies in."""
    keys, below = leaves.keys.copy(), leaves.level.copy()
    for k in range(int(below.max(initial=0)), level, -1):
        deep = below == k
        keys[deep] = boxes.parents(keys[deep], k)
        below[deep] = k - 1
    return keys[leaves.level >= level]


def check_tree(boxes, leaves, most, deepest, cover=True):
    """Leaves are disjoint, fill whole boxes of the first level, and have no more mass than they
    may.
    """
    for level in range(int(leaves.level.max()) + 1):
        of_level = leaves.keys[leaves.level == level]
        assert len(np.unique(of_level)) == len(of_level)
        assert not np.isin(
            of_level, ancestors(boxes, leaves.chosen(leaves.level > level), level)
        ).any()
    assert (leaves.level <= deepest).all()
    assert (leaves.mass >= 0.0).all()
    assert (leaves.mass[leaves.level < deepest] <= most * (1.0 + 1e-9)).all()
    if cover:
        roots = np.unique(ancestors(boxes, leaves, 0))
        whole = len(roots) * boxes.sides(0).prod()
        assert volumes(boxes, leaves).sum() == pytest.approx(whole)


@pytest.fixture(params=[1e-3, 1e-5])
def most(request):
    return request.param


# Leaves


def poses(n=4000, seed=1):
    rng = np.random.default_rng(seed)
    x = np.stack([rng.normal(1.0, 0.4, n), rng.normal(1.2, 0.5, n), rng.normal(3.0, 0.5, n)])
    return x, rng.dirichlet(np.ones(n))


@pytest.mark.parametrize("deepest", [0, 2, 4])
def test_a_tree_of_poses_has_small_leaves_where_they_are(most, deepest):
    boxes = PoseBoxes(ROOM, 32, 8)
    x, mass = poses()
    leaves = tree_of(boxes, 0.25, x, 0.75 * mass, most, deepest)
    check_tree(boxes, leaves, most, deepest)
    on = boxes.around(x, 0) >= 0
    assert leaves.mass.sum() == pytest.approx(0.25 + 0.75 * mass[on].sum())
    free = boxes.free_keys()
    assert np.isin(free, ancestors(boxes, leaves, 0)).all()
    fine = leaves.level == deepest
    near = np.isin(boxes.around(x, deepest), leaves.keys[fine])
    assert mass[near].sum() > 0.4


def test_the_mass_of_a_leaf_is_that_of_the_poses_in_it_and_its_part_of_the_rest():
    boxes, most, deepest = PoseBoxes(ROOM, 32, 8), 1e-3, 3
    x, mass = poses()
    leaves = tree_of(boxes, 0.1, x, 0.9 * mass, most, deepest)
    density = 0.1 / (len(boxes.free_keys()) * boxes.sides(0).prod())
    for level in range(deepest + 1):
        of_level = leaves.level == level
        at = boxes.around(x, level)
        for key, found in zip(leaves.keys[of_level], leaves.mass[of_level], strict=True):
            volume = boxes.sides(level).prod()
            one = Leaves(np.array([level]), np.array([key]), mass[:1])
            free = np.isin(ancestors(boxes, one, 0), boxes.free_keys())
            expected = 0.9 * mass[at == key].sum() + density * volume * free[0]
            assert found == pytest.approx(expected, abs=1e-12)


def test_dividing_keeps_mass_and_gives_each_part_an_eighth():
    boxes = PoseBoxes(ROOM, 32, 8)
    x, mass = poses()
    leaves = tree_of(boxes, 0.2, x, 0.8 * mass, 1e-3, 3)
    parts = divided(boxes, leaves)
    assert len(parts.keys) == PARTS * len(leaves.keys)
    assert parts.mass.sum() == pytest.approx(leaves.mass.sum())
    for level in range(4):
        here, below = leaves.chosen(leaves.level == level), parts.chosen(parts.level == level + 1)
        mass_of = dict(zip(here.keys.tolist(), here.mass.tolist(), strict=True))
        expected = [mass_of[k] / PARTS for k in boxes.parents(below.keys, level + 1).tolist()]
        assert below.mass == pytest.approx(expected)


def test_looks_lie_in_their_leaves_and_have_their_mass_whatever_the_chunk(monkeypatch):
    boxes, most = PoseBoxes(ROOM, 32, 8), 1e-4
    x, mass = poses()
    leaves = tree_of(boxes, 0.2, x, 0.8 * mass, most, 3)
    (only,) = looks(boxes, leaves, most, Draws(1))
    assert len(leaves.keys) < AT_ONCE
    here = only[1]
    assert np.bincount(here.leaf, here.mass) == pytest.approx(leaves.mass)
    for level in range(4):
        of_level = leaves.level[here.leaf] == level
        assert np.array_equal(
            boxes.around(here.x[:, of_level], level), leaves.keys[here.leaf[of_level]]
        )
    several = (leaves.mass > most) | (leaves.level == 0)
    assert np.array_equal(np.bincount(here.leaf), np.where(several, PARTS, 1))
    for leaf in np.flatnonzero(several)[:50]:
        parts = boxes.around(here.x[:, here.leaf == leaf], int(leaves.level[leaf]) + 1)
        assert len(np.unique(parts)) == PARTS
    monkeypatch.setattr("mcloc.filters.octree_leaves.AT_ONCE", 100)
    pieces = list(looks(boxes, leaves, most, Draws(1)))
    assert len(pieces) > 3
    assert np.array_equal(np.concatenate([p.x for _, p in pieces], axis=1), here.x)


# Beliefs


def localize(filtered, start, seed):
    """The belief after each scan."""
    bel, found = filtered.start(start, Draws(seed)), []
    for step, (u, z) in enumerate(zip(MOVES, SCANS, strict=True), 1):
        bel, info = filtered.step(bel, u, z, Draws(seed, step))
        check_tree(bel.boxes, bel.leaves, filtered.most, filtered.deepest)
        assert bel.leaves.mass.sum() == pytest.approx(1.0)
        assert info.n == len(bel.leaves.keys) == len(bel.particles)
        assert info.weighed >= info.n
        found.append(bel)
    return found


FAR = Pools((4, 3, 4))


def pooled(bel):
    """Mass in boxes of poses, of poses that are drawn in the leaves."""
    rng, total, leaves = np.random.default_rng(5), 0.0, bel.leaves
    for _ in range(16):
        x, u = np.empty((3, len(leaves.keys))), rng.random((3, len(leaves.keys)))
        for level in np.unique(leaves.level):
            here = leaves.level == level
            x[:, here] = bel.boxes.poses(leaves.keys[here], int(level), u[:, here])
        total = total + FAR.of_poses(x, leaves.mass) / 16
    return total


def test_the_smaller_its_leaves_the_nearer_it_is_to_mcl():
    """Leaves of 0.4 m and 11° to 0.1 m and 3°. Each step spreads what comes to a leaf in it, a
    sixth of the square of its side along each axis: for 0.2 m and 6° about as much as the noise.
    """
    particles = [by_mcl(MOTION, 20_000, SPACE, 1000 + k) for k in range(40)]
    expected = np.mean([FAR.of_poses(p.states, p.weights) for p in particles], axis=0)
    off = [
        apart(
            np.mean([pooled(localize(octree(deepest), SPACE, k)[-1]) for k in seeds], axis=0),
            expected,
        )
        for deepest, seeds in ((2, range(6)), (3, range(3)), (4, range(1)))
    ]
    assert off[0] > 2.0 * off[1] > 4.0 * off[2]
    assert off[1] < 0.04
    assert off[2] < 0.012


def test_the_evidence_is_that_of_mcl():
    """log p(z | d) of each scan, from 3 runs of each within their own spread."""

    def evidence(filtered, seed):
        bel, found = filtered.start(SPACE, Draws(seed)), []
        for step, (u, z) in enumerate(zip(MOVES, SCANS, strict=True), 1):
            bel, info = filtered.step(bel, u, z, Draws(seed, step))
            found.append(info.log_evidence)
        return found

    mcl = Composition("mcl", size="fixed", settings={"size": {"particles": 50_000}}).build(ROOM)
    mcl = type(mcl)(MOTION, SENSOR, SPACE, mcl.parts)
    ours, theirs = (np.array([evidence(f, seed) for seed in (1, 2, 3)]) for f in (octree(3), mcl))
    assert ours.mean(axis=0) == pytest.approx(theirs.mean(axis=0), abs=0.05)


def test_what_the_belief_leaves_is_merged_and_where_it_comes_to_is_divided():
    filtered = octree(4, most=1e-4)
    found = localize(filtered, Gaussian(np.array([0.8, 1.2, -0.3]), np.eye(3) * 0.01), 1)
    first, last = found[0].leaves, found[-1].leaves
    fine, again = (set(leaves.keys[leaves.level == 4].tolist()) for leaves in (first, last))
    assert len(fine - again) > 0.3 * len(fine)
    assert len(again - fine) > 0.3 * len(again)
    assert len(last.keys) < 3 * len(first.keys)


@pytest.mark.parametrize("deviation", [1e-6, 0.02, 0.3])
def test_a_start_around_a_pose_is_there(deviation):
    filtered = octree(4, most=1e-4)
    pose = np.array([0.83, 1.21, -0.3])
    bel = filtered.start(Gaussian(pose, np.eye(3) * deviation**2), Draws(1))
    check_tree(bel.boxes, bel.leaves, 1.01 * filtered.most, 4, cover=False)
    x, w = bel.particles.states, bel.particles.weights
    side = filtered.boxes.sides(4)
    apart_by = np.array([x[0] @ w, x[1] @ w, np.angle(np.exp(1j * x[2]) @ w)]) - pose
    assert (np.abs(apart_by) < 0.5 * side + 0.02 * deviation).all()
    spread = np.sqrt((x[0] - x[0] @ w) ** 2 @ w)
    assert spread == pytest.approx(deviation, abs=0.5 * side[0])


def test_a_uniform_start_is_uniform_over_free_space():
    bel = octree(3).start(SPACE, Draws(1))
    expected = SPACE.sample(Draws(9), 0, 400_000)
    of_free = FAR.of_poses(expected, np.full(400_000, 1.0 / 400_000))
    walls = 14.8 / 0.2 * 0.5 * 0.2**2 / 11.4  # along which half of a leaf lies beyond
    assert apart(pooled(bel), of_free) < 1.3 * walls


def test_starts_and_maps_that_do_not_meet_are_refused():
    far = Gaussian(np.array([50.0, 0.0, 0.0]), np.eye(3) * 0.01)
    with pytest.raises(ConfigError, match="the start lies nowhere on the map"):
        octree().start(far, Draws(1))
    grid = OccupancyGrid(ROOM.cells, ROOM.resolution, np.array([90.0, 0.0, 0.0]))
    elsewhere = Composition("octree").build(grid)
    with pytest.raises(FilterError, match="nothing of what was believed"):
        elsewhere.adopted(octree().start(SPACE, Draws(1)))


class Hopeless:
    def log_likelihood(self, x, z):
        return np.full(x.shape[1], z)

    def readings(self, z):
        return 1.0

    def source(self, z):
        return "none"


@pytest.mark.parametrize("worth", [-np.inf, np.nan])
def test_a_scan_that_no_pose_explains_raises(worth):
    parts = (PoseBoxes(ROOM, 32, 8), MOTION, Hopeless(), SPACE, Augmented(), 1e-4, 2, 1e-3)
    filtered = OctreeFilter(*parts)
    bel = filtered.start(SPACE, Draws(1))
    with pytest.raises(FilterError):
        filtered.step(bel, MOVES[0], worth, Draws(1, 1))


@pytest.mark.parametrize("worth", [-5000.0, 500.0])
def test_only_ratios_of_likelihoods_matter(worth):
    parts = (PoseBoxes(ROOM, 32, 8), MOTION, Hopeless(), SPACE, Augmented(), 1e-4, 2, 1e-3)
    filtered = OctreeFilter(*parts)
    bel = filtered.start(SPACE, Draws(1))
    one, info = filtered.step(bel, MOVES[0], worth, Draws(1, 1))
    other, zero = filtered.step(bel, MOVES[0], 0.0, Draws(1, 1))
    assert one.leaves.mass == pytest.approx(other.leaves.mass, rel=1e-6)
    assert info.log_evidence == pytest.approx(worth + zero.log_evidence)


def test_what_is_adopted_is_where_it_was():
    """On the same map, whose frame lies elsewhere under it."""
    filtered = octree(4)
    bel = filtered.start(Gaussian(np.array([0.9, 1.3, 0.4]), np.diag([0.02, 0.01, 0.05])), Draws(1))
    turned = OccupancyGrid(
        np.rot90(ROOM.cells, -1),
        ROOM.resolution,
        compose(ROOM.origin, [0.0, ROOM.cells.shape[0] * ROOM.resolution, -np.pi / 2]),
    )
    other = OctreeFilter(
        PoseBoxes(turned, 32, 8), MOTION, SENSOR, SPACE, Augmented(), 1e-5, 4, 1e-3
    )
    again = other.adopted(bel)
    check_tree(other.boxes, again.leaves, 1e-5, 4)
    means = []
    for b in (bel, again):
        x, w = b.particles.states, b.particles.weights
        means.append([x[0] @ w, x[1] @ w, np.angle(np.exp(1j * x[2]) @ w)])
    assert (np.abs(np.subtract(*means)) < 0.5 * filtered.boxes.sides(4)).all()


def test_one_seed_gives_the_same_bytes_whatever_the_threads(set_threads):
    found = []
    for threads in (1, 2, 2):
        set_threads(threads)
        bel = localize(octree(3), SPACE, 7)[-1]
        found.append(tuple(a.tobytes() for a in bel.leaves))
    assert found[0] == found[1] == found[2]
    other = localize(octree(3), SPACE, 8)[-1]
    assert tuple(a.tobytes() for a in other.leaves) != found[0]


# Drives


@pytest.fixture(scope="module")
def drive():
    return office_drive(seed=2, length=8.0)


def estimates(drive, initial=None):
    coarse = Composition("octree", settings={"filter": {"most": 1e-5}})
    localizer = Localizer(drive.grid, coarse, seed=4, initial=initial)
    return localizer, list(localizer.run(drive.events))


def errors(drive, found):
    t = np.array([e.t for e in found])
    return np.hypot(*(np.array([e.pose for e in found]) - drive.truth.at(t))[:, :2].T)


@pytest.mark.parametrize(
    ("side", "cell", "most"), [(6.0, 0.1, 1e-5), (14.0, 0.1, 2e-5), (30.0, 0.2, 1e-5)]
)
def test_a_step_takes_no_more_memory_than_it_is_refused_for(side, cell, most):
    """While the robot may be anywhere on a map that is all free, by scans that say nothing. Beside
    that, it takes 30 MB for the poses that are looked at together.
    """
    n = round(side / 0.1)
    grid = OccupancyGrid(np.full((n, n), FREE, dtype=np.int8), 0.1, np.zeros(3), name="free")
    settings = {"filter": {"cell": cell, "most": most}}
    filtered = Composition("octree", settings=settings).build(grid)
    nothing = Scan(0.0, np.full(20, np.nan), np.linspace(-1.5, 1.5, 20), 10.0)
    bel = filtered.start(filtered.environment, Draws(1))
    tracemalloc.start()
    for step in range(1, 4):
        after, _ = filtered.step(bel, np.array([0.3, 0.0, 0.2]), nothing, Draws(1, step))
        filtered.hypotheses(after)
        bel = after
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    allowed = most_bytes(filtered.boxes, most, filtered.deepest)
    assert 0.3 * allowed < peak < allowed + 30e6
    refused = {"filter": {**settings["filter"], "memory": 0.99e-6 * allowed}}
    with pytest.raises(ConfigError, match=r"free: filter\.most = .* use a larger filter\.most"):
        Composition("octree", settings=refused).build(grid)


@pytest.mark.parametrize("world", [office_world, museum_world])
def test_the_defaults_suit_floors_and_finer_trees_are_refused(world):
    """A tree of 100 million leaves, of which each takes 200 bytes or more."""
    assert Composition("octree").build(world(1))
    fine = Composition("octree", settings={"filter": {"most": 1e-8, "cell": 0.02}})
    with pytest.raises(ConfigError, match=r"filter\.memory = 4000 MB; use a larger filter\.most"):
        fine.build(world(1))


def test_it_finds_a_robot_anywhere_and_tracks_it_with_few_leaves(drive):
    localizer, found = estimates(drive)
    wrong = errors(drive, found)
    assert np.median(wrong) < 0.1
    assert wrong[len(wrong) // 2 :].max() < 0.4
    headings = (
        np.array([e.pose[2] for e in found]) - drive.truth.at(np.array([e.t for e in found]))[:, 2]
    )
    assert np.median(np.abs(wrap(headings))) < 0.03
    leaves = sum(array.nbytes for array in localizer.belief.leaves)
    side = localizer.filter.boxes.sides(localizer.filter.deepest)
    lattice = PoseLattice(drive.grid, float(side[0]), round(2.0 * np.pi / side[2]))
    assert leaves < 0.02 * 4 * lattice.size


@pytest.mark.parametrize("seed", [1, 2, 4])
def test_a_robot_that_is_carried_off_is_found_again(seed):
    """In less than 6 s, that is 3 m; then until the end."""
    drive = simulate(office_world(seed), seed, Scenario(length=16.0, kidnap_at=(12.0,)))
    _, found = estimates(drive, initial=drive.truth.poses[0])
    t, wrong = np.array([e.t for e in found]), errors(drive, found)
    kidnapped = drive.kidnappings[0]
    assert wrong[t < kidnapped].max() < 0.4
    assert wrong[(t >= kidnapped) & (t < kidnapped + 0.4)].max() > 1.0
    assert wrong[t > kidnapped + 6.0].max() < 0.5


def test_a_room_without_walls_at_its_sides_has_leaves_to_its_edges():
    """Maps whose sides are no multiples of the largest boxes."""
    cells = np.full((37, 50), FREE, dtype=np.int8)
    cells[10, 10] = OCCUPIED
    grid = OccupancyGrid(cells, 0.1, np.array([0.0, 0.0, 1.0]))
    filtered = Composition("octree", settings={"filter": {"cell": 0.4}}).build(grid)
    bel = filtered.start(filtered.environment, Draws(1))
    check_tree(bel.boxes, bel.leaves, filtered.most, filtered.deepest, cover=False)
    x = filtered.environment.sample(Draws(2), 0, 20_000)
    deep = filtered.boxes.around(x, filtered.deepest)
    assert np.isin(deep, bel.leaves.keys).mean() > 0.99
