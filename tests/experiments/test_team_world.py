"""The worlds of E13, E22 and E23: teams and parts of them, who counts as found, and how sure is too
sure.
"""

import numpy as np
import pytest
from scipy.stats import chi2

from mcloc.evaluation.errors import PoseErrors
from mcloc.evaluation.survival import Survival
from mcloc.events import Detection, Odometry, Scan
from mcloc.experiments import team_wheels
from mcloc.experiments.team_runs import ALONE, EVERY, POLICIES, TEMPERED, WINDOW
from mcloc.experiments.team_world import (
    LIMIT,
    LOST,
    MCL,
    MIXTURE,
    MOMENTS,
    Found,
    composition,
    driven,
    of_first,
    replayed,
)
from mcloc.particles import Particles
from mcloc.simulation import TeamDrive
from mcloc.team.detection import DetectionModel
from mcloc.trajectory import Trajectory


@pytest.fixture(scope="module")
def three() -> TeamDrive:
    return driven(1000, 3)


def cut(drive: TeamDrive, end: float) -> TeamDrive:
    """Its first seconds."""
    events = {k: tuple(e for e in of if e.t <= end) for k, of in drive.events.items()}
    paths = {
        k: Trajectory(path.t[path.t <= end], path.poses[path.t <= end])
        for k, path in drive.truth.items()
    }
    return TeamDrive(drive.grid, events, paths)


def test_a_drive_has_a_scan_each_04_seconds_until_its_end(three: TeamDrive) -> None:
    for name, events in three.events.items():
        scans = np.array([e.t for e in events if isinstance(e, Scan)])
        np.testing.assert_allclose(np.diff(scans), 0.4, atol=1e-9)
        assert len(scans) == LIMIT / 0.4
        assert max(e.t for e in events) <= LIMIT
        assert three.truth[name].t[-1] == pytest.approx(LIMIT)
        wheels = [e.t for e in events if isinstance(e, Odometry)]
        np.testing.assert_allclose(np.diff(wheels), 0.1, atol=1e-9)


def test_the_first_robots_of_a_team_see_each_other_only(three: TeamDrive) -> None:
    two = of_first(three, 2)
    assert list(two.events) == ["1", "2"]
    for name, other in ("12", "21"):
        left = [e for e in three.events[name] if not (isinstance(e, Detection) and e.seen == "3")]
        assert two.events[name] == tuple(left)
        assert {e.seen for e in two.events[name] if isinstance(e, Detection)} <= {other}
    assert sum(map(len, two.events.values())) < len([*three.events["1"], *three.events["2"]])


def test_robots_that_do_not_see_each_other_fare_as_in_a_larger_team(three: TeamDrive) -> None:
    """So that runs of teams are compared in pairs: all random numbers are a robot's own."""
    short = cut(three, 6.0)
    apart = replayed(short, MCL, 4, False)
    fewer = replayed(of_first(short, 2), MCL, 4, False)
    for name in "12":
        np.testing.assert_array_equal(apart.robots[name].position, fewer.robots[name].position)
    assert (apart.used, apart.told) == (0, 0)
    assert apart.weighed > fewer.weighed > 0


def test_what_detections_cost_is_counted(three: TeamDrive) -> None:
    """Each is two sets that are pushed, and two of 5,000 particles that are weighed."""
    short = cut(three, 25.0)
    replay = replayed(short, MCL, 4, True)
    assert replay.used > 0
    assert replay.told == replay.used * 2 * (5000 + DetectionModel().particles)
    updates = replay.weighed / 5000
    assert 3 * 25.0 * 0.5 / 0.4 * 0.5 < updates < 3 * 25.0 / 0.4


@pytest.mark.parametrize("method", [MCL, MIXTURE])
def test_filters_have_as_many_particles(three: TeamDrive, method: str) -> None:
    assert composition(method).settings["size"]["particles"] == 5000
    assert replayed(cut(three, 1.0), method, 0, False).weighed % 5000 == 0


def errors(bad: list[tuple[float, float]]) -> PoseErrors:
    """Of a straight drive at 0.5 m/s: 3 m off between these times, else 0.1 m."""
    t = np.arange(0.05, LIMIT + 0.01, 0.05)
    path = np.zeros((len(t), 3))
    path[:, 0] = 0.5 * t
    off = np.full(len(t), 0.1)
    for start, end in bad:
        off[(t >= start) & (t < end)] = 3.0
    difference = np.zeros((len(t), 3))
    difference[:, 1] = off
    return PoseErrors(t, path, difference, None, None)


