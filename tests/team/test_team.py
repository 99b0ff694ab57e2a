"""A team: both messages from the beliefs before, when detections are used, what is left out."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from mcloc.density import Gaussian
from mcloc.draws import Draws
from mcloc.errors import ConfigError
from mcloc.events import Detection, Odometry, Scan, Sightings
from mcloc.filters.catalog import FILTERS, Composition
from mcloc.filters.recovery import Evidence
from mcloc.geometry import between, compose
from mcloc.localizer import Localizer, UpdatePolicy
from mcloc.maps.landmarks import Landmarks
from mcloc.maps.occupancy import FREE, OCCUPIED, OccupancyGrid
from mcloc.maps.teammates import Teammates
from mcloc.particles import Particles
from mcloc.simulation import ranges
from mcloc.team.detection import DetectionModel, message, to_seen
from mcloc.team.policy import TeamPolicy
from mcloc.team.team import Team

MODEL = DetectionModel(sigma_range=0.2, sigma_bearing=0.1)
START = {"a": np.array([2.0, 2.0, 0.0]), "b": np.array([4.0, 2.5, 1.0])}
SIGMA = {"a": (0.2, 0.2, 0.1), "b": (0.6, 0.6, 0.3)}


def floor():
    return OccupancyGrid(np.full((80, 80), FREE, dtype=np.int8), 0.1, np.zeros(3))


def member(name="a", particles=4000, filter="mcl", start=True, seed=1, **options):
    composed = Composition(filter, size="fixed", settings={"size": {"particles": particles}})
    known = {"initial": START[name], "initial_sigma": SIGMA[name]} if start else {}
    aids = (Teammates(), *options.pop("aids", ()))
    return Localizer(floor(), composed, aids=aids, seed=seed, **known, **options)


def team(policy=None, **members):
    members = members or {name: member(name, seed=k) for k, name in enumerate("ab")}
    return Team(members, MODEL, policy)


def drive(team, name, times, pose=(0.0, 0.0, 0.0)):
    found = []
    for t in times:
        found += team.process(name, Odometry(float(t), np.array(pose, dtype=float)))
    return found


def still(team, times=(0.0, 1.0)):
    return [e for name in team.robots for e in drive(team, name, times)]


def normal(e, sigma):
    return np.exp(-0.5 * (e / sigma) ** 2) / (sigma * np.sqrt(2.0 * np.pi))


def product_with(z, n=17):
    """Means (x, y) of the beliefs of a and b after z, both by the beliefs before: by sums over all
    pairs of lattice poses, b's heading left out, which z says nothing of.
    """

    def lattice(name):
        steps = np.linspace(-3.5, 3.5, n)
        sides = [START[name][k] + steps * SIGMA[name][k] for k in range(3 if name == "a" else 2)]
        x = np.stack([axis.ravel() for axis in np.meshgrid(*sides, indexing="ij")])
        sigma = np.array(SIGMA[name])[: len(x), None]
        p = np.exp(-0.5 * (((x - START[name][: len(x), None]) / sigma) ** 2).sum(axis=0))
        return x, p / p.sum()

    (a, p_a), (b, p_b) = lattice("a"), lattice("b")
    dx, dy = (b[k][None, :] - a[k][:, None] for k in range(2))
    off = np.angle(np.exp(1j * (z.bearing - np.arctan2(dy, dx) + a[2][:, None])))
    p = normal(z.range - np.hypot(dx, dy), 0.2) * normal(off, 0.1)
    p = (1.0 - 0.069) * p + 0.069 / (2.0 * np.pi * MODEL.range_max)
    after_a, after_b = p_a * (p @ p_b), p_b * (p_a @ p)
    return (a[:2] @ after_a) / after_a.sum(), (b @ after_b) / after_b.sum()


# What is told


def test_both_are_told_by_the_beliefs_before():
    """Against sums over all pairs: as exact as 20,000 particles in a tree are. A belief that had
    taken its own message in before it told would move the other one by 0.1 m more.
    """
    z = Detection(1.0, "b", 2.4, 0.5)
    found = np.zeros((4, 2, 2))
    for seed in range(4):
        team = Team({n: member(n, 20_000, seed=2 * seed + k) for k, n in enumerate("ab")}, MODEL)
        still(team, [0.0])
        team.process("a", z)
        still(team, [1.0])
        assert team.used == 1
        for k, name in enumerate("ab"):
            particles = team.robots[name].belief.particles
            found[seed, k] = particles.states[:2] @ particles.weights
    assert np.abs(found.mean(axis=0) - np.array(product_with(z))).max() < 0.03


def test_a_detection_is_of_where_the_robots_were_then():
    """Both have driven on 1 m by the wheels when b is seen; what is told lies there."""
    long = UpdatePolicy(coast=100.0)  # no steps by the wheels alone
    team = Team({n: member(n, seed=k, policy=long) for k, n in enumerate("ab")}, MODEL)
    still(team, [0.0])
    for name in "ab":
        drive(team, name, [5.0], [1.0, 0.0, 0.0])
    moved = {name: compose(START[name], [1.0, 0.0, 0.0]) for name in "ab"}
    apart = moved["b"][:2] - moved["a"][:2]
    z = Detection(5.0, "b", float(np.hypot(*apart)), math.atan2(apart[1], apart[0]))
    estimates = dict(team.process("a", z))
    assert np.hypot(*(estimates["b"].pose - moved["b"])[:2]) < 0.15
    assert np.trace(estimates["b"].covariance[:2, :2]) < 0.3  # before it was 0.72 or more


def test_a_robot_that_has_no_place_finds_it_by_what_it_is_told():
    team = Team({"a": member("a"), "b": member("b", filter="mixture", start=False)}, MODEL)
    still(team, [0.0])
    assert team.process("a", Detection(0.0, "b", 2.0, 0.5))
    true = START["a"][:2] + 2.0 * np.array([np.cos(0.5), np.sin(0.5)])
    belief = team.robots["b"].belief.particles
    near = np.hypot(*(belief.states[:2] - true[:, None])) < 1.2
    assert belief.weights[near].sum() > 0.9
    assert team.robots["a"].belief.particles.weights.max() < 1e-3  # b had nothing to tell


def test_the_whole_is_a_function_of_the_seeds_and_not_of_who_comes_first():
    def run(order, seed=1):
        team = Team({n: member(n, 500, seed=seed + k) for k, n in enumerate("ab")}, MODEL)
        events = [(n, Odometry(t, np.array([0.2 * t, 0.0, 0.1]))) for t in range(8) for n in order]
        events.append((order[0], Detection(3.0, order[1], 2.0, 0.4)))
        for name, event in sorted(events, key=lambda e: e[1].t):
            team.process(name, event)
        team.finish()
        assert team.used == 1
        return [team.robots[n].belief.particles.states.tobytes() for n in "ab"]

    assert run("ab") == run("ab")
    assert run("ab") != run("ab", seed=5)


@pytest.mark.parametrize("filter", list(FILTERS))
def test_any_filter_tells_and_is_told(filter):
    settings = {"octree": {"most": 1e-4}}.get(filter, {})
    composed = Composition(filter, settings={"filter": settings})
    known = {"initial": START["b"], "initial_sigma": (0.3, 0.3, 0.2)}
    b = Localizer(floor(), composed, aids=(Teammates(),), seed=1, **known)
    team = Team({"a": member("a"), "b": b}, MODEL)
    still(team, [0.0])
    apart = START["b"] - START["a"]
    seen = Detection(0.0, "b", float(np.hypot(*apart[:2])), math.atan2(apart[1], apart[0]))
    team.process("a", seen)
    assert team.used == 1
    particles = team.robots["b"].belief.particles
    mean = particles.states[:2] @ particles.weights
    assert np.hypot(*(mean - START["b"][:2])) < 0.3
    assert [told.robot for told in team.told] == ["b", "a"]


def test_sensors_may_differ():
    """a has a laser in a room, b has nothing but its wheels and a."""
    cells = np.full((60, 80), OCCUPIED, dtype=np.int8)
    cells[2:58, 2:78] = FREE
    cells[30:36, 50:60] = OCCUPIED
    grid, angles = OccupancyGrid(cells, 0.1, np.zeros(3)), np.linspace(-2.0, 2.0, 60)
    known = {"initial": START["a"], "initial_sigma": (0.3, 0.3, 0.2)}
    a = Localizer(grid, "mixture", aids=(Teammates(),), seed=1, **known)
    b = Localizer(grid, "mixture", aids=(Teammates(),), seed=2)
    team = Team({"a": a, "b": b}, MODEL)
    for t in range(12):
        pose = compose(START["a"], [0.15 * t, 0.0, 0.0])
        drive(team, "a", [t], between(START["a"], pose))
        drive(team, "b", [t], [0.15 * t, 0.0, 0.0])
        team.process("a", Scan(float(t), ranges(grid, pose[None], angles, 8.0)[0], angles, 8.0))
        true = compose(START["b"], [0.15 * t, 0.0, 0.0])
        dx, dy = true[:2] - pose[:2]
        seen = math.hypot(dx, dy), math.atan2(dy, dx) - pose[2]
        team.process("a", Detection(float(t), "b", *seen))
    team.finish()
    assert team.used == 2  # at the first stamp, and after the window
    assert np.hypot(*(team.robots["a"].hypotheses[0].mean - pose)[:2]) < 0.2
    assert np.hypot(*(team.robots["b"].hypotheses[0].mean - true)[:2]) < 0.5


@pytest.mark.parametrize("filter", ["mixture", "mixture-balanced", "mcl", "sensor-resetting"])
def test_who_is_lost_by_its_own_sensors_looks_where_it_is_told_and_nobody_else(filter):
    """No message asks for that by itself, however little it fits."""
    built = Composition(filter).build(floor(), Teammates())
    believed = Gaussian(START["a"], np.diag([0.01, 0.01, 0.01]))
    there = np.array([6.0, 6.0, 0.0])
    teller, z = Particles.equal(there[:, None]), Detection(0.0, "me", 1.0, 0.0)
    told = message(z, to_seen(teller, z, MODEL, Draws(1)), MODEL, "robot a")
    lost, sure = {"laser": Evidence(0.1, 1.0, 100.0)}, {"laser": Evidence(1.0, 1.0, 100.0)}
    found = []
    for evidence in (lost, sure):
        bel = replace(built.start(believed, Draws(2)), evidence=evidence)
        for step in range(1, 4):
            bel, info = built.step(bel, np.zeros(3), told, Draws(2, step))
        assert info.doubt == 0.0
        assert bel.evidence == evidence  # messages are no evidence of the robot's own sensors
        near = np.hypot(*(bel.particles.states[:2] - [[7.0], [6.0]])) < 1.0
        found.append(bel.particles.weights[near].sum())
    assert found[1] == 0.0
    assert (found[0] > 0.05) == (filter != "sensor-resetting")


# When


def again(team, times, pose=(0.0, 0.0, 0.0)):
    for t in times:
        for name in "ab":
            drive(team, name, [t], pose)
        team.process("a", Detection(float(t), "b", 2.0, 0.3))


def test_the_same_robots_are_told_again_after_the_window_or_a_move():
    team = Team({n: member(n, 300) for n in "ab"}, MODEL, TeamPolicy(window=10.0, distance=2.0))
    again(team, [0.0, 1.0, 9.0])
    assert team.used == 1
    assert team.ignored == {"detection of the same robots again": 2}
    again(team, [10.0])
    assert team.used == 2
    again(team, [11.0], [1.9, 0.0, 0.0])
    assert team.used == 2
    again(team, [12.0], [2.0, 0.0, 0.0])
    assert team.used == 3


def test_who_sees_whom_makes_no_difference_to_the_window():
    team = Team({n: member(n, 300) for n in "ab"}, MODEL)
    still(team, [0.0])
    team.process("a", Detection(0.0, "b", 2.0, 0.3))
    team.process("b", Detection(0.0, "a", 2.0, 0.3))
    assert team.used == 1


def test_what_is_no_news_counts_less():
    """From places 1 cm apart, 10 s after each other, b gets less sure than by independent ones."""
    sure = []
    for distance in (1e5, 1e-5):
        policy = TeamPolicy(window=10.0, distance=distance)
        team = Team({n: member(n, 3000, seed=4) for n in "ab"}, MODEL, policy)
        still(team, [0.0])
        for k in range(1, 10):
            again(team, [10.0 * k], [0.01 * k, 0.0, 0.0])
        assert team.used == 9
        sure.append(np.trace(np.cov(team.robots["b"].belief.particles.states[:2])))
    assert sure[0] > 2.0 * sure[1]
    assert TeamPolicy().novelty(math.inf) == 1.0
    assert TeamPolicy().novelty(0.0) == 0.05
    assert TeamPolicy(distance=2.0).novelty(1.0) == 0.5


def test_a_robot_follows_its_wheels_where_nothing_is_measured():
    """Round a circle of 6.3 m to where it was: it knows that it may be elsewhere now."""
    team = Team({n: member(n, seed=k) for k, n in enumerate("ab")}, MODEL)
    before = np.trace(np.cov(team.robots["a"].belief.particles.states[:2]))
    found = []
    for k in range(201):
        at = min(k, 180) * np.deg2rad(2.0)
        pose = np.array([np.sin(at), 1.0 - np.cos(at), np.angle(np.exp(1j * at))])
        found += drive(team, "a", [0.1 * k], pose)
    assert {name for name, _ in found} == {"a"}
    stamps = [e.t for _, e in found]
    assert stamps == sorted(stamps)
    assert len(stamps) >= 10  # each 0.5 m or 0.5 rad
    assert np.hypot(*(found[-1][1].pose - START["a"])[:2]) < 0.3
    assert np.trace(found[-1][1].covariance[:2, :2]) > 1.5 * before


def test_a_landmark_that_is_seen_after_a_long_time_is_not_too_late():
    """Its stamp leaps, so it waits for the next one; the wheels' step comes after it."""
    landmarks = Landmarks.numbered([[4.0, 4.0], [6.0, 2.0]])
    a = member("a", aids=(landmarks,))
    team = Team({"a": a, "b": member("b")}, MODEL)
    for k in range(400):
        t, turned = 0.1 * k, np.angle(np.exp(0.01j * k))
        drive(team, "a", [t], [0.0, 0.0, turned])
        if k in (3, 330, 380):
            dx, dy = landmarks.places[0] - START["a"][:2]
            seen = [math.hypot(dx, dy)], [math.atan2(dy, dx) - turned]
            team.process("a", Sightings(t, [0], *seen))
    team.finish()
    assert not a.ignored


