"""The leaves of an octree of poses: boxes of several levels, each with its mass."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mcloc.draws import Draws, Stream
from mcloc.estimate import BIN_ANGLE, BIN_LENGTH
from mcloc.samplers.pose_boxes import HALVES, PARTS, Keys, PoseBoxes
from mcloc.statespace import States

Masses = NDArray[np.float64]

AT_ONCE = 1 << 16  # leaves


class Leaves(NamedTuple):
    """level, keys, mass: (n,) of each leaf; the mass is spread evenly in its box."""

    level: NDArray[np.intp]
    keys: Keys
    mass: Masses

    def chosen(self, which: NDArray[np.bool_] | slice) -> "Leaves":
        """Some of them."""
        return Leaves(self.level[which], self.keys[which], self.mass[which])


class Looks(NamedTuple):
    """Poses that stand for some leaves. x: (3, m). leaf: (m,) which of these each is in. mass:
    (m,).
    """

    x: States
    leaf: NDArray[np.intp]
    mass: Masses


def joined(parts: list[Leaves]) -> Leaves:
    """One after the other."""
    return Leaves(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))


def divided(boxes: PoseBoxes, leaves: Leaves) -> Leaves:
    """The 8 parts of each leaf, with an eighth of its mass."""
    parts = []
    for level in np.unique(leaves.level):
        _, keys, mass = leaves.chosen(leaves.level == level)
        order = np.argsort(keys)
        below = boxes.parts(keys, int(level))
        parent = np.searchsorted(keys[order], boxes.parents(below, int(level) + 1))
        parts.append(Leaves(np.full(len(below), level + 1), below, mass[order][parent] / PARTS))
    return joined(parts)


def looks(
    boxes: PoseBoxes, leaves: Leaves, most: float, draws: Draws
) -> Iterator[tuple[slice, Looks]]:
    """Some leaves after the other: a pose drawn in each leaf, one in each of the 8 parts of the
    largest and of those with more mass than `most`.
    """
    done = 0
    for first in range(0, len(leaves.keys), AT_ONCE):
        some = slice(first, first + AT_ONCE)
        here = _looks(boxes, leaves.chosen(some), most, draws, done)
        done += len(here.leaf)
        yield some, here


def _looks(boxes: PoseBoxes, leaves: Leaves, most: float, draws: Draws, first: int) -> Looks:
    """first: how many were drawn before."""
    parts = np.where((leaves.mass > most) | (leaves.level == 0), PARTS, 1)
    leaf = np.repeat(np.arange(len(parts)), parts)
    nth = np.arange(len(leaf)) - np.repeat(np.cumsum(parts) - parts, parts)
    in_box = draws.uniform(Stream.TREE, first, len(leaf))[:3]
    several = parts[leaf] > 1
    in_box[:, several] = 0.5 * (in_box[:, several] + HALVES[:, 0, nth[several]])
    x = np.empty((3, len(leaf)))
    for level in np.unique(leaves.level):
        here = np.flatnonzero(leaves.level[leaf] == level)
        x[:, here] = boxes.poses(leaves.keys[leaf[here]], int(level), in_box[:, here])
    return Looks(x, leaf, leaves.mass[leaf] / parts[leaf])


def tree_of(
    boxes: PoseBoxes, anywhere: float, x: States, mass: Masses, most: float, deepest: int
) -> Leaves:
    """The leaves of a tree in which no box above the level `deepest` has more mass than `most`.

    x, mass: poses (3, n) and the mass of each, left out beyond the map. anywhere: mass that is
    spread evenly over the largest boxes that have a free cell.
    """
    free = boxes.free_keys()
    at = _around(boxes, x, np.arange(len(mass)), 0)
    held = np.flatnonzero(at >= 0)  # the poses in boxes of the level
    at = at[held]
    keys = np.union1d(free, at)
    spread = np.where(np.isin(keys, free), anywhere / len(free), 0.0)
    found = []
    for level in range(deepest + 1):
        box = np.searchsorted(keys, at)
        total: Masses = spread + np.bincount(box, mass[held], len(keys)).astype(np.float64)
        heavy = (total > most) & (level < deepest)
        found.append(Leaves(np.full(len(keys), level), keys, total).chosen(~heavy))
        if not heavy.any():
            break
        held = held[heavy[box]]
        below = boxes.parts(keys[heavy], level)
        spread = spread[np.searchsorted(keys, boxes.parents(below, level + 1))] / PARTS
        keys, at = below, _around(boxes, x, held, level + 1)
    return joined(found)


def _around(boxes: PoseBoxes, x: States, held: NDArray[np.intp], level: int) -> Keys:
    """The box that each of some poses lies in, −1 off the map: the room that many at a time take is
    small.
    """
    parts = range(0, len(held), AT_ONCE)
    found = [boxes.around(x[:, held[first : first + AT_ONCE]], level) for first in parts]
    return np.concatenate([np.empty(0, dtype=np.int64), *found])


def most_bytes(boxes: PoseBoxes, most: float, deepest: int) -> float:
    """What a step takes at most, with the belief before and after it and its hypotheses.

    Every box that is divided has more than `most`; in a belief without gaps there are 8 / most
    leaves at the most then, and not more than the map has boxes of the last level. Measured with
    beliefs that are spread over everything, which had 6.3 / most, 165 bytes a leaf and 55 a pose
    that is drawn in one; 110 a leaf and 650 a bin of the histogram that hypotheses are the hills
    of.
    """
    largest = boxes.count_free_squares() * boxes.headings
    leaves = min(largest * 8.0**deepest, largest + 8.0 / most)
    drawn = leaves + 7.0 * (min(leaves, 1.0 / most) + largest)
    bins = largest * float(np.prod(boxes.sides(0))) / (BIN_LENGTH**2 * BIN_ANGLE)
    return max(170.0 * leaves + 60.0 * drawn, 115.0 * leaves + 650.0 * min(leaves, bins))
