"""Mean and covariance of a move, against many more moves and against what they are."""

import numpy as np
import pytest

from mcloc.draws import Draws, Stream
from mcloc.motion import MOTIONS
from mcloc.motion.moments import MOVES, moments_of_move

U = [np.array([0.5, 0.1, 0.4]), np.array([-0.3, 0.0, 0.0]), np.array([0.0, 0.0, 3.1]), np.zeros(3)]


@pytest.mark.parametrize("name", list(MOTIONS))
@pytest.mark.parametrize("u", U, ids=str)
def test_they_are_those_of_many_moves(name, u):
    """Within 5 of their standard errors; of a normal variance that is √(2 / n), and 2 allows for
    more kurtosis.
    """
    motion, n = MOTIONS.make(name), 400_000
    mean, covariance = moments_of_move(motion, u, Draws(1, 3))
    moves = motion.sample(np.zeros((3, n)), u, Draws(2), 0)
    middle = np.angle(np.exp(1j * moves[2]).mean())
    moves[2] = middle + np.remainder(moves[2] - middle + np.pi, 2.0 * np.pi) - np.pi
    expected = np.cov(moves)
    deviation = np.sqrt(np.diag(expected))
    away = np.remainder(mean[2] - moves[2].mean() + np.pi, 2.0 * np.pi) - np.pi
    off = np.array([*(mean - moves.mean(axis=1))[:2], away])
    assert (np.abs(off) < 5.0 * deviation / np.sqrt(MOVES)).all()
    error = np.abs(covariance - expected) / np.outer(deviation, deviation)
    assert error.max() < 5.0 * 2.0 * np.sqrt(2.0 / MOVES)
    assert np.linalg.eigvalsh(covariance).min() > 0.0


class Turner:
    """Moves that are known: half of them turn by a, the others by b."""

    def __init__(self, a, b):
        self.a, self.b = a, b

    def sample(self, x, u, draws, first):
        moved = x + np.asarray(u)[:, None]
        turned = np.where(np.arange(first, first + x.shape[1]) % 2, self.a, self.b)
        moved[2] = np.remainder(x[2] + turned + np.pi, 2.0 * np.pi) - np.pi
        return moved


def test_turns_that_lie_around_half_a_circle():
    """Their mean is not that of their numbers, one of which is negative."""
    mean, covariance = moments_of_move(Turner(3.0, -3.0), [1.0, 2.0, 0.0], Draws(1))
    assert mean[:2] == pytest.approx([1.0, 2.0])
    assert abs(mean[2]) == pytest.approx(np.pi)
    expected = np.zeros((3, 3))
    expected[2, 2] = (np.pi - 3.0) ** 2
    assert covariance == pytest.approx(expected, abs=1e-12)


def test_what_the_mean_errs_by_does_not_add_up():
    """Each step draws anew: over 400 steps the errors add up as √400, not as 400."""

    class Noisy:
        def sample(self, x, u, draws, first):
            return x + draws.normal(Stream.MOTION, first, x.shape[1])[:3]

    means = np.array([moments_of_move(Noisy(), None, Draws(5, k))[0] for k in range(400)])
    assert (np.abs(means[:, :2].sum(axis=0)) < 4.5 * np.sqrt(400 / MOVES)).all()
    assert means[:, :2].std() == pytest.approx(1.0 / np.sqrt(MOVES), rel=0.15)


def test_a_large_move_and_its_opposite():
    mean, _ = moments_of_move(Turner(0.1, 0.1), [30.0, -2.0, 0.0], Draws(1))
    assert mean == pytest.approx([30.0, -2.0, 0.1])