def test_a_robot_without_a_place_follows_nothing():
    team = Team({"a": member("a"), "b": member("b", start=False)}, MODEL)
    assert drive(team, "b", np.arange(0.0, 5.0, 0.1), [3.0, 0.0, 0.0]) == []
    assert not team.robots["b"].placed


# What is left out


@pytest.mark.parametrize(
    ("z", "reason"),
    [
        (Detection(math.nan, "b", 2.0, 0.1), "detection stamp not finite"),
        (Detection(0.5, "c", 2.0, 0.1), "detection of a robot that is not in the team"),
        (Detection(0.5, "a", 2.0, 0.1), "detection of the robot itself"),
        (Detection(0.5, "b", math.nan, 0.1), "detection without a range that can be"),
        (Detection(0.5, "b", 99.0, 0.1), "detection without a range that can be"),
        (
            Detection(0.5, "b", 2.0, 0.1, mount=[math.nan] * 3),
            "detection with a mount that cannot be",
        ),
        (Detection(9.0, "b", 2.0, 0.1), "detection without odometry"),
    ],
)
def test_what_can_be_of_no_use_is_counted(z, reason):
    team = Team({n: member(n, 300) for n in "ab"}, MODEL)
    still(team)
    team.process("a", z)
    team.finish()
    assert team.used == 0
    assert team.ignored == {reason: 1}


