"""Three robots on a circle of cells, whose joint belief can be enumerated: what a product of
marginals makes of it  [Fox01 Eq. 19.4.17, 19.4.18].

Bayes' rule for the joint belief is exact here, and all that is drawn is drawn from the model. So it
is as sure as it should be, and a product of marginals is only wrong by what it leaves out.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from mcloc.team.policy import TeamPolicy

CELLS, CELL = 24, 0.5  # m
ROBOTS, LEADER = 3, 0  # the leader has a sensor of its own
STEPS = 60  # of a second
TURNS, MEET, PART = 0.1, 0.1, 0.2  # in a step: a robot turns round; two come in sight; they part
STEPPED = (0.1, 0.8, 0.1)  # P of 0, 1 and 2 cells
READ, SEEN, FALSE = 1.0, 1.5, 0.069  # cells; share
LEVEL = 0.95

Array = NDArray[np.float64]


def around(sigma: float, false: float = 0.0) -> Array:
    """(CELLS,): P of an error of so many cells, normal around the circle, or with `false` any."""
    off = np.minimum(np.arange(CELLS), CELLS - np.arange(CELLS))
    p = np.exp(-0.5 * (off / sigma) ** 2)
    mixed: Array = (1.0 - false) * p / p.sum() + false / CELLS
    return mixed


READING, SIGHTING = around(READ), around(SEEN, FALSE)


@dataclass(frozen=True)
class Second:
    """What happens in one step. cells: (ROBOTS,) where the robots are after it. driven: (ROBOTS,)
    −1 or 1, as the wheels say. reading: the leader's, of its cell. sightings: (seer, seen, offset
    in cells) in their order.
    """

    cells: tuple[int, ...]
    driven: tuple[int, ...]
    reading: int
    sightings: tuple[tuple[int, int, int], ...]


def lived(seed: int) -> list[Second]:
    """STEPS seconds of three robots, from anywhere. Who sees whom is drawn without regard to where
    they are, so that not to see says nothing.
    """
    rng = np.random.default_rng(seed)
    cells: NDArray[np.int64] = rng.integers(CELLS, size=ROBOTS)
    ways = rng.choice((-1, 1), size=ROBOTS)
    pairs = list(permutations(range(ROBOTS), 2))
    in_sight = np.zeros(len(pairs), dtype=np.bool_)
    seconds = []
    for _ in range(STEPS):
        ways = np.where(rng.random(ROBOTS) < TURNS, -ways, ways)
        steps: NDArray[np.int64] = rng.choice(3, size=ROBOTS, p=STEPPED)
        cells = np.remainder(cells + ways * steps, CELLS)
        reading = int(cells[LEADER] + rng.choice(CELLS, p=READING)) % CELLS
        chance = rng.random(len(pairs))
        in_sight = np.where(in_sight, chance >= PART, chance < MEET)
        sightings = [
            (i, j, int(cells[j] - cells[i] + rng.choice(CELLS, p=SIGHTING)) % CELLS)
            for (i, j), seen in zip(pairs, in_sight, strict=True)
            if seen
        ]
        place, way = tuple(map(int, cells)), tuple(map(int, ways))
        seconds.append(Second(place, way, reading, tuple(sightings)))
    return seconds


def joint(seconds: list[Second], leads: bool) -> Iterator[Array]:
    """(ROBOTS, CELLS): the marginals after each step of the exact belief, which knows all three
    robots at once. leads: whether the leader has its sensor.
    """
    belief: Array = np.full((CELLS,) * ROBOTS, float(CELLS) ** -ROBOTS)
    offset = (np.arange(CELLS)[None, :] - np.arange(CELLS)[:, None]) % CELLS  # of column from row
    for second in seconds:
        for k in range(ROBOTS):
            belief = moved(belief, second.driven[k], k)
        if leads:
            p = READING[(second.reading - np.arange(CELLS)) % CELLS]
            belief = belief * np.expand_dims(p, (1, 2))
        for i, j, z in second.sightings:
            p = SIGHTING[(z - offset) % CELLS]
            belief = belief * np.expand_dims(p if i < j else p.T, 3 - i - j)
        belief = belief / belief.sum()
        yield np.stack([belief.sum(axis=(1, 2)), belief.sum(axis=(0, 2)), belief.sum(axis=(0, 1))])


def factored(seconds: list[Second], leads: bool, policy: TeamPolicy | None) -> Iterator[Array]:
    """(ROBOTS, CELLS): the beliefs of the robots after each step, where each of two is told where
    it is by what the other one believed before. policy: None where they tell each other nothing.
    """
    beliefs = np.full((ROBOTS, CELLS), 1.0 / CELLS)
    path = np.zeros(ROBOTS)  # m, as the wheels say
    last: dict[frozenset[int], tuple[int, Array]] = {}
    for t, second in enumerate(seconds):
        beliefs = np.stack([moved(beliefs[k], second.driven[k], 0) for k in range(ROBOTS)])
        path = path + CELL * np.array(second.driven)
        if leads:
            beliefs[LEADER] *= READING[(second.reading - np.arange(CELLS)) % CELLS]
            beliefs[LEADER] /= beliefs[LEADER].sum()
        for i, j, z in second.sightings if policy is not None else ():
            assert policy is not None
            pair = frozenset((i, j))
            since, distance = math.inf, math.inf
            if pair in last:
                then, at = last[pair]
                since, distance = t - then, float(np.abs((path - at)[[i, j]]).max())
                if not policy.due(since, distance):
                    continue
            last[pair] = t, path
            news = policy.novelty(distance)
            beliefs[[i, j]] = told(beliefs[i], beliefs[j], z, news)
        yield beliefs.copy()


def moved(belief: Array, way: int, axis: int) -> Array:
    """After a step of the robot that an axis is of."""
    after: Array = np.zeros_like(belief)
    for k, p in enumerate(STEPPED):
        after += p * np.roll(belief, way * k, axis)
    return after


def told(seer: Array, seen: Array, z: int, news: float) -> Array:
    """(2, CELLS): both beliefs after a sighting, an offset of z cells, of which a part is news."""
    x = np.arange(CELLS)
    p = SIGHTING[(z - (x[None, :] - x[:, None])) % CELLS]  # of seer's row, seen's column
    both = np.stack([seer * (p @ seen) ** news, seen * (seer @ p) ** news])
    both /= both.sum(axis=1, keepdims=True)
    return both


def covered(belief: Array, cell: int) -> float:
    """How much of a cell lies in the least region that holds LEVEL of a belief, 0 … 1: all cells
    that are likelier than any outside, and as much of those at its edge as it takes. The mean over
    cells drawn from the belief is LEVEL, whatever it is like.
    """
    here = belief[cell]
    alike = np.isclose(belief, here, rtol=1e-9, atol=0.0)
    above, edge = belief[(belief > here) & ~alike].sum(), belief[alike].sum()
    return float(np.clip((LEVEL - above) / edge, 0.0, 1.0)) if here > 0.0 else 0.0
