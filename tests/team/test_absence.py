"""Robots that are not seen: what is in view against walls looked through point by point, and what
that is worth.
"""

import math

import numpy as np
import pytest

from mcloc.draws import Draws
from mcloc.events import Detection, Odometry, Scan
from mcloc.filters.catalog import Composition
from mcloc.geometry import compose
from mcloc.localizer import Localizer, UpdatePolicy
from mcloc.maps.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from mcloc.maps.teammates import Teammates
from mcloc.particles import Particles
from mcloc.sensors.messages import MessageModel
from mcloc.team.absence import View, lattice_tree
from mcloc.team.detection import DetectionModel
from mcloc.team.policy import TeamPolicy
from mcloc.team.team import Team

MODEL = DetectionModel(p_detect=0.9, range_max=4.0)
ORIGIN = np.array([2.0, -1.0, 0.4])
LONG = UpdatePolicy(coast=100.0)  # no steps by the wheels alone


def room():
    """8 m × 6 m, a wall with a door across the middle; a corner that nobody knows."""
    cells = np.full((60, 80), FREE, dtype=np.int8)
    cells[:20, 40:42] = OCCUPIED
    cells[30:, 40:42] = OCCUPIED
    cells[45:, :15] = UNKNOWN
    return OccupancyGrid(cells, 0.1, ORIGIN)


def clear(grid, a, b):
    """Whether all points 1 cm apart between two places are free."""
    n = max(int(np.hypot(*(b - a)) / 0.01), 2)
    line = a + np.linspace(0.0, 1.0, n)[:, None] * (b - a)
    row, column = grid.cell_of(np.insert(line, 2, 0.0, axis=1))
    return grid.free[row, column].all()


@pytest.mark.parametrize("fov", [2.0 * math.pi, 2.0])
def test_in_view_is_what_no_wall_hides(fov):
    """Places within 2° or 0.2 m of a border of the view may be judged either way."""
    grid, model = room(), DetectionModel(range_max=4.0, fov=fov)
    pose = compose(ORIGIN, [3.0, 2.5, -0.3])
    rng = np.random.default_rng(1)
    inner = rng.uniform([0.1, 0.1], [7.9, 5.9], (1500, 2))
    places = compose(ORIGIN, np.insert(inner, 2, 0.0, axis=1))[:, :2]
    seen = View(grid).seen(pose[:, None], places.T, model)
    off = places - pose[:2]
    d, b = np.hypot(*off.T), np.arctan2(off[:, 1], off[:, 0]) - pose[2]
    ahead = np.abs(np.angle(np.exp(1j * b))) <= 0.5 * fov
    expected = np.array(
        [k and clear(grid, pose[:2], p) for k, p in zip((d <= 4.0) & ahead, places, strict=True)]
    )
    assert set(seen) == {0.0, 1.0}
    assert 150 < expected.sum() < 1000
    assert np.mean(seen != expected) < 0.03


def test_a_lattice_is_a_tree():
    values = np.random.default_rng(2).random((8, 8))
    tree = lattice_tree(np.array([1.0, -2.0]), np.array([4.0, 2.0]), values)
    x = np.random.default_rng(3).uniform([1.0, -2.0], [5.0, 0.0], (500, 2)).T
    cell = ((x - [[1.0], [-2.0]]) / [[0.5], [0.25]]).astype(int)
    expected = values[*cell] / values.sum() * 64 / 8.0
    assert np.exp(tree.log_density(x)) == pytest.approx(expected)
    assert tree.mass.sum() == pytest.approx(1.0)
    drawn = tree.sample(Draws(1), 0, 20_000)
    share = np.mean(drawn[0] < 3.0)
    true = values[:4].sum() / values.sum()
    assert abs(share - true) < 4.5 * np.sqrt(true * (1.0 - true) / 20_000)