def test_a_late_detection_is_counted():
    team = Team({n: member(n, 300) for n in "ab"}, MODEL, TeamPolicy(window=0.0))
    still(team, [0.0, 5.0])
    team.process("a", Detection(4.0, "b", 2.0, 0.1))
    team.process("a", Detection(3.0, "b", 2.0, 0.1))
    assert team.used == 1
    assert team.ignored == {"late detection": 1}


def test_robots_without_a_place_tell_nothing():
    team = Team({n: member(n, 300, start=False) for n in "ab"}, MODEL)
    still(team)
    team.process("a", Detection(0.5, "b", 2.0, 0.1))
    assert team.ignored == {"detection between robots that have no place yet": 1}


def test_a_detection_waits_for_the_wheels_of_both_and_no_longer():
    team = Team({n: member(n, 300) for n in "ab"}, MODEL)
    drive(team, "a", [0.0, 1.0])
    drive(team, "b", [0.0])
    team.process("a", Detection(0.5, "b", 2.0, 0.1))
    assert team.used == 0
    drive(team, "b", [1.0])
    assert team.used == 1
    drive(team, "a", np.arange(1.0, 20.0, 0.5))
    team.process("a", Detection(20.0, "b", 2.0, 0.1))
    drive(team, "a", [20.5, 21.5])
    assert team.ignored["detection without odometry"] == 1


