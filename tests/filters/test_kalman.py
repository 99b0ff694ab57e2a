"""The Kalman filter against linear algebra of its own, on drives, and where it has to fail."""

import gzip
from dataclasses import replace

import numpy as np
import pytest

from mcloc.density import Gaussian
from mcloc.draws import Draws
from mcloc.environment import FreeSpace
from mcloc.errors import ConfigError
from mcloc.evaluation.accuracy import evaluate
from mcloc.evaluation.errors import pose_errors
from mcloc.events import Scan
from mcloc.filters.catalog import Composition
from mcloc.filters.kalman import GaussianBelief, KalmanFilter
from mcloc.filters.pose_match import match
from mcloc.filters.recovery import Augmented, Evidence, NoRandomParticles
from mcloc.geometry import compose, wrap
from mcloc.io.log import read_log
from mcloc.io.tum import read_trajectory
from mcloc.localizer import Localizer
from mcloc.localizer.state import restore, save
from mcloc.maps.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from mcloc.report.history import History
from mcloc.sensors.likelihood_field import LikelihoodField
from mcloc.simulation import Scenario, office_drive, office_world, ranges, simulate

NOISE = np.array([0.03, 0.02, 0.015])  # m, m, rad of each move, in the robot's frame
SIGNS = np.array(np.meshgrid(*[(-1.0, 1.0)] * 3)).reshape(3, 8)


class Moves:
    """Moves whose mean is u and whose covariance is diag(NOISE²), exactly, for any 8 in a row."""

    def __init__(self, noise=NOISE):
        self.noise = noise

    def sample(self, x, u, draws, first):
        signs = SIGNS[:, (first + np.arange(x.shape[1])) % 8]
        moves = np.asarray(u) + (self.noise[:, None] * signs).T
        return np.ascontiguousarray(compose(x.T, moves).T)

    def doubted(self):
        return Moves(10.0 * self.noise)


class Pose:
    """z = (pose, information): log p(z | x) is a quadratic around it."""

    def log_likelihood(self, x, z):
        pose, information = z
        e = x - pose[:, None]
        e[2] = wrap(e[2])
        return -0.5 * np.einsum("in,ij,jn->n", e, information, e)

    def source(self, z):
        return "pose"

    def readings(self, z):
        return 1.0


class Anywhere:
    def log_prior(self, x):
        return np.zeros(x.shape[1])


def robot(recovery=None):
    return KalmanFilter(Moves(), Pose(), Anywhere(), recovery or NoRandomParticles(doubt_below=0))


def jacobians(mean, u):
    """Of mean ⊕ u by both, by central differences."""
    h = 1e-6
    by = np.empty((2, 3, 3))
    for k in range(3):
        e = h * np.eye(3)[k]
        for which, (a, b) in enumerate(
            (((mean + e, u), (mean - e, u)), ((mean, u + e), (mean, u - e)))
        ):
            d = compose(*a) - compose(*b)
            d[2] = wrap(d[2])
            by[which][:, k] = d / (2.0 * h)
    return by


def exact(mean, covariance, u, pose, seen, deviations):
    """The textbook's filter: rows of H see some axes of the pose with these deviations."""
    by_pose, by_move = jacobians(mean, u)
    mean = compose(mean, u)
    covariance = by_pose @ covariance @ by_pose.T + by_move @ np.diag(NOISE**2) @ by_move.T
    h = np.eye(3)[seen]
    gain = covariance @ h.T @ np.linalg.inv(h @ covariance @ h.T + np.diag(deviations**2))
    innovation = pose - mean
    innovation[2] = wrap(innovation[2])
    mean = mean + gain @ (h @ innovation)
    mean[2] = wrap(mean[2])
    return mean, (np.eye(3) - gain @ h) @ covariance


