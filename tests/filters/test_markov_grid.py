"""Grid-based Markov localization against Bayes' rule by enumeration, and on simulated drives."""

import itertools
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from mcloc.density import Gaussian
from mcloc.draws import Draws
from mcloc.environment import FreeSpace
from mcloc.errors import ConfigError, FilterError
from mcloc.events import Scan
from mcloc.filters.catalog import Composition
from mcloc.filters.grid_taps import taps
from mcloc.filters.markov_grid import LOOKS, MarkovGridFilter, most_bytes
from mcloc.geometry import compose, wrap
from mcloc.localizer import Localizer
from mcloc.maps.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from mcloc.maps.pose_lattice import PoseLattice
from mcloc.motion import MOTIONS
from mcloc.motion.moments import moments_of_move
from mcloc.simulation import Scenario, office_drive, office_world, simulate

SLICES = 12


class Beacon:
    """Sees how far off the place (1, 1) m is, and which way it faces. z: metres, radians."""

    sharp = 0.4

    def log_likelihood(self, x, z):
        off = np.hypot(x[0] - 1.0, x[1] - 1.0) - z[0]
        return -0.5 * (off / self.sharp) ** 2 + 2.0 * (np.cos(x[2] - z[1]) - 1.0)

    def readings(self, z):
        return 3.0

    def source(self, z):
        return "beacon"


def room():
    """3.2 m × 2.4 m, some of it unknown, with a wall; turned."""
    cells = np.full((24, 32), FREE, dtype=np.int8)
    cells[:, 20:22] = OCCUPIED
    cells[:6, 24:] = UNKNOWN
    return OccupancyGrid(cells, 0.1, np.array([0.4, -0.3, 0.3]), name="room")


def grid_filter(active=1e-12, carried_off=0.01, sensor=None, cell=0.2, grid=None):
    grid = grid or room()
    parts = MOTIONS.make("odometry"), sensor or Beacon(), FreeSpace(grid)
    return MarkovGridFilter(PoseLattice(grid, cell, SLICES), *parts, active, carried_off)


MOVES = [np.array(u) for u in ([0.3, 0.02, 0.3], [0.25, 0.0, -0.6], [-0.1, 0.0, 0.1])]
SEEN = [(0.9, 0.2), (0.7, 0.5), (0.8, 0.0)]


def by_hand(filtered, bel, u, z, draws):
    """The masses after one step in which all cells are active, and the evidence: sums over all taps
    of all cells, then Bayes' rule.
    """
    lattice, cells = filtered.lattice, bel.cells.astype(np.float64)
    mean, covariance = moments_of_move(filtered.motion, u, draws)
    headings = bel.turn + 2.0 * np.pi / SLICES * np.arange(SLICES)
    turned = np.array([[[np.cos(h), -np.sin(h), 0], [np.sin(h), np.cos(h), 0], [0, 0, 1]]
                       for h in headings])  # fmt: skip
    offsets = bel.offsets + np.array([t @ mean for t in turned])[:, :2] / lattice.cell
    for axis in (0, 1):  # what leaves on one side does not come in on the other
        size = cells.shape[2 - axis]
        for k, line in itertools.product(range(SLICES), range(size)):
            if (line + 0.5 + bel.offsets[k, axis]) // size != (
                line + 0.5 + offsets[k, axis]
            ) // size:
                cells[(k, slice(None), line) if axis == 0 else (k, line)] = 0.0
    unit = 1.0 / lattice.sides
    noise = np.array([np.diag(unit) @ t @ covariance @ t.T @ np.diag(unit) for t in turned])
    for r in taps(noise, offsets):
        old, cells = cells, np.zeros_like(cells)
        for k, t in itertools.product(range(SLICES), range(r.weights.shape[1])):
            move = r.rows[k, t], r.columns[k, t]
            cells[k] += r.weights[k, t] * np.roll(old[r.slices[k, t]], move, axis=(0, 1))
    alpha = filtered.carried_off
    cells = (1.0 - alpha) * cells + alpha / cells.size
    x = lattice.poses(
        np.arange(lattice.size), np.mod(offsets, cells.shape[:0:-1]), bel.turn + mean[2]
    )
    log_p = filtered.sensor.log_likelihood(x, z) + filtered.environment.log_prior(x)
    weighed = cells.ravel() * np.exp(log_p)
    return weighed / weighed.sum(), np.log(weighed.sum())


