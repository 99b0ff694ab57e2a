"""Topological Markov localization against a Bayes filter written out, and on drives."""

import itertools

import numpy as np
import pytest

from mcloc.density import Gaussian
from mcloc.draws import Draws
from mcloc.environment import FreeSpace
from mcloc.errors import ConfigError, FilterError, StateError
from mcloc.estimate import Hypothesis
from mcloc.evaluation.accuracy import evaluate
from mcloc.filters.catalog import Composition
from mcloc.filters.place_states import PlaceStates
from mcloc.filters.recovery import NoRandomParticles
from mcloc.filters.topological import THROUGH_WALLS, TopologicalFilter
from mcloc.geometry import compose, wrap
from mcloc.io.log import read_log
from mcloc.io.tum import read_trajectory
from mcloc.localizer import Localizer
from mcloc.localizer.state import packed, restore, save, unpacked
from mcloc.maps.occupancy import FREE, OCCUPIED, OccupancyGrid
from mcloc.maps.places import places
from mcloc.report.history import History
from mcloc.simulation import Scenario, office_drive, office_world, simulate

CELL = 0.1
HEADINGS = 4


def rooms():
    """Two rooms of 3 m × 2.4 m, a door between them; a third room beside them, without one."""
    cells = np.full((30, 110), OCCUPIED, dtype=np.int8)
    cells[2:26, 2:32], cells[2:26, 34:64], cells[2:26, 68:100] = FREE, FREE, FREE
    cells[10:18, 32:34] = FREE
    return OccupancyGrid(cells, CELL, np.array([5.0, -2.0, 0.3]))


class Drive:
    """Moves that differ from pose to pose, but are no matter of chance."""

    def sample(self, x, u, draws, first):
        n = np.arange(first, first + x.shape[1])
        moves = np.asarray(u) + 0.1 * np.stack(
            [np.sin(n), np.cos(2.0 * n), np.sin(3.0 * n)], axis=1
        )
        return np.ascontiguousarray(compose(x.T, moves).T)


class Beacon:
    """log p(z | x) of a distance to, and a bearing of, a beacon."""

    def log_likelihood(self, x, z):
        dx, dy = 7.0 - x[0], -1.0 - x[1]
        bearing = wrap(np.arctan2(dy, dx) - x[2] - z[1])
        return -0.5 * ((np.hypot(dx, dy) - z[0]) / 0.3) ** 2 - 0.5 * (bearing / 0.4) ** 2

    def source(self, z):
        return "beacon"

    def readings(self, z):
        return 2.0


@pytest.fixture(scope="module")
def topological():
    grid = rooms()
    states = PlaceStates(places(grid, 0.25, piece=3.0), HEADINGS, spacing=0.3)
    models = Drive(), Beacon(), FreeSpace(grid), NoRandomParticles()
    return TopologicalFilter(states, *models, distance=1.0, angle=0.8, carried_off=1e-3)


MOVES = [(0.4, 0.0, 0.1), (0.5, 0.1, 0.0), (0.3, 0.0, 0.2), (0.0, 0.0, 0.7), (0.6, 0.0, 0.0)] * 2
SEEN = [(2.0, 0.3), (1.7, 0.1), (1.5, -0.2), (1.6, -0.8), (2.2, -0.6)] * 2


def state_of(states, pose):
    """Node and heading of a pose, looked up one by one."""
    graph = states.places
    row, column = graph.grid.cell_of(pose)
    height, width = graph.grid.cells.shape
    node = graph.nearest[min(max(row, 0), height - 1), min(max(column, 0), width - 1)]
    edges = np.linspace(-np.pi, np.pi, HEADINGS + 1)
    k = next(k for k in range(HEADINGS) if edges[k] <= wrap(pose[2]) <= edges[k + 1])
    return int(node), k