def test_a_place_in_view_of_who_did_not_see_it_counts_less():
    """1 − p_detect V: 0.1 where one that knows its place sees, 1 where it does not, and in between
    for one that may be at two places.
    """
    view, pose = View(room()), compose(ORIGIN, [3.0, 2.5, 0.0])
    here, hidden = (compose(ORIGIN, [x, y, 0.0]) for x, y in ((2.0, 2.5), (7.0, 5.0)))
    both = np.stack([pose, compose(ORIGIN, [7.5, 0.5, 0.0])], axis=1)
    for seer, worth in ((pose[:, None], 0.1), (both, 0.55)):
        told = view.message(1.0, Particles.equal(seer), MODEL, "robot a", Draws(1))
        log_p = MessageModel(Teammates()).log_likelihood(np.stack([here, hidden], axis=1), told)
        assert np.exp(log_p) == pytest.approx([worth, 1.0], abs=1e-3)
        away = MessageModel(Teammates()).log_likelihood(np.array([[99.0], [99.0], [0.0]]), told)
        assert np.exp(away) == pytest.approx([0.1])  # off the map


def team(p_detect):
    """a knows its place; b may be anywhere around it, or in the other half of the room."""
    grid = room()
    composed = Composition("mcl", size="fixed", settings={"size": {"particles": 2000}})
    a = compose(ORIGIN, [1.5, 1.5, 0.0])
    known = {"initial": a, "initial_sigma": (0.05, 0.05, 0.05)}
    middle = {"initial": compose(ORIGIN, [3.0, 2.5, 0.0]), "initial_sigma": (1.5, 1.5, 1.0)}
    robots = {
        name: Localizer(grid, composed, aids=(Teammates(),), seed=1, policy=LONG, **start)
        for name, start in (("a", known), ("b", middle))
    }
    model = DetectionModel(p_detect=p_detect, range_max=4.0)
    return Team(robots, model, TeamPolicy(window=5.0))


def near_a(team):
    """The share of b's belief that a has in view."""
    particles = team.robots["b"].belief.particles
    pose = compose(ORIGIN, [1.5, 1.5, 0.0])[:, None]
    return particles.weights @ View(room()).seen(pose, particles.states[:2], MODEL)


def test_a_robot_that_is_not_seen_is_elsewhere():
    """Bayes: of a share s in view, 0.1 s / (1 − 0.9 s) is left, once a window."""
    quiet, loud = team(0.0), team(0.9)
    for t in np.arange(0.0, 8.0, 0.5):
        for one in (quiet, loud):
            for name in "ab":
                one.process(name, Odometry(float(t), np.zeros(3)))
    before = near_a(quiet)
    assert 0.3 < before < 0.9
    left = 0.1 * before / (1.0 - 0.9 * before)
    assert near_a(loud) == pytest.approx(left, abs=0.04)


@pytest.mark.parametrize("who", ["a", "b", "ab"])
def test_a_robot_is_told_so_however_fast_its_sensors_are(who):
    """One beam, 5 times a second: filters are past what is a second ago, and do not go back."""
    quiet, loud = team(0.0), team(0.9)
    for t in np.arange(0.0, 8.0, 0.2):
        for one in (quiet, loud):
            for name in "ab":
                one.process(name, Odometry(float(t), np.zeros(3)))
            for name in who:
                one.process(name, Scan(float(t), np.array([3.0]), np.zeros(1), 4.0))
    before = near_a(quiet)
    assert 0.3 < before < 0.9
    assert near_a(loud) == pytest.approx(0.1 * before / (1.0 - 0.9 * before), abs=0.04)
    assert not any(one.ignored for one in loud.robots.values())


def test_a_robot_that_is_seen_is_not_told_to_be_elsewhere():
    loud = team(0.9)
    for t in np.arange(0.0, 20.0, 0.5):
        for name in "ab":
            loud.process(name, Odometry(float(t), np.zeros(3)))
        if t % 2 == 1:
            loud.process("a", Detection(float(t), "b", 1.5, 0.5))
            loud.process("b", Detection(float(t), "a", 1.5, 0.5))
    assert loud.used >= 3
    assert near_a(loud) > 0.8
