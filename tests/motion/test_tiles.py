"""Steps on tiles: the paper's chances, and samplers and densities against enumeration."""

import numpy as np
import pytest
from scipy.stats import chisquare

from mcloc.draws import Draws
from mcloc.errors import ConfigError, FilterError
from mcloc.motion.tiles import ACTIONS, TileMotion, transition

L, S, R = ACTIONS
SHAPE = (4, 3)
TILES = np.indices(SHAPE).reshape(2, -1).astype(float)  # (2, 12): all of them
MOTION = TileMotion(SHAPE)
every_action = pytest.mark.parametrize("u", [(R, L), (L, S), (S, R)], ids=["RL", "LS", "SR"])


def enumerated(action, length):
    """p(x_t | action, x_{t−1}) by the words of the paper, one tile after the other."""
    p = np.zeros((length, length))
    for x in range(length):
        possible = [t for t in (x - 1, x, x + 1) if 0 <= t < length]
        meant = x + action if x + action in possible else x
        failures = [t for t in possible if t != meant]
        p[x, meant] = 0.5 if failures else 1.0
        for t in failures:
            p[x, t] = 0.5 / len(failures)
    return p


def in_the_plane(u):
    """(12, 12): p(x_t | u, x_{t−1}), tiles in the order of TILES, axes being independent."""
    return np.kron(enumerated(u[0], SHAPE[0]), enumerated(u[1], SHAPE[1]))


def index(x):
    return np.ravel_multi_index(tuple(x.astype(int)), SHAPE)


def pairs():
    """(2, 144) twice: every x_{t−1} with every x_t."""
    return np.repeat(TILES, 12, axis=1), np.tile(TILES, 12)


PAPER = {
    **{(4, 5, L): 0.5, (5, 5, L): 0.25, (6, 5, L): 0.25},
    **{(4, 5, S): 0.25, (5, 5, S): 0.5, (6, 5, S): 0.25},
    **{(0, 0, S): 0.5, (1, 0, S): 0.5},
}


@pytest.mark.parametrize(("case", "p"), PAPER.items())
def test_the_chances_of_the_paper(case, p):
    """On a row of 11."""
    new, old, action = case
    assert transition(action, 11)[old, new] == p
    log_p = TileMotion((11,)).log_density(np.array([[new]]), np.array([action]), np.array([[old]]))
    assert np.exp(log_p) == pytest.approx([p])


@pytest.mark.parametrize("length", [1, 2, 3, 11, 128])
@pytest.mark.parametrize("action", ACTIONS)
def test_chances_are_those_of_the_words(action, length):
    p = transition(action, length)
    assert (p == enumerated(action, length)).all()
    assert (p.sum(axis=1) == 1.0).all()


def test_an_action_off_the_row_is_staying():
    left, stay, right = (transition(action, 11) for action in ACTIONS)
    assert (left[0] == stay[0]).all()
    assert (right[10] == stay[10]).all()


@every_action
def test_axes_are_independent(u):
    old, new = pairs()
    log_p = MOTION.log_density(new, np.array(u), old)
    assert np.exp(log_p).reshape(12, 12) == pytest.approx(in_the_plane(u))
    along = [
        TileMotion(SHAPE[k : k + 1]).log_density(new[k, None], np.array(u[k : k + 1]), old[k, None])
        for k in range(2)
    ]
    assert log_p == pytest.approx(along[0] + along[1])


@every_action
def test_samples_have_the_density(u):
    """χ² of 4,000 steps from each tile over the tiles that they can lead to."""
    x = np.repeat(TILES, 4000, axis=1)
    after = index(MOTION.sample(x, np.array(u), Draws(1, 2), 0)).reshape(12, 4000)
    agree(after, in_the_plane(u))


@every_action
def test_previous_tiles_have_the_density_of_steps_onto_the_tile(u):
    """p(x_t | u, x_{t−1}) / π(x_t | u) over all x_{t−1}, by enumeration."""
    x_new = np.repeat(TILES, 4000, axis=1)
    before = index(MOTION.sample_previous(x_new, np.array(u), Draws(3), 0)).reshape(12, 4000)
    into = in_the_plane(u).T
    agree(before, into / into.sum(axis=1, keepdims=True))


def agree(found, chances):
    """Each row of tiles found has the chances of that row; 12 tests at 1e-4 each."""
    for row, p in zip(found, chances, strict=True):
        observed = np.bincount(row, minlength=12)
        assert (observed[p == 0.0] == 0).all()
        assert chisquare(observed[p > 0.0], len(row) * p[p > 0.0]).pvalue > 1e-4


@every_action
def test_pi_is_the_sum_over_previous_tiles(u):
    log_pi = MOTION.log_pi(TILES, np.array(u))
    assert np.exp(log_pi) == pytest.approx(in_the_plane(u).sum(axis=0))
    assert log_pi.std() > 0.1


def test_four_axes_have_numbers_of_their_own():
    x = np.ones((4, 5000))
    steps = TileMotion((3, 3, 3, 3)).sample(x, np.zeros(4, dtype=int), Draws(4), 0) - x
    assert np.abs(np.corrcoef(steps) - np.eye(4)).max() < 4.5 / np.sqrt(5000)


def test_nothing_leads_from_or_to_what_is_no_tile():
    outside = np.array([[-1.0, 4.0, 1.5, 0.0, np.nan], [0.0, 0.0, 0.0, 3.0, 0.0]])
    inside, u = np.zeros((2, 5)), np.array([R, S])
    assert (MOTION.log_density(outside, u, inside) == -np.inf).all()
    assert (MOTION.log_density(inside, u, outside) == -np.inf).all()
    assert (MOTION.log_pi(outside, u) == -np.inf).all()


@pytest.mark.parametrize("way", ["sample", "sample_previous"])
def test_chunks_do_not_matter(way):
    move, u = getattr(MOTION, way), np.array([R, L])
    x = np.tile(TILES, 20)
    before = x.copy()
    whole = move(x, u, Draws(3, 2, 1), 40)
    parts = [move(x[:, a:b], u, Draws(3, 2, 1), 40 + a) for a, b in ((0, 1), (1, 77), (77, 240))]
    assert np.array_equal(whole, np.concatenate(parts, axis=1))
    assert np.array_equal(x, before)


def test_doubt_changes_nothing():
    assert MOTION.doubted() is MOTION


@pytest.mark.parametrize("action", [2, 0.5, np.nan])
def test_what_is_no_action_is_refused(action):
    with pytest.raises(FilterError, match="action"):
        MOTION.sample(TILES, np.array([0, action]), Draws(1), 0)


@pytest.mark.parametrize("shape", [(), (0,), (3, -1), (2.0,), (2, 2, 2, 2, 2)])
def test_a_shape_that_cannot_be_is_refused(shape):
    with pytest.raises(ConfigError, match="tiles need"):
        TileMotion(shape)