def written_out(topological, before, draws):
    """The masses after each step, pose by pose."""
    states, environment = topological.states, topological.environment
    of = [state_of(states, pose) for pose in states.poses.T]
    everything = sorted(set(of))
    near = {(a, b) for a, b in states.places.edges.tolist()}
    near |= {(b, a) for a, b in near} | {(a, a) for a in range(len(states.places))}
    near |= {(a, d) for (a, b), (c, d) in itertools.product(near, near) if b == c}
    count = {s: of.count(s) for s in everything}
    likelihood, moved, found = np.ones(len(of)), np.zeros(3), []
    for u, z in zip(MOVES, SEEN, strict=True):
        moved = compose(moved, u)
        if np.hypot(*moved[:2]) >= topological.distance or abs(moved[2]) >= topological.angle:
            now, after = found[-1], dict.fromkeys(everything, 0.0)
            kept = [k for k, s in enumerate(of) if now[s] > 1e-3 / len(everything)]
            x = Drive().sample(states.poses[:, kept], moved, draws, 0)
            prior = np.exp(environment.log_prior(x))
            for k, pose, p in zip(kept, x.T, prior, strict=True):
                to = state_of(states, pose)
                p *= 1.0 if (of[k][0], to[0]) in near else THROUGH_WALLS
                after[to] += p * now[of[k]] / count[of[k]]
            total = sum(after.values())
            before = {
                s: (1 - topological.carried_off) * after[s] / total
                + topological.carried_off * count[s] / len(of)
                for s in everything
            }
            likelihood, moved = np.ones(len(of)), np.zeros(3)
        x = np.ascontiguousarray(compose(states.poses.T, moved).T)
        likelihood = likelihood * np.exp(Beacon().log_likelihood(x, z) + environment.log_prior(x))
        mass = dict.fromkeys(everything, 0.0)
        for s, p in zip(of, likelihood, strict=True):
            mass[s] += before[s] * p / count[s]
        total = sum(mass.values())
        found.append({s: m / total for s, m in mass.items()})
    return found


def test_it_is_the_discrete_bayes_filter(topological):
    states = topological.states
    bel = topological.start(topological.environment, Draws(1))
    before = {divmod(s, HEADINGS): m for s, m in enumerate(bel.mass)}
    assert sum(before.values()) == pytest.approx(1.0)
    expected = written_out(topological, before, Draws(1))
    lookups = 0
    for step, (u, z) in enumerate(zip(MOVES, SEEN, strict=True)):
        bel, info = topological.step(bel, np.array(u), z, Draws(1, step))
        lookups += not bel.moved.any()
        masses = [expected[step][divmod(s, HEADINGS)] for s in range(len(states))]
        assert bel.mass == pytest.approx(masses, rel=1e-6, abs=1e-12)
        assert info.ess == pytest.approx(1.0 / np.square(masses).sum())
    assert 3 <= lookups < len(MOVES)
    assert max(masses) > 0.2


def test_its_evidence_is_that_of_the_scans(topological):
    """Of the first scan: the mean of p over all poses, and of √p, since it takes z for two."""
    bel = topological.start(topological.environment, Draws(1))
    _, info = topological.step(bel, np.zeros(3), SEEN[0], Draws(1, 1))
    p = np.exp(Beacon().log_likelihood(topological.states.poses, SEEN[0]))
    assert info.log_evidence == pytest.approx(np.log(p.mean()))
    assert info.evidence.fast == pytest.approx(np.sqrt(p).mean())
    assert info.weighed == len(p)