def test_measurements_after_a_detection_wait_for_it():
    """Or they would be taken in first, and the detection come too late."""
    cells = np.full((60, 60), OCCUPIED, dtype=np.int8)
    cells[2:58, 2:58] = FREE
    grid, angles = OccupancyGrid(cells, 0.1, np.zeros(3)), np.linspace(-2.0, 2.0, 30)
    robots = {
        n: Localizer(grid, "mcl", aids=(Teammates(),), seed=1, initial=START[n]) for n in "ab"
    }
    team = Team(robots, MODEL)
    drive(team, "a", [0.0, 1.0])
    drive(team, "b", [0.0])
    team.process("a", Detection(0.5, "b", 2.0, 0.1))
    z = ranges(grid, START["a"][None], angles, 8.0)[0]
    assert team.process("a", Scan(0.6, z, angles, 8.0)) == []
    found = drive(team, "b", [1.0])
    assert [name for name, _ in found][-1] == "a"
    assert team.used == 1
    assert not robots["a"].ignored


def test_wrong_stamps_of_wheels_do_no_harm():
    """One from the future would make a detection wait no longer."""
    team = Team({n: member(n, 300) for n in "ab"}, MODEL)
    still(team, [0.0])
    for t in (math.nan, 1e6):
        drive(team, "a", [t])
    team.process("a", Detection(0.5, "b", 2.0, 0.1))
    assert team.used == 0
    assert not team.ignored
    still(team, [1.0])
    assert team.used == 1