def test_each_step_is_bayes_rule_where_all_cells_are_active():
    filtered = grid_filter()
    bel = filtered.start(filtered.environment, Draws(1))
    for step, (u, z) in enumerate(zip(MOVES, SEEN, strict=True), 1):
        expected, evidence = by_hand(filtered, bel, u, z, Draws(1, step))
        bel, info = filtered.step(bel, u, z, Draws(1, step))
        assert bel.cells.ravel() == pytest.approx(expected, rel=1e-4, abs=1e-9)
        assert bel.cells.sum(dtype=np.float64) == pytest.approx(1.0, abs=1e-6)
        assert info.log_evidence == pytest.approx(evidence, abs=1e-4)
        assert info.n == len(bel.particles)
        assert info.weighed >= filtered.lattice.size


def test_the_likelihood_of_a_reading_is_that_over_what_was_predicted():
    filtered = grid_filter()
    bel = filtered.start(filtered.environment, Draws(1))
    predicted, _ = filtered.predicted(bel, MOVES[0], Draws(1, 1))
    likelihood = np.exp(Beacon().log_likelihood(predicted.particles.states, SEEN[0]) / 3.0)
    after, info = filtered.step(bel, MOVES[0], SEEN[0], Draws(1, 1))
    expected = predicted.particles.weights @ likelihood
    assert info.evidence.fast == pytest.approx(expected, rel=1e-5)
    assert after.evidence == {"beacon": info.evidence}


# Selective update


def test_passive_cells_keep_ratio_1_and_active_ones_get_p_over_its_average():
    filtered = grid_filter(active=1e-2, carried_off=1e-3)
    bel = filtered.start(Gaussian(np.array([1.5, 0.9, 0.5]), np.diag([0.04, 0.04, 0.1])), Draws(1))
    for step, (u, z) in enumerate(zip(MOVES, SEEN, strict=True), 1):
        draws = Draws(1, step)
        predicted, _ = filtered.predicted(bel, u, draws)
        before, active = predicted.cells.ravel().copy(), predicted.active
        anywhere = filtered.environment.sample(draws, 0, LOOKS)
        log_average = np.log(np.mean(np.exp(Beacon().log_likelihood(anywhere, z))))
        bel, info = filtered.step(bel, u, z, draws)
        ratio = bel.cells.ravel().astype(np.float64) / before
        passive = np.setdiff1d(np.arange(len(before)), active)
        assert 50 < len(active) < 0.5 * len(before)
        assert ratio[passive] == pytest.approx(ratio[passive[0]], rel=1e-6)
        x = predicted.particles.states
        expected = Beacon().log_likelihood(x, z) + filtered.environment.log_prior(x) - log_average
        found = np.log(ratio[active] / ratio[passive[0]])
        assert found == pytest.approx(expected, abs=1e-4)
        assert bel.cells.sum(dtype=np.float64) == pytest.approx(1.0, abs=1e-6)
        total = before[passive].sum() + before[active] @ np.exp(expected)
        assert info.log_evidence == pytest.approx(np.log(total) + log_average, abs=1e-4)
        assert info.weighed == len(active) + LOOKS


def test_passive_cells_gain_until_they_are_active_where_active_ones_explain_nothing():
    """Carried off: what is believed explains scans worse than the average place."""
    sensor = Beacon()
    sensor.sharp = 0.15
    filtered = grid_filter(active=1e-2, carried_off=1e-3, sensor=sensor)
    bel = filtered.start(Gaussian(np.array([1.1, 1.0, 0.3]), np.eye(3) * 0.01), Draws(1))
    numbers, z = [], (1.5, 2.5)
    for step in range(1, 12):
        bel, info = filtered.step(bel, np.zeros(3), z, Draws(1, step))
        numbers.append(info.weighed - LOOKS)
    assert max(numbers) > 3 * numbers[0]
    assert max(numbers) > 0.5 * filtered.lattice.size
    near = np.abs(np.hypot(*(bel.particles.states[:2] - 1.0)) - z[0]) < 0.5
    assert bel.particles.weights[near].sum() > 0.95


@pytest.mark.parametrize("sharp", [0.02, 0.005])
def test_a_sensor_however_sharp_does_not_overflow(sharp):
    """p / p̃ beyond what float32 can hold, and p of all that is active below it."""
    sensor = Beacon()
    sensor.sharp = sharp
    filtered = grid_filter(active=1e-2, carried_off=1e-3, sensor=sensor)
    bel = filtered.start(filtered.environment, Draws(1))
    for step, z in enumerate([(0.9, 0.2), (30.0, 0.2), (0.9, 0.2), (0.1, 0.2)], 1):
        bel, info = filtered.step(bel, MOVES[2], z, Draws(1, step))
        assert np.isfinite(bel.cells).all()
        assert bel.cells.sum(dtype=np.float64) == pytest.approx(1.0, abs=1e-5)
        assert np.isfinite(info.log_evidence)