def test_a_state_has_the_poses_of_its_node_and_headings(topological):
    states = topological.states
    assert len(states) == HEADINGS * len(states.places)
    assert (np.diff(states.state) >= 0).all()
    assert (states.of(states.poses) == states.state).all()
    assert (states.sizes > 0).all()
    each = states.places.areas[states.state // HEADINGS] / np.prod(states.sides[:2])
    per_heading = states.sizes[states.state] / 4.0
    assert (np.abs(per_heading / each - 1.0) < 0.5).all()
    assert (states.of(np.array([[5.5], [-1.0], [np.pi]])) % HEADINGS == HEADINGS - 1).all()


def test_a_given_pose_becomes_the_mass_of_states(topological):
    """Within 4.5 deviations of as many samples drawn by NumPy."""
    mean, sigma = np.array([6.4, -0.8, 0.5]), np.array([0.4, 0.4, 0.3])
    bel = topological.start(Gaussian(mean, np.diag(sigma**2)), Draws(7))
    drawn = np.random.default_rng(0).normal(mean[:, None], sigma[:, None], (3, 200_000))
    share = np.bincount(topological.states.of(drawn), minlength=len(topological.states)) / 200_000
    deviation = np.sqrt(share * (1.0 - share) * (1 / 20_000 + 1 / 200_000))
    assert (np.abs(bel.mass - share) <= 4.5 * deviation + 1e-4).all()


def test_a_hypothesis_is_a_hill_of_the_graph(topological):
    """Mass in both rooms: two hypotheses, and the poses of each by their likelihood."""
    states = topological.states
    bel = topological.start(topological.environment, Draws(1))
    left, alone = ((5.0, -2.0, 0.3), (1.0, 1.2, 0.0)), ((5.0, -2.0, 0.3), (8.4, 1.2, 0.0))
    left, alone = (int(states.of(compose(*place)[:, None])[0]) for place in (left, alone))
    assert states.places.edges.shape == (1, 2)
    mass = np.zeros(len(states))
    mass[left], mass[alone] = 0.7, 0.3
    log_p = np.full(len(states.state), -np.inf)
    chosen = np.flatnonzero(states.state == left)[[0, 5]]
    log_p[chosen] = np.log([3.0, 1.0])
    log_p[states.state == alone] = 0.0
    # As much of each: the likelihoods within a state have a mean of 1.
    log_p[chosen] += np.log(states.sizes[left] / 4.0)
    first, second = topological.hypotheses(type(bel)(states, mass, np.zeros(3), log_p))
    assert isinstance(first, Hypothesis)
    assert (first.share, second.share) == pytest.approx((0.7, 0.3))
    x = states.poses[:, chosen]
    assert first.mean[:2] == pytest.approx(0.75 * x[:2, 0] + 0.25 * x[:2, 1])
    assert first.mean[2] == pytest.approx(np.angle(np.exp(1j * x[2]) @ [0.75, 0.25]))
    apart = x - first.mean[:, None]
    within = np.diag(states.sides**2 / 12.0)
    assert first.covariance == pytest.approx((apart * [0.75, 0.25]) @ apart.T + within)
    whole = states.poses[:, states.state == alone]
    assert second.mean == pytest.approx(whole.mean(axis=1))
    assert second.covariance == pytest.approx(np.cov(whole, bias=True) + within)


def test_a_scan_that_nothing_explains_is_an_error(topological):
    bel = topological.start(topological.environment, Draws(1))
    with pytest.raises(FilterError, match="no place on the map explains the scan"):
        topological.step(bel, np.zeros(3), (np.inf, 0.0), Draws(1, 1))


def test_on_another_map_the_mass_is_where_it_was(topological):
    grid = rooms()
    finer = OccupancyGrid(np.repeat(np.repeat(grid.cells, 2, 0), 2, 1), CELL / 2, grid.origin)
    states = PlaceStates(places(finer, 0.25), 8, 0.25)
    models = Drive(), Beacon(), FreeSpace(finer), NoRandomParticles()
    other = TopologicalFilter(states, *models)
    bel = topological.start(topological.environment, Draws(1))
    for step, (u, z) in enumerate(zip(MOVES[:4], SEEN[:4], strict=True)):
        bel, _ = topological.step(bel, np.array(u), z, Draws(1, step))
    moved = other.adopted(bel)
    assert moved.evidence == {}
    assert moved.mass.sum() == pytest.approx(1.0)
    at = other.hypotheses(moved)[0].mean
    assert np.hypot(*(at - topological.hypotheses(bel)[0].mean)[:2]) < 1.0


def test_more_poses_than_memory_holds_are_refused(monkeypatch):
    """Before the graph is worked out, which takes minutes and gigabytes of a map that is too large
    for it.
    """
    monkeypatch.delattr("mcloc.filters.topological.places")
    many = Composition("topological", settings={"filter": {"spacing": 0.01, "headings": 360}})
    with pytest.raises(ConfigError, match=r"filter\.spacing = 0\.01 m and filter\.headings = 360"):
        many.build(office_world(1))


# Whole drives


def driven(grid, events, **options):
    localizer = Localizer(grid, "topological", seed=3, **options)
    history, nodes = History(), []
    for estimate in localizer.run(events):
        history.add(estimate)
        mass = localizer.belief.mass.reshape(len(localizer.filter.states.places), -1)
        nodes.append(int(mass.sum(axis=1).argmax()))
    return localizer, history, np.array(nodes)


def test_it_finds_the_place_of_a_robot_in_an_office():
    """After 15 m, most of the time the likeliest node is that of the robot or touches it: nodes are
    those of the last change of states.
    """
    drive = office_drive(seed=2, length=60.0)
    localizer, history, nodes = driven(drive.grid, drive.events)
    graph = localizer.filter.states.places
    row, column = drive.grid.cell_of(drive.truth.at(history.column("t")))
    true = graph.nearest[row, column]
    late = np.arange(len(true)) > len(true) // 4
    beside = {tuple(e) for e in graph.edges.tolist()} | {
        tuple(e[::-1]) for e in graph.edges.tolist()
    }
    right = np.array([a == b or (a, b) in beside for a, b in zip(nodes, true, strict=True)])
    assert right[late].mean() > 0.9
    found = evaluate(history.trajectory, drive.truth)
    assert found.position_median_m < 1.0


def test_it_finds_a_robot_that_was_carried_off():
    drive = simulate(office_world(2), 2, Scenario(length=80.0, kidnap_at=(60.0,)))
    _, history, _ = driven(drive.grid, drive.events)
    off = np.hypot(*(history.trajectory.poses - drive.truth.at(history.column("t")))[:, :2].T)
    last = history.column("t") > history.column("t")[-1] - 20.0
    assert np.median(off[last]) < 1.0


def test_it_finds_a_recorded_robot(data_dir):
    """Roughly: half of the time within half a metre, and it knows how roughly."""
    folder = data_dir / "intel"
    truth = read_trajectory(str(folder / "intel_test0.ref.csv"))
    grid = OccupancyGrid.load(folder / "intel_train.yaml")
    _, history, _ = driven(grid, read_log(str(folder / "intel_test0.log.gz")))
    found = evaluate(history.trajectory, truth)
    assert found.position_median_m < 0.5
    assert found.lost_fraction["2"] < 0.2
    assert found.nees_median is not None
    assert found.nees_median < 2.4


# Bytes


@pytest.fixture(scope="module")
def drive():
    return office_drive(seed=4, length=6.0)


def test_threads_change_nothing(drive, set_threads):
    found = []
    for threads in (1, 2):
        set_threads(threads)
        localizer, history, _ = driven(drive.grid, drive.events)
        found.append((history.rows.table.tobytes(), localizer.belief.mass.tobytes()))
    assert found[0] == found[1]


def test_a_restored_one_goes_on_with_the_same_bytes(drive, tmp_path):
    events = list(drive.events)
    whole, _, _ = driven(drive.grid, events)
    for stop in (1, len(events) // 2):
        first, _, _ = driven(drive.grid, [])
        for event in events[:stop]:
            first.process(event)
        save(first, tmp_path / "state.npz")
        second = restore(tmp_path / "state.npz", drive.grid)
        for event in events[stop:]:
            second.process(event)
        second.finish()
        assert second.belief.mass.tobytes() == whole.belief.mass.tobytes()
        assert second.belief.moved.tobytes() == whole.belief.moved.tobytes()
        assert second.belief.log_p.tobytes() == whole.belief.log_p.tobytes()
        assert second.belief.evidence == whole.belief.evidence
        assert second.hypotheses[0].mean.tobytes() == whole.hypotheses[0].mean.tobytes()


def test_a_state_of_another_graph_is_refused(drive):
    localizer = Localizer(drive.grid, "topological", seed=1)
    values, arrays = packed(localizer)
    values["composition"]["settings"] = {"filter": {"headings": 4}}
    with pytest.raises(StateError, match="damaged, or of another mcloc"):
        unpacked("saved", values, arrays, drive.grid)


@pytest.mark.parametrize("sensor", ["likelihood-field", "beam-four-part"])
@pytest.mark.parametrize("motion", ["odometry", "omnidirectional", "velocity"])
def test_it_steps_with_all_models(drive, sensor, motion):
    coarse = {"filter": {"spacing": 1.0}}
    built = Composition("topological", sensor=sensor, motion=motion, settings=coarse)
    robot = built.build(drive.grid)
    scans = [event for event in drive.events if hasattr(event, "ranges")][:3]
    bel = robot.start(robot.environment, Draws(1))
    for step, scan in enumerate(scans, 1):
        bel, info = robot.step(bel, np.array([0.8, 0.0, 0.1]), scan, Draws(1, step))
        assert bel.mass.sum() == pytest.approx(1.0)
        assert bel.particles.weights.sum() == pytest.approx(1.0)
        assert 1.0 <= info.ess <= info.n