def test_a_detection_from_the_future_stops_nothing():
    """Robots follow their wheels, and are told of others that are seen."""

    def steps(*wrong):
        both = team()
        still(both, [0.0])
        for z in wrong:
            both.process("a", z)
        found = 0
        for t in np.arange(0.2, 20.0, 0.2):
            found += sum(len(drive(both, name, [t], (0.3 * t, 0.0, 0.0))) for name in "ab")
        both.process("a", Detection(19.5, "b", 2.0, 0.2))
        assert both.used == 1
        assert sum(both.ignored.values()) == len(wrong)
        return found

    assert steps(Detection(1e9, "b", 2.0, 0.2), Detection(100.0, "b", 2.0, 0.2)) == steps() >= 20


def test_a_detection_right_after_a_pause_is_used():
    """The wheels leap as it does."""
    both = team()
    still(both, [0.0, 0.2])
    both.process("a", Detection(60.0, "b", 2.0, 0.2))
    still(both, [60.1, 60.2, 60.3])
    assert both.used == 1
    assert not both.ignored


def test_a_clock_that_is_set_back_begins_anew():
    """Once three events of the wheels say so, nothing is late by the clock that was before."""
    team = Team({n: member(n, 300) for n in "ab"}, MODEL)
    still(team, [1000.0])
    team.process("a", Detection(1000.0, "b", 2.0, 0.1))
    assert team.used == 1
    still(team, [0.0, 0.5, 1.0, 1.5])
    team.process("a", Detection(1.5, "b", 2.0, 0.1))
    assert team.used == 2
    assert not team.ignored


def test_a_team_is_of_two_or_more_that_can_be_told():
    with pytest.raises(ConfigError, match="at least 2"):
        Team({"a": member("a")})
    deaf = Localizer(floor(), "mcl", seed=1)
    with pytest.raises(ConfigError, match="Teammates"):
        Team({"a": member("a"), "b": deaf})
    with pytest.raises(ConfigError, match="no robot c"):
        team().process("c", Odometry(0.0, np.zeros(3)))


def test_pairs_have_windows_of_their_own():
    names = "abc"
    START["c"] = np.array([3.0, 3.0, 0.0])
    SIGMA["c"] = (0.3, 0.3, 0.2)
    team = Team({n: member(n, 300) for n in names}, MODEL)
    still(team, [0.0])
    for a, b in itertools.permutations(names, 2):
        team.process(a, Detection(0.0, b, 2.0, 0.1))
    assert team.used == 3