class Blind(Beacon):
    def log_likelihood(self, x, z):
        return np.full(x.shape[1], z)


def test_a_scan_that_says_nothing_leaves_what_was_predicted_but_for_where_a_robot_can_be():
    filtered = grid_filter(sensor=Blind())
    bel = filtered.start(filtered.environment, Draws(1))
    predicted, _ = filtered.predicted(bel, MOVES[0], Draws(1, 1))
    prior = filtered.environment.log_prior(predicted.particles.states)
    expected = predicted.particles.weights * np.exp(prior)
    after, _ = filtered.step(bel, MOVES[0], 0.0, Draws(1, 1))
    found = after.cells.ravel()[predicted.active]
    assert found == pytest.approx(expected / expected.sum(), rel=1e-4, abs=1e-9)


def test_a_likelihood_that_is_no_number_raises():
    filtered = grid_filter(sensor=Blind())
    bel = filtered.start(filtered.environment, Draws(1))
    with pytest.raises(FilterError):
        filtered.step(bel, MOVES[0], np.nan, Draws(1, 1))


# Starts


def moments(bel):
    x, w = bel.particles.states, bel.particles.weights
    mean = np.array([x[0] @ w, x[1] @ w, np.angle(np.exp(1j * x[2]) @ w)])
    apart = x - mean[:, None]
    apart[2] = wrap(apart[2])
    return mean, np.sqrt(apart**2 @ w)


def test_a_uniform_start_is_uniform_over_free_cells():
    filtered = grid_filter()
    bel = filtered.start(filtered.environment, Draws(1))
    x = filtered.lattice.poses(np.arange(filtered.lattice.size), bel.offsets, bel.turn)
    free = np.isfinite(filtered.environment.log_density(x))
    cells = bel.cells.ravel()
    assert cells[~free].max() == 0.0
    assert cells[free] == pytest.approx(1.0 / free.sum(), rel=1e-5)


@pytest.mark.parametrize("deviation", [1e-6, 0.003, 0.05, 0.3])
@pytest.mark.parametrize("turned", [0.0, 0.9])
def test_a_start_is_where_it_should_be_also_if_it_is_narrower_than_a_cell(deviation, turned):
    """A long and narrow one across the cells too. Within a cell nothing is known; its mean is as
    exact as the number of poses lets it.
    """
    cells = np.full((60, 60), FREE, dtype=np.int8)
    filtered = grid_filter(grid=OccupancyGrid(cells, 0.1, np.array([-3.0, -3.0, 0.0])))
    across = np.array([np.cos(turned), np.sin(turned), 0.0])
    covariance = np.eye(3) * 1e-14 + deviation**2 * np.outer(across, across)
    pose = np.array([0.13, -0.26, 0.1])
    bel = filtered.start(Gaussian(pose, covariance), Draws(3))
    mean, spread = moments(bel)
    side = filtered.lattice.sides
    assert (np.abs(mean - pose) <= 0.5 * side + 5.0 * deviation / 500).all()
    expected = np.sqrt(np.diag(covariance))
    assert (spread <= np.hypot(expected, side / 2) + 0.01).all()
    assert (spread >= expected - side / 2).all()


def test_a_uniform_start_without_the_middle_of_a_cell_in_free_space_is_refused():
    """A corridor of 0.3 m between the middles of cells of 1 m."""
    cells = np.full((40, 40), OCCUPIED, dtype=np.int8)
    cells[:, 11:14] = FREE
    narrow = OccupancyGrid(cells, 0.1, np.zeros(3), name="narrow")
    filtered = grid_filter(cell=1.0, grid=narrow)
    with pytest.raises(ConfigError, match=r"narrow: no cell of 1 m has .* a smaller filter\.cell"):
        filtered.start(filtered.environment, Draws(1))
    fine = grid_filter(cell=0.2, grid=narrow)
    assert fine.start(fine.environment, Draws(1)).cells.sum() == pytest.approx(1.0)


def test_a_start_off_the_grid_is_refused():
    filtered = grid_filter()
    with pytest.raises(ConfigError, match="room: the start lies nowhere on the map"):
        filtered.start(Gaussian(np.array([50.0, 0.0, 0.0]), np.eye(3) * 0.01), Draws(1))


# Maps


def test_a_grid_that_takes_too_much_memory_is_refused_with_what_would_help():
    office = office_world(1)
    small = Composition("markov-grid", settings={"filter": {"memory": 40.0}})
    with pytest.raises(ConfigError, match=r"filter\.memory = 40 MB; .*filter\.cell.*headings"):
        small.build(office)
    coarse = {"memory": 40.0, "cell": 0.8, "headings": 24}
    assert Composition("markov-grid", settings={"filter": coarse}).build(office)