def test_who_is_found_and_who_is_lost() -> None:
    soon = Found.of(errors([(0.0, 10.0)]))
    assert soon.time == pytest.approx(10.0, abs=0.1)
    assert (soon.found, soon.lost) == (True, False)
    assert soon.position[MOMENTS < 9.9] == pytest.approx(3.0)
    assert soon.position[MOMENTS > 10.1] == pytest.approx(0.1)
    never = Found.of(errors([(0.0, 61.0)]))
    assert (never.time, never.found, never.lost) == (LIMIT, False, True)
    again = Found.of(errors([(0.0, 20.0), (40.0, 61.0)]))
    assert again.time == pytest.approx(20.0, abs=0.1)
    assert (again.found, again.lost) == (True, True)
    # 4 s at 0.5 m/s are no 3 m.
    flickers = Found.of(errors([(k, k + 1.0) for k in np.arange(0.0, 60.0, 5.0)]))
    assert not flickers.found
    assert LOST < 3.0


def test_means_of_times_are_restricted_means() -> None:
    """As Kaplan and Meier have them, with who is not found out of sight at the limit."""
    starts = [5.0, 61.0, 20.0, 33.0, 61.0]
    found = [Found.of(errors([(0.0, start)])) for start in starts]
    times = np.array([f.time for f in found])
    survival = Survival(times, np.array([f.found for f in found]))
    assert times.mean() == pytest.approx(survival.restricted_mean(LIMIT))


def test_regions_hold_what_they_should_of_any_belief() -> None:
    """Truths drawn from a banana of particles with unequal weights lie in 95 % of its regions, and
    have a mean NEES of 3; 4.5 standard errors.
    """
    rng = np.random.default_rng(5)
    turn = rng.normal(3.0, 0.4, 1000)
    length = rng.normal(4.0, 0.1, 1000)
    states = np.stack([length * np.cos(turn), length * np.sin(turn), np.remainder(turn, 2.0)])
    particles = Particles.normalized(states, np.log(rng.exponential(size=1000)))
    drawn = rng.choice(1000, 1500, p=particles.weights)
    covered, nees, off = np.array([team_wheels.judged(particles, states[:, k]) for k in drawn]).T
    assert abs(covered.mean() - 0.95) < 4.5 * np.sqrt(0.95 * 0.05 / 1500)
    assert abs(nees.mean() - 3.0) < 4.5 * nees.std() / np.sqrt(1500)
    mean = states[:2] @ particles.weights
    assert off[0] == pytest.approx(np.hypot(*(states[:2, drawn[0]] - mean)))


def test_a_gaussian_is_judged_as_chi_square_has_it_across_the_turn() -> None:
    """χ² with 3 degrees of freedom: 7.81 holds 95 %. Headings around π are near each other."""
    rng = np.random.default_rng(6)
    states = np.stack([*rng.normal(0.0, 0.2, (2, 50_000)), rng.normal(np.pi, 0.1, 50_000)])
    states[2] = np.remainder(states[2] + np.pi, 2 * np.pi) - np.pi
    particles = Particles.equal(np.ascontiguousarray(states))
    edge = np.sqrt(chi2(3).ppf(0.95))
    inside, beyond = (
        team_wheels.judged(particles, np.array([0.0, f * edge * 0.2, -np.pi])) for f in (0.97, 1.03)
    )
    assert (inside[0], beyond[0]) == (1.0, 0.0)
    assert inside[1] == pytest.approx((0.97 * edge) ** 2, rel=0.03)


def test_policies_are_as_they_are_called() -> None:
    assert POLICIES[ALONE] is None
    every, window, tempered = (POLICIES[name] for name in (EVERY, WINDOW, TEMPERED))
    assert every is not None
    assert window is not None
    assert tempered is not None
    assert every.due(0.0, 0.0)
    assert not window.due(1.0, 1.0)
    assert not tempered.due(1.0, 1.0)
    assert [p.novelty(0.5) for p in (every, window)] == [1.0, 1.0]
    assert tempered.novelty(0.5) == pytest.approx(0.2)


def test_robots_by_their_wheels_are_judged_at_the_same_moments(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Twice each, the same; and nobody is told anything without a policy."""
    whole = team_wheels.drive_of(1000)
    monkeypatch.setattr(team_wheels, "drive_of", lambda seed: cut(whole, 12.0))
    seen = [
        name for name in whole.events if any(isinstance(e, Detection) for e in whole.events[name])
    ]
    assert seen
    for policy in (None, POLICIES[EVERY]):
        one, again = (team_wheels.followed(1000, True, policy) for _ in range(2))
        assert one == again
        assert len(one) == 2 * np.sum(team_wheels.MOMENTS <= 12.0)
    assert team_wheels.followed(1000, True, None) == team_wheels.followed(1000, False, None)
