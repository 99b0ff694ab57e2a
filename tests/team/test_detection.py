"""Detections against p(z | x_i, x_j) written out with plain NumPy, summed over beliefs, grids."""

import math

import numpy as np
import pytest

from mcloc.draws import Draws
from mcloc.errors import ConfigError
from mcloc.events import Detection
from mcloc.maps.teammates import Teammates
from mcloc.particles import Particles
from mcloc.sensors.messages import MessageModel, tree_of
from mcloc.statespace import PLANE, SE2
from mcloc.team.detection import DetectionModel, message, to_seen, to_seer

MOUNT = np.array([0.3, -0.1, 0.5])
Z = {
    "range and bearing": Detection(0.0, "b", 1.5, 0.7),
    "near": Detection(0.0, "b", 0.4, -2.0),
    "with heading": Detection(0.0, "b", 2.0, 0.7, 1.1),
    "range alone": Detection(0.0, "b", 1.5, math.nan),
    "no bearing": Detection(0.0, "b", 1.5, math.nan, -2.0),
    "from beside the middle": Detection(0.0, "b", 1.5, 0.7, mount=MOUNT),
    "all from beside": Detection(0.0, "b", 1.5, 0.7, 1.1, mount=MOUNT),
}
MODEL = DetectionModel(sigma_range=0.4, sigma_relative=0.2, sigma_bearing=0.15, sigma_heading=0.2)
EACH = pytest.mark.parametrize("z", Z.values(), ids=Z)


def has_all_axes(z, push):
    """Not where the seer's place depends on its heading, and the tree of places has none."""
    ring = math.isnan(z.bearing) and math.isnan(z.heading)
    return push is to_seen or not (ring and z.mount.any())


BOTH_WAYS = pytest.mark.parametrize(
    ("z", "push"),
    [
        pytest.param(z, push, id=f"{name}, {push.__name__}")
        for name, z in Z.items()
        for push in (to_seen, to_seer)
        if has_all_axes(z, push)
    ],
)