def peak(filtered, scan, steps=2):
    """Bytes of the steps of a robot that may be anywhere, with all cells active."""
    bel = filtered.start(filtered.environment, Draws(1))
    tracemalloc.start()
    for step in range(1, steps + 1):
        after, _ = filtered.step(bel, MOVES[0], scan, Draws(1, step))
        filtered.hypotheses(after)
        bel = after
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert len(bel.particles) > 0.99 * bel.cells.size
    return most


@pytest.mark.parametrize(
    ("side", "cell", "headings"),
    [(9.0, 0.1, 90), (14.0, 0.2, 90), (14.0, 0.2, 24), (24.0, 0.5, 24)],
)
def test_a_step_takes_no_more_memory_than_it_is_refused_for(side, cell, headings):
    """On a map that is all free, by scans that say nothing. Beside that, it takes 20 MB for the
    poses that are looked at together.
    """
    n = round(side / 0.1)
    grid = OccupancyGrid(np.full((n, n), FREE, dtype=np.int8), 0.1, np.zeros(3), name="free")
    settings = {"filter": {"cell": cell, "headings": headings, "active": 1e-9}}
    filtered = Composition("markov-grid", settings=settings).build(grid)
    nothing = Scan(0.0, np.full(20, np.nan), np.linspace(-1.5, 1.5, 20), 10.0)
    most = most_bytes(filtered.lattice)
    assert 0.7 * most < peak(filtered, nothing) < most + 20e6
    refused = {"filter": {**settings["filter"], "memory": 0.99e-6 * most}}
    with pytest.raises(ConfigError, match=r"filter\.memory"):
        Composition("markov-grid", settings=refused).build(grid)


@pytest.mark.parametrize("ranges", ["exact", "table"])
def test_the_sensor_model_is_the_one_that_was_chosen(ranges):
    """And so the one that config.yaml names."""
    chosen = Composition("markov-grid", sensor="beam-yee", settings={"sensor": {"ranges": ranges}})
    assert chosen.build(room()).sensor.ranges == ranges


def test_near_1_no_cell_of_a_robot_that_may_be_anywhere_would_be_active():
    with pytest.raises(ConfigError, match=r"filter\.active = 0\.999 must be > 0 and <= 0\.5"):
        Composition("markov-grid", settings={"filter": {"active": 0.999}}).build(room())


@pytest.fixture(scope="module")
def drive():
    return office_drive(seed=2, length=8.0)


def estimates(grid, events, initial=None, name="markov-grid", **options):
    localizer = Localizer(grid, name, seed=4, initial=initial, **options)
    return list(localizer.run(events))


def errors(drive, found):
    t = np.array([e.t for e in found])
    return np.hypot(*(np.array([e.pose for e in found]) - drive.truth.at(t))[:, :2].T)


def test_the_first_scan_tells_where_it_is_on_the_whole_map_and_it_tracks(drive):
    found = estimates(drive.grid, drive.events)
    wrong = errors(drive, found)
    assert wrong.max() < 0.4
    assert np.median(wrong) < 0.15
    assert found[-1].update.info.n < 0.01 * found[0].update.info.n


def test_the_frame_of_the_map_does_not_matter(drive):
    """The same drive on a map that lies elsewhere, turned."""
    frame = np.array([40.0, -25.0, 2.1])
    grid = drive.grid
    there = OccupancyGrid(grid.cells, grid.resolution, compose(frame, grid.origin))
    one, other = (estimates(g, drive.events[:150]) for g in (grid, there))
    expected = compose(frame, np.array([e.pose for e in one]))
    found = np.array([e.pose for e in other])
    assert np.abs(found - expected)[:, :2].max() < 0.02
    assert np.abs(wrap(found[:, 2] - expected[:, 2])).max() < 0.01


def test_threads_do_not_matter(drive, set_threads):
    found = []
    for threads in (1, 2):
        set_threads(threads)
        last = estimates(drive.grid, drive.events[:60])[-1]
        found.append((last.pose.tobytes(), last.update.particles.states.tobytes()))
    assert found[0] == found[1]


