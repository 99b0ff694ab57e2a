"""Three robots on a circle: the enumerated belief against sums over all paths, and how regions are
counted.
"""

import itertools
import math

import numpy as np
import pytest

from mcloc.experiments import team_row as row
from mcloc.team.policy import TeamPolicy


def by_paths(seconds: list[row.Second], leads: bool) -> np.ndarray:
    """(ROBOTS, CELLS): the marginals after the last step, by adding up every path of all robots
    from every start.
    """
    beliefs = np.zeros((row.ROBOTS, row.CELLS))
    starts = itertools.product(range(row.CELLS), repeat=row.ROBOTS)
    steps = list(itertools.product(range(3), repeat=row.ROBOTS * len(seconds)))
    for start in starts:
        for step in steps:
            cells, p = list(start), 1.0
            for n, second in enumerate(seconds):
                for k in range(row.ROBOTS):
                    far = step[row.ROBOTS * n + k]
                    cells[k] = (cells[k] + second.driven[k] * far) % row.CELLS
                    p *= row.STEPPED[far]
                if leads:
                    p *= row.READING[(second.reading - cells[row.LEADER]) % row.CELLS]
                for i, j, z in second.sightings:
                    p *= row.SIGHTING[(z - cells[j] + cells[i]) % row.CELLS]
            for k, cell in enumerate(cells):
                beliefs[k, cell] += p
    beliefs /= beliefs.sum(axis=1, keepdims=True)
    return beliefs


@pytest.mark.parametrize("leads", [True, False])
def test_the_joint_belief_is_the_sum_over_all_paths(
    monkeypatch: pytest.MonkeyPatch, leads: bool
) -> None:
    monkeypatch.setattr(row, "CELLS", 5)
    monkeypatch.setattr(row, "READING", row.around(0.6))
    monkeypatch.setattr(row, "SIGHTING", row.around(0.8, 0.1))
    seconds = [
        row.Second((0, 0, 0), (1, -1, 1), 2, ((0, 1, 1), (2, 0, 4))),
        row.Second((0, 0, 0), (1, 1, -1), 3, ((1, 2, 3),)),
    ]
    *_, last = row.joint(seconds, leads)
    np.testing.assert_allclose(last, by_paths(seconds, leads), rtol=1e-12)


def test_one_sighting_of_robots_that_know_nothing_of_each_other_is_exact() -> None:
    """Before anything is told, the product of marginals is the joint belief."""
    quiet = [row.Second((0, 0, 0), (1, 1, -1), 7, ())] * 3
    seen = [*quiet, row.Second((0, 0, 0), (1, -1, -1), 9, ((0, 2, 5),))]
    *_, exact = row.joint(seen, True)
    *_, product = row.factored(seen, True, TeamPolicy())
    np.testing.assert_allclose(product, exact, rtol=1e-12)


def test_the_same_told_again_and_again_makes_the_product_too_sure(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Six sightings tell an offset six times, but where the leader is only once."""
    monkeypatch.setattr(row, "READING", row.around(3.0))
    seen = [row.Second((0, 0, 0), (1, 1, 1), 4, ((0, 1, 5),) * 6)]
    *_, exact = row.joint(seen, True)
    *_, product = row.factored(seen, True, InFull(window=0.0))
    assert entropy(exact[1]) > entropy(exact[0]) - 1e-9
    assert entropy(product[1]) < entropy(exact[1]) - 0.3


class InFull(TeamPolicy):
    """Without tempering."""

    def novelty(self, moved: float) -> float:
        return 1.0


def entropy(p: np.ndarray) -> float:
    return -float((p * np.log(p)).sum())


def test_sightings_soon_after_are_ignored_and_nobody_is_told_without_a_policy() -> None:
    still = row.Second((0, 0, 0), (1, 1, 1), 4, ((0, 1, 3),))
    once = [still, row.Second((0, 0, 0), (1, 1, 1), 4, ())]
    for policy in (TeamPolicy(), None):
        *_, a = row.factored([still, still], False, policy)
        *_, b = row.factored(once, False, policy)
        np.testing.assert_array_equal(a, b)
    *_, often = row.factored([still, still], True, TeamPolicy(window=0.0))
    *_, seldom = row.factored([still, still], True, TeamPolicy())
    assert entropy(often[1]) < entropy(seldom[1])
    *_, alone = row.factored([still, still], True, None)
    np.testing.assert_allclose(alone[1:], 1.0 / row.CELLS)


def test_a_region_holds_as_much_as_it_says() -> None:
    """The mean over cells drawn from any belief, and by hand."""
    rng = np.random.default_rng(3)
    for belief in (rng.dirichlet(np.full(9, 0.4)), np.full(9, 1 / 9), np.eye(9)[4]):
        mean = sum(p * row.covered(belief, cell) for cell, p in enumerate(belief))
        assert mean == pytest.approx(row.LEVEL)
    belief = np.array([0.6, 0.3, 0.08, 0.02])
    found = [row.covered(belief, cell) for cell in range(4)]
    assert found == pytest.approx([1.0, 1.0, 0.05 / 0.08, 0.0])
    assert row.covered(np.array([1.0, 0.0]), 1) == 0.0


def test_what_is_drawn_is_as_the_model_says() -> None:
    """Errors of sightings and readings, and steps, of 40 lives; 4.5 standard errors."""
    offsets, readings, steps, sightings = [], [], [], 0
    for seed in range(40):
        lives = row.lived(seed)
        assert len(lives) == row.STEPS
        for before, after in itertools.pairwise(lives):
            far = (np.subtract(after.cells, before.cells) * after.driven) % row.CELLS
            steps += far.tolist()
        for second in lives:
            readings.append((second.reading - second.cells[row.LEADER]) % row.CELLS)
            sightings += len(second.sightings)
            offsets += [
                (z - second.cells[j] + second.cells[i]) % row.CELLS for i, j, z in second.sightings
            ]
    for found, expected in (
        (offsets, row.SIGHTING),
        (readings, row.READING),
        (steps, np.pad(row.STEPPED, (0, row.CELLS - 3))),
    ):
        share = np.bincount(found, minlength=row.CELLS) / len(found)
        bound = 4.5 * np.sqrt(expected * (1.0 - expected) / len(found)) + 1e-12
        assert (np.abs(share - expected) <= bound).all()
    in_sight = row.MEET / (row.MEET + row.PART)
    assert sightings / (40 * row.STEPS * 6) == pytest.approx(in_sight, abs=0.03)


def test_the_joint_belief_is_as_sure_as_it_should_be() -> None:
    """Its regions hold the truth in 95 % of the lives, each of which is one draw; 4.5 standard
    errors of the mean over lives.
    """
    shares = []
    for seed in range(60):
        lives = row.lived(seed)
        beliefs = row.joint(lives, True)
        shares.append(
            np.mean([row.covered(b[1], s.cells[1]) for b, s in zip(beliefs, lives, strict=True)])
        )
    assert abs(np.mean(shares) - row.LEVEL) < 4.5 * np.std(shares) / math.sqrt(len(shares))