def belief(n=150):
    """Two hills of poses, one with three times the weight of the other."""
    rng = np.random.default_rng(3)
    x = np.stack([rng.normal(1.0, 0.3, n), rng.normal(-2.0, 0.2, n), rng.normal(0.4, 0.2, n)])
    x[:, n // 2 :] += np.array([3.0, 1.0, 2.0])[:, None]
    return Particles.normalized(x, np.log(np.repeat([3.0, 1.0], n // 2)))


def normal(e, sigma):
    return np.exp(-0.5 * (e / sigma) ** 2) / (sigma * np.sqrt(2.0 * np.pi))


def on_circle(e, sigma):
    return sum(normal(e + 2.0 * np.pi * k, sigma) for k in range(-3, 4))


def p_true(z, seer, seen):
    """p(z | x_i, x_j, true) for all pairs of (3, n, 1) and (3, 1, m)."""
    mx, my, turn = z.mount
    sx = seer[0] + np.cos(seer[2]) * mx - np.sin(seer[2]) * my
    sy = seer[1] + np.sin(seer[2]) * mx + np.cos(seer[2]) * my
    facing = seer[2] + turn
    dx, dy = seen[0] - sx, seen[1] - sy
    d = np.sqrt(dx**2 + dy**2)
    p = normal(z.range - d, np.sqrt(0.4**2 + (0.2 * d) ** 2))
    if not math.isnan(z.bearing):
        p = p * on_circle(z.bearing - (np.arctan2(dy, dx) - facing), 0.15)
    if not math.isnan(z.heading):
        p = p * on_circle(z.heading - (seen[2] - facing), 0.2)
    return p


def poses(x, seed):
    """(3, m): columns of x, with any heading where they have none."""
    heading = np.random.default_rng(seed).uniform(-np.pi, np.pi, x.shape[1])
    return x if len(x) == 3 else np.stack([*x, heading])


def expected(z, push, bel, x):
    """(m,): E[p(z | x_i, x_j, true)] over the belief of the one, at poses of the other."""
    x, known = poses(x, 5)[:, None, :], bel.states[:, :, None]
    p = p_true(z, known, x) if push is to_seen else p_true(z, x, known)
    return bel.weights @ p


def tree_and_truth(z, push, particles, n=20_000):
    """A tree, its density and the true one at n of its own samples, and p(z | false) over even."""
    model = DetectionModel(
        **{f: getattr(MODEL, f) for f in ("sigma_range", "sigma_relative", "sigma_bearing")},
        sigma_heading=MODEL.sigma_heading,
        particles=particles,
    )
    bel = belief()
    tree = push(bel, z, model, Draws(7, 1))
    x = tree.sample(Draws(8), 0, n)
    p_false = 1.0 / model.range_max
    for measured in (z.bearing, z.heading):
        p_false /= 1.0 if math.isnan(measured) else 2.0 * np.pi
    scale = p_false / model.even(z, tree.space)  # ∫ p(z | x, true) dx
    return tree, np.exp(tree.log_density(x)), expected(z, push, bel, x) / scale


@BOTH_WAYS
def test_a_tree_is_the_expected_likelihood_and_nears_it(z, push):
    """Half the mean |p / tree − 1| over samples of the tree is the share of the mass that lies
    elsewhere. It falls as n^(−1/(D + 2)), for sixteen times the samples to 0.5 or 0.57; and with
    the scale that `even` gives, p sums to what the tree has.
    """
    apart = []
    for particles in (10_000, 160_000):
        tree, found, true = tree_and_truth(z, push, particles)
        apart.append(0.5 * np.mean(np.abs(true / found - 1.0)))
    rate = 16.0 ** (-1.0 / (tree.space.dimension + 2.0))
    assert apart[1] < 0.2
    assert apart[1] < (rate + 0.1) * apart[0]
    # What the tree does not reach, and what its floor adds, is a hundredth or so.
    error = np.std(true / found) / np.sqrt(len(found))
    assert abs(np.mean(true / found) - 1.0) < 0.02 + 4.5 * error


def test_the_plane_weighs_distances():
    """∫ d N(r; d, σ²) dd: the mean distance is r + σ² / r, not r; here with σ = r / 3."""
    one = Particles.equal(np.zeros((3, 1)))
    model = DetectionModel(sigma_range=0.5, particles=100_000)
    z = Detection(0.0, "b", 1.5, 0.0)
    for push in (to_seen, to_seer):
        x = push(one, z, model, Draws(2)).sample(Draws(3), 0, 100_000)
        d = np.hypot(x[0], x[1])
        assert abs(np.mean(d) - (1.5 + 0.5**2 / 1.5)) < 0.03


def test_the_seer_faces_what_it_sees():
    """On its ring, wherever it is, the other one has the bearing, to σ_bearing."""
    model = DetectionModel(sigma_range=0.05, sigma_bearing=0.05, particles=50_000)
    seen = Particles.equal(np.array([[2.0], [1.0], [0.3]]))
    tree = to_seer(seen, Detection(0.0, "b", 2.0, 0.5), model, Draws(4))
    assert tree.space is SE2
    x = tree.sample(Draws(5), 0, 20_000)
    direction = np.arctan2(1.0 - x[1], 2.0 - x[0])
    off = np.angle(np.exp(1j * (direction - x[2] - 0.5)))
    assert np.mean(np.abs(off) < 0.3) > 0.97  # the floor of the tree has 1 %
    assert np.ptp(np.sort(direction)) > 6.2  # all around


@EACH
def test_the_density_of_pairs_is_the_one_written_out(z):
    seer, seen = belief().states, poses(belief().states[:2], 9)
    ours = MODEL.density(z, seer, seen)
    false = 1.0 / MODEL.range_max
    for measured in (z.bearing, z.heading):
        false /= 1.0 if math.isnan(measured) else 2.0 * np.pi
    assert np.allclose(ours, (1.0 - 0.069) * p_true(z, seer, seen) + 0.069 * false, rtol=1e-9)


def test_ranges_and_bearings_sum_to_one():
    """Of a pair 3 m apart, by sums over a grid; 8 m are 10 deviations away."""
    r, b = np.linspace(0.0, 8.0, 801)[1:], np.linspace(-np.pi, np.pi, 361)[1:]
    model = DetectionModel(sigma_range=0.4)
    pair = np.zeros((3, 1)), np.array([[3.0], [0.0], [0.0]])
    p = [[model.density(Detection(0.0, "b", ri, bi), *pair)[0] for bi in b] for ri in r]
    assert np.sum(p) * 0.01 * (2.0 * np.pi / 360) == pytest.approx(1.0, abs=1e-3)


def test_a_message_weighs_as_bayes_does():
    """Against E[p(z | x_i, x_j)] with its false part, relative to p(z | false): where the tree has
    mass, and where it has none. Half the mean |p / tree − 1| is 0.08 with so many samples, above.
    """
    model, z = DetectionModel(sigma_range=0.4, sigma_bearing=0.15, particles=160_000), Z["near"]
    one = Particles.equal(np.array([[1.0], [-2.0], [0.4]]))
    told = message(z, to_seen(one, z, model, Draws(1)), model, "robot a")
    x = np.random.default_rng(6).uniform([0.0, -3.5, -3.0], [2.0, -1.0, 3.0], (4000, 3)).T
    log_p = MessageModel(Teammates()).log_likelihood(x, told)
    p = model.density(z, np.repeat(one.states, 4000, axis=1), x)
    exact = np.log(p * 2.0 * np.pi * model.range_max)
    w = p / p.sum()
    assert abs(w @ (log_p - exact)) < 0.03
    assert w @ np.abs(log_p - exact) < 2.0 * 0.08
    away = p < 1.01 * 0.069 / (2.0 * np.pi * model.range_max)
    assert away.sum() > 1000
    assert np.median(np.abs(log_p - exact)[away]) < 0.01
    assert np.mean(np.abs(log_p - exact)[away] > 0.5) < 0.1  # in boxes at the edge of the mass


def test_both_ways_are_pushed_by_the_same_numbers_whenever_asked():
    bel = belief()
    for push in (to_seen, to_seer):
        a, b, c = (push(bel, Z["near"], MODEL, Draws(s)) for s in (1, 1, 2))
        assert np.array_equal(a.weight, b.weight)
        assert a.low.tobytes() == b.low.tobytes()
        assert a.low.tobytes() != c.low.tobytes()


def test_the_axes_are_those_that_something_is_known_of():
    spaces = {
        name: (to_seen(belief(), z, MODEL, Draws(1)).space, to_seer(belief(), z, MODEL, Draws(1)))
        for name, z in Z.items()
    }
    assert spaces["near"][0] is PLANE
    assert spaces["with heading"][0] is SE2
    assert spaces["range alone"][1].space is PLANE
    assert spaces["no bearing"][1].space is SE2


RANGE, FROM = "without a range that can be", "with a mount that cannot be"


@pytest.mark.parametrize(
    ("z", "fault"),
    [
        (Detection(0.0, "b", 2.0, 0.1), ""),
        (Detection(0.0, "b", 2.0, math.nan), ""),
        (Detection(0.0, "b", 8.1, 0.1), RANGE),
        (Detection(0.0, "b", 0.0, 0.1), RANGE),
        (Detection(0.0, "b", -1.0, 0.1), RANGE),
        (Detection(0.0, "b", math.nan, 0.1), RANGE),
        (Detection(0.0, "b", 2.0, math.inf), RANGE),
        (Detection(0.0, "b", 2.0, 0.1, -math.inf), RANGE),
        (Detection(0.0, "b", 2.0, 0.1, mount=[0.1, math.nan, 0.0]), FROM),
        (Detection(0.0, "b", 2.0, 0.1, mount=[0.1, 0.0, math.inf]), FROM),
        (Detection(0.0, "b", 2.0, 0.1, mount=[1e300, 0.0, 0.0]), FROM),
    ],
)
def test_a_detection_is_usable_where_it_has_a_range_and_is_from_somewhere(z, fault):
    assert MODEL.fault(z) == fault


@pytest.mark.parametrize(
    ("wrong", "what"),
    [
        ({"seen": 2}, "by its name, got 2"),
        ({"t": "1.0"}, "t of a detection must be a number, got '1.0'"),
        ({"range": "near"}, "range of a detection must be a number, got 'near'"),
        ({"range": [2.0]}, "range"),
        ({"bearing": None}, "bearing"),
        ({"heading": 1j}, "heading"),
        ({"mount": [0.0, 0.0]}, "mount of a detection must be three numbers"),
        ({"mount": [[0.0], [0.0, 1.0]]}, "mount"),
        ({"mount": "abc"}, "mount"),
    ],
)
def test_a_detection_of_wrong_types_is_refused(wrong, what):
    right = {"t": 0.0, "seen": "b", "range": 2.0, "bearing": 0.1}
    with pytest.raises(ConfigError, match=what):
        Detection(**{**right, **wrong})


def test_numbers_of_a_detection_may_be_of_any_kind():
    z = Detection(np.float32(0.5), "b", np.array(2), 1, mount=[1, 0, 0])
    assert (z.t, z.range, z.bearing) == (0.5, 2.0, 1.0)
    assert z.mount.dtype == np.float64
    assert to_seen(belief(), z, MODEL, Draws(1)).space is PLANE


def test_a_wrong_deviation_is_refused():
    with pytest.raises(ConfigError, match="sigma_range"):
        DetectionModel(sigma_range=0.0)


def test_a_message_holds_the_tree():
    z = Z["with heading"]
    tree = to_seen(belief(), z, MODEL, Draws(1))
    told = tree_of(message(z, tree, MODEL, "robot a"))
    x = belief().states
    assert told.space is SE2
    assert np.array_equal(told.log_density(x), tree.log_density(x))
