"""The leaves of an octree of poses: boxes of several levels, each with its mass."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mcloc.draws import Draws, Stream
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
    at = boxes.around(x, 0)
    x, mass, at = x[:, at >= 0], mass[at >= 0], at[at >= 0]
    keys = np.union1d(free, at)
    spread = np.where(np.isin(keys, free), anywhere / len(free), 0.0)
    found = []
    for level in range(deepest + 1):
        box = np.searchsorted(keys, at)
        total: Masses = spread + np.bincount(box, mass, len(keys)).astype(np.float64)
        heavy = (total > most) & (level < deepest)
        found.append(Leaves(np.full(len(keys), level), keys, total).chosen(~heavy))
        if not heavy.any():
            break
        within = heavy[box]
        x, mass = x[:, within], mass[within]
        below = boxes.parts(keys[heavy], level)
        spread = spread[np.searchsorted(keys, boxes.parents(below, level + 1))] / PARTS
        keys, at = below, boxes.around(x, level + 1)
    return joined(found)