@pytest.mark.parametrize("seen", [[0, 1, 2], [1, 2], [0, 1], []], ids=str)
def test_it_is_the_exact_filter_where_all_is_linear(seen):
    """Also for measurements that say nothing about an axis, and around θ = π."""
    rng = np.random.default_rng(4)
    deviations = np.array([0.05, 0.08, 0.03])[seen]
    information = np.zeros((3, 3))
    information[seen, seen] = deviations**-2
    mean, covariance = np.array([3.0, -1.0, 2.9]), np.diag([0.1, 0.1, 0.05]) ** 2
    kalman = robot()
    bel = kalman.start(Gaussian(mean, covariance), Draws(1))
    for step in range(1, 13):
        u = np.array([0.3, 0.02, 0.1])
        truth = compose(mean, u)
        z = np.array([*truth[:2], wrap(truth[2])]) + rng.normal(0.0, 0.02, 3)
        mean, covariance = exact(mean, covariance, u, z, seen, deviations)
        bel, _ = kalman.step(bel, u, (z, information), Draws(1, step))
        assert bel.mean == pytest.approx(mean, abs=1e-9)
        assert bel.covariance == pytest.approx(covariance, rel=1e-7, abs=1e-10)
    assert bel.mean[2] < 0.0  # it went through π


def test_its_points_have_its_moments():
    covariance = np.array([[0.3, 0.1, 0.02], [0.1, 0.2, -0.03], [0.02, -0.03, 0.05]])
    particles = GaussianBelief(np.array([1.0, 2.0, 0.3]), covariance).particles
    assert particles.states.mean(axis=1) == pytest.approx([1.0, 2.0, 0.3])
    assert np.cov(particles.states, bias=True) == pytest.approx(covariance)
    assert particles.ess == pytest.approx(len(particles))


def test_its_evidence_is_that_of_the_density_it_expects():
    """∫ N(x; x̄, Σ̄) p(z | x) dx in closed form; 512 even points are within 3 %."""
    covariance = np.diag([0.2, 0.1, 0.05]) ** 2
    information = np.diag([1 / 0.09, 1 / 0.04, 1 / 0.01])
    mean, pose = np.array([1.0, 2.0, 0.5]), np.array([1.1, 1.95, 0.52])
    bel = GaussianBelief(mean, covariance)
    _, info = robot().step(bel, np.zeros(3), (pose, information), Draws(1, 1))
    by_pose, by_move = jacobians(mean, np.zeros(3))
    expected = by_pose @ covariance @ by_pose.T + by_move @ np.diag(NOISE**2) @ by_move.T
    e, both = pose - mean, np.linalg.inv(information) + expected
    log_p = -0.5 * e @ np.linalg.solve(both, e)
    log_p -= 0.5 * np.linalg.slogdet(np.eye(3) + expected @ information)[1]
    assert info.log_evidence == pytest.approx(log_p, abs=0.03)
    assert info.evidence.fast == pytest.approx(np.exp(info.log_evidence))  # one reading


def test_a_scan_that_fits_worse_than_usual_makes_it_doubt_its_wheels():
    """The doubted move has 10 times the deviations."""
    usual = {"pose": Evidence(0.9, 0.9, 600.0)}
    bel = GaussianBelief(np.zeros(3), np.eye(3) * 1e-4, usual)
    z = np.array([0.3, 0.0, 0.0]), 400.0 * np.eye(3)
    sure, info = robot().step(bel, np.zeros(3), z, Draws(1, 1))
    doubting, doubted = robot(Augmented()).step(bel, np.zeros(3), z, Draws(1, 1))
    assert info.doubt == 0.0
    assert doubted.doubt > 0.9
    assert doubted.weighed > info.weighed
    assert abs(doubting.mean[0] - 0.3) < 0.5 * abs(sure.mean[0] - 0.3)


def corridor():
    """40 m × 2 m along x, and what a robot in its middle sees of it: two walls."""
    cells = np.full((60, 820), UNKNOWN, dtype=np.int8)
    cells[8:52, 8:812] = OCCUPIED
    cells[10:50, 10:810] = FREE
    grid = OccupancyGrid(cells, 0.05, np.array([-20.5, -1.5, 0.0]))
    angles = np.linspace(-np.pi / 2, np.pi / 2, 91)
    seen = ranges(grid, np.zeros((1, 3)), angles, 8.0)[0]
    return grid, Scan(0.0, seen, angles, 8.0)