def test_a_scan_without_any_return_changes_no_more_than_the_move_does(drive):
    scans = [e for e in drive.events if isinstance(e, Scan)]
    filtered = Composition("markov-grid").build(drive.grid)
    start = drive.truth.at(np.array([scans[0].t]))[0]
    bel = filtered.start(Gaussian(start, np.diag([0.01, 0.01, 0.003])), Draws(1))
    for k, nothing in enumerate((np.nan, np.inf, 0.0), 1):
        empty = replace(scans[0], ranges=np.full(len(scans[0].ranges), nothing))
        bel, info = filtered.step(bel, np.zeros(3), empty, Draws(1, k))
        assert np.isfinite(info.log_evidence)
    x, w = bel.particles.states, bel.particles.weights
    apart = x - start[:, None]
    near = (np.abs(apart[:2]) < 0.5).all(axis=0) & (np.abs(wrap(apart[2])) < 0.3)
    assert w[near].sum() > 0.99
    assert np.abs(apart[:2, near] @ w[near]).max() < 0.03
    assert (np.sqrt(apart[:2, near] ** 2 @ w[near]) < np.hypot(0.1, 0.2 * 0.41) + 0.03).all()


def test_it_goes_on_with_another_map_of_the_same_frame(drive):
    """The same, whose rows are the columns of the other."""
    half, grid = 100, drive.grid
    localizer = Localizer(grid, "markov-grid", seed=4)
    first = [e for event in drive.events[:half] for e in localizer.process(event)]
    before = localizer.belief.particles
    same = OccupancyGrid(
        np.rot90(grid.cells, -1),
        grid.resolution,
        compose(grid.origin, [0.0, grid.cells.shape[0] * grid.resolution, -np.pi / 2]),
    )
    x = before.states[:, before.weights.argmax()]
    assert same.state_at(x) == grid.state_at(x)
    localizer.swap_map(same)
    mean, _ = moments(localizer.belief)
    assert np.hypot(*(mean - before.states @ before.weights)[:2]) < 0.1
    assert localizer.belief.evidence == {}
    rest = list(localizer.run(drive.events[half:]))
    assert errors(drive, first + rest).max() < 0.4


def test_a_belief_that_lies_beside_the_new_map_cannot_go_on():
    filtered = grid_filter()
    bel = filtered.start(filtered.environment, Draws(1))
    far = grid_filter(grid=replace(room(), origin=np.array([90.0, 0.0, 0.0])))
    with pytest.raises(FilterError, match="nothing of what was believed"):
        far.adopted(bel)


@pytest.mark.parametrize("yaw", [0.0, 0.1, 0.8])
def test_what_is_adopted_is_where_it_was(yaw):
    """Also by cells that lie askew to those it was in: no mass is lost, and each quarter of a cell
    is in the cell that it lies in.
    """
    cells = np.full((60, 60), FREE, dtype=np.int8)
    one = grid_filter(carried_off=1e-9, grid=OccupancyGrid(cells, 0.1, np.array([-3.0, -3.0, 0.0])))
    bel = one.start(Gaussian(np.array([0.2, 0.3, 0.4]), np.diag([0.02, 0.01, 0.05])), Draws(1))
    bel, _ = one.predicted(bel, np.array([0.11, 0.0, 0.1]), Draws(1, 1))
    origin = compose([0.0, 0.0, yaw], [-3.0, -3.0, 0.0])
    other = grid_filter(grid=OccupancyGrid(cells, 0.1, origin))
    mean, spread = moments(bel)
    again, wider = moments(other.adopted(bel))
    assert (np.abs(again - mean) < 0.26 * one.lattice.sides).all()
    assert (np.abs(wider**2 - spread**2) < 0.35 * one.lattice.sides**2).all()


def test_the_spread_of_an_estimate_is_that_within_a_cell_at_least():
    filtered = grid_filter()
    bel = filtered.start(Gaussian(np.array([1.3, 0.9, 0.4]), np.eye(3) * 1e-8), Draws(1))
    (best, *_) = filtered.hypotheses(bel)
    assert (np.diag(best.covariance) >= filtered.lattice.sides**2 / 12.0 * 0.999).all()


# Kidnappings


@pytest.mark.parametrize("seed", [1, 2, 4])
def test_a_robot_that_is_carried_off_is_found_again(seed):
    """Where what is active explains scans worse than the average place. In less than 4 s, that is
    2 m; then until the end.
    """
    scenario = Scenario(length=14.0, kidnap_at=(12.0,))
    drive = simulate(office_world(seed), seed, scenario)
    found = estimates(drive.grid, drive.events, initial=drive.truth.poses[0])
    t, wrong = np.array([e.t for e in found]), errors(drive, found)
    kidnapped = drive.kidnappings[0]
    assert wrong[t < kidnapped].max() < 0.4
    assert wrong[(t >= kidnapped) & (t < kidnapped + 0.4)].max() > 1.0
    assert wrong[t > kidnapped + 4.0].max() < 0.5