def test_along_a_corridor_a_scan_says_nothing():
    grid, scan = corridor()
    kalman = KalmanFilter(Moves(), LikelihoodField(grid), FreeSpace(grid), NoRandomParticles())
    before = GaussianBelief(np.array([0.3, 0.15, 0.05]), np.diag([0.4, 0.2, 0.1]) ** 2)
    after, _ = kalman.step(before, np.zeros(3), scan, Draws(1, 1))
    deviations = np.sqrt(np.diag(after.covariance))
    assert deviations[0] > 0.38
    assert deviations[1] < 0.06
    assert after.mean[0] == pytest.approx(0.3, abs=0.03)
    assert after.mean[1:] == pytest.approx([0.0, 0.0], abs=0.03)


@pytest.mark.parametrize("seed", range(20))
def test_a_match_stays_in_its_gate_and_never_knows_less_than_nothing(seed):
    """Whatever is measured: here log p is rugged, and 0 in places."""
    rng = np.random.default_rng(seed)
    waves, phases = rng.normal(0.0, 15.0, (6, 3)), rng.uniform(0.0, 6.0, (6, 1))

    def log_p(x):
        rugged = 3.0 * np.sin(waves @ x + phases).sum(axis=0)
        return np.where(rugged < -5.0, -np.inf, rugged)

    expected = Gaussian(rng.normal(0.0, 1.0, 3), np.diag([0.3, 0.2, 0.1]) ** 2)
    gate = np.array([0.6, 0.4, 0.2])
    found = match(log_p, expected, gate)
    off = found.pose - expected.mean
    off[2] = wrap(off[2])
    assert (np.abs(off) <= gate + 1e-12).all()
    assert np.isfinite(found.information).all()
    assert found.information == pytest.approx(found.information.T)
    assert np.linalg.eigvalsh(found.information)[0] >= -1e-9 * found.information.max()


def test_of_two_peaks_it_takes_the_likelier_one():
    """As high, but one is 2.5 deviations away."""
    peaks = np.array([[0.02, 0.0, 0.0], [0.5, 0.0, 0.0]])

    def log_p(x):
        apart = (x[None] - peaks[:, :, None]) / np.array([0.05, 0.05, 0.05])[:, None]
        return np.logaddexp.reduce(-0.5 * (apart**2).sum(axis=1), axis=0)

    found = match(log_p, Gaussian(np.zeros(3), np.diag([0.2, 0.2, 0.1]) ** 2), np.full(3, 0.6))
    assert found.pose == pytest.approx(peaks[0], abs=0.01)


# Whole drives


def driven(grid, events, start, sigma=(0.3, 0.3, 0.1), **options):
    localizer = Localizer(grid, "kalman", seed=3, initial=start, initial_sigma=sigma, **options)
    history = History()
    for estimate in localizer.run(events):
        history.add(estimate)
    return localizer, history


def test_it_tracks_a_simulated_robot():
    drive = office_drive(seed=2, length=30.0)
    _, history = driven(drive.grid, drive.events, drive.truth.poses[0])
    found = evaluate(history.trajectory, drive.truth)
    assert found.position_median_m < 0.06
    assert found.position_max_m < 0.4


def test_it_tracks_a_recorded_robot(data_dir):
    folder = data_dir / "intel"
    truth = read_trajectory(str(folder / "intel_test0.ref.csv"))
    grid = OccupancyGrid.load(folder / "intel_train.yaml")
    log = read_log(str(folder / "intel_test0.log.gz"))
    _, history = driven(grid, log, truth.poses[0])
    found = evaluate(history.trajectory, truth)
    assert found.position_median_m < 0.1
    assert found.lost_fraction["0.5"] == 0.0


def test_carried_off_it_is_lost_for_good_and_its_evidence_says_so():
    drive = simulate(office_world(2), 2, Scenario(length=40.0, kidnap_at=(40.0,)))
    localizer, history = driven(drive.grid, drive.events, drive.truth.poses[0])
    errors = pose_errors(history.trajectory, drive.truth)
    before = errors.t < drive.kidnappings[0]
    assert (errors.position[before] < 0.5).all()
    assert (errors.position[~before] > 1.0).all()
    ratio = history.column("likelihood_fast") / history.column("likelihood_slow")
    t = history.column("t")
    assert ratio[(t > 10.0) & (t < drive.kidnappings[0])].min() > 0.7
    assert ratio[t > drive.kidnappings[0] + 4.0].min() < 0.4
    assert len(localizer.hypotheses) == 1
    assert localizer.hypotheses[0].share == 1.0


# What it cannot do


def test_it_does_not_start_without_a_pose():
    grid = office_world(1)
    with pytest.raises(ConfigError, match=r"one Gaussian and cannot search .*--initial"):
        Localizer(grid, "kalman")
    localizer = Localizer(grid, "kalman", initial=(10.0, 6.9, 0.0), seed=1)
    with pytest.raises(ConfigError, match="cannot search"):
        localizer.start_globally()


def test_the_command_refuses_a_global_start_in_one_line(tmp_path):
    from typer.testing import CliRunner

    from mcloc.cli.main import app

    office_world(1).save(tmp_path / "map.yaml")
    with gzip.open(tmp_path / "log.gz", "wt") as log:
        log.write("FLASER 3 1 1 1 0 0 0 0 0 0 1.0 host 1.0\n")
    run = ["run", "--map", str(tmp_path / "map.yaml"), "--log", str(tmp_path / "log.gz")]
    result = CliRunner().invoke(app, [*run, "--filter", "kalman", "--out", str(tmp_path / "out")])
    assert result.exit_code == 2
    assert isinstance(result.exception, SystemExit)
    assert "cannot search" in result.stderr
    assert result.stderr.strip().count("\n") == 0


# Bytes


@pytest.fixture(scope="module")
def drive():
    return office_drive(seed=4, length=6.0)


def rows(history):
    return history.rows.table.tobytes()


def test_threads_change_nothing(drive, set_threads):
    found = []
    for threads in (1, 2):
        set_threads(threads)
        found.append(rows(driven(drive.grid, drive.events, drive.truth.poses[0])[1]))
    assert found[0] == found[1]


def test_a_restored_one_goes_on_with_the_same_bytes(drive, tmp_path):
    events = list(drive.events)
    whole, _ = driven(drive.grid, events, drive.truth.poses[0])
    for stop in (1, len(events) // 2):
        first, _ = driven(drive.grid, [], drive.truth.poses[0])
        for event in events[:stop]:
            first.process(event)
        save(first, tmp_path / "state.npz")
        second = restore(tmp_path / "state.npz", drive.grid)
        for event in events[stop:]:
            second.process(event)
        second.finish()
        assert second.belief.mean.tobytes() == whole.belief.mean.tobytes()
        assert second.belief.covariance.tobytes() == whole.belief.covariance.tobytes()
        assert second.belief.evidence == whole.belief.evidence


def test_what_it_packs_it_unpacks(drive):
    kalman = Composition("kalman").build(drive.grid)
    evidence = {"laser": Evidence(0.4, 0.5, 60.0)}
    bel = GaussianBelief(np.array([1.0, 2.0, 0.3]), np.eye(3) * 0.01, evidence)
    again = kalman.unpacked(*kalman.packed(bel), evidence)
    assert again.mean.tobytes() == bel.mean.tobytes()
    assert again.covariance.tobytes() == bel.covariance.tobytes()
    assert again.evidence == evidence
    assert again.particles.states.tobytes() == bel.particles.states.tobytes()
    moved = kalman.adopted(bel)
    assert moved.evidence == {}
    assert replace(moved, evidence=evidence).mean is bel.mean
