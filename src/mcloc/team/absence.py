"""p(robot i does not see j | x_i, x_j) = 1 − p_detect v(x_i, x_j), v whether j is in view of i:
where j is not, by the belief of i  [the negative detections of Fox01 §19.4.1].

Over the belief of i that is (1 − p_detect) + p_detect (1 − V(x_j)): the density tree of 1 − V, in a
message whose chance to say nothing is 1 − p_detect.
"""

import math
from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mcloc.density_tree import DensityTree
from mcloc.draws import Draws
from mcloc.events import Message
from mcloc.maps.occupancy import FREE, OCCUPIED, OccupancyGrid
from mcloc.maps.ray_caster import RayCaster
from mcloc.particles import Particles
from mcloc.resampling import Systematic
from mcloc.sensors.messages import message_of
from mcloc.statespace import PLANE, States
from mcloc.team.detection import DetectionModel

LOOKED_FROM = 32  # poses that the belief of the robot that looks is taken by
BEAMS = 180  # around each
HALVINGS = 6  # of each side of the map: 64 × 64 squares
LEAST = 1e-6  # of 1 − V, so that no square is impossible

Array = NDArray[np.float64]


class View:
    """What robots on a map see of each other: nothing behind walls, nor behind unknown cells."""

    def __init__(self, grid: OccupancyGrid) -> None:
        closed = np.where(grid.free, FREE, OCCUPIED).astype(np.int8)
        self._grid = grid
        self._caster = RayCaster(replace(grid, cells=closed))

    def seen(self, x: States, places: Array, model: DetectionModel) -> Array:
        """(P,): V, the share of the poses x (3, n) that have each of the places (2, P) in view."""
        step = 2.0 * math.pi / BEAMS
        reach = self._caster.ranges(x, np.zeros(3), step * np.arange(BEAMS), model.range_max)
        reach = np.where(np.isnan(reach), np.inf, reach)  # no place of the map is behind its edge
        dx, dy = (places[k][None, :] - x[k][:, None] for k in range(2))
        bearing = np.arctan2(dy, dx) - x[2][:, None]
        beam = np.rint(bearing / step).astype(np.intp) % BEAMS
        d = np.hypot(dx, dy)
        ahead = np.abs(np.remainder(bearing + math.pi, 2.0 * math.pi) - math.pi) <= 0.5 * model.fov
        near = (d <= model.range_max) & (d <= np.take_along_axis(reach, beam, axis=1))
        share: Array = np.mean(near & ahead, axis=0)
        return share

    def message(
        self, t: float, seer: Particles, model: DetectionModel, source: str, draws: Draws
    ) -> Message:
        """What a robot that was not seen at t is told by one with such a belief. source: whose."""
        ancestors = Systematic()(seer, LOOKED_FROM, draws).of(0, LOOKED_FROM)
        poses = np.ascontiguousarray(np.take(seer.states, ancestors, axis=1))
        hidden = np.maximum(1.0 - self.seen(poses, self._middles, model), LEAST)
        tree = lattice_tree(*self._box, hidden.reshape(1 << HALVINGS, 1 << HALVINGS))
        even = 1.0 / float(hidden.mean() * self._box[1].prod())  # T where nothing is seen
        return message_of(t, tree, source, p_false=1.0 - model.p_detect, even=even)

    @cached_property
    def _box(self) -> tuple[Array, Array]:
        """Low corner and sides (2,) of a box around the map, map frame."""
        height, width = np.array(self._grid.cells.shape) * self._grid.resolution
        ox, oy, yaw = self._grid.origin
        cos, sin = math.cos(yaw), math.sin(yaw)
        corners = np.array([[0.0, 0.0], [width, 0.0], [0.0, height], [width, height]])
        there = corners @ np.array([[cos, sin], [-sin, cos]]) + [ox, oy]
        low = there.min(axis=0)
        return low, there.max(axis=0) - low

    @cached_property
    def _middles(self) -> Array:
        """(2, P): of the squares, those of one x in a row."""
        low, side = self._box
        steps = (np.arange(1 << HALVINGS) + 0.5) / (1 << HALVINGS)
        x, y = np.meshgrid(low[0] + side[0] * steps, low[1] + side[1] * steps, indexing="ij")
        return np.stack([x.ravel(), y.ravel()])


def lattice_tree(low: Array, side: Array, values: Array) -> DensityTree:
    """The density over a box of the plane that is ∝ values (2ᵏ, 2ᵏ), first index x, on its equal
    parts: a tree that is halved along x and y in turn.
    """
    depth = 2 * int(np.log2(len(values)))
    corners, widths = [np.zeros((1, 2))], [np.ones((1, 2))]
    for level in range(depth):
        half = 0.5 * widths[-1][0] * np.eye(2)[level % 2]
        corners.append(np.stack([corners[-1], corners[-1] + half], axis=1).reshape(-1, 2))
        widths.append(np.tile(widths[-1][0] - half, (len(corners[-1]), 1)))
    inner, nodes = (1 << depth) - 1, (2 << depth) - 1
    axis, child = np.zeros(nodes, dtype=np.uint64), np.arange(nodes, dtype=np.uint64)
    corner, width = np.concatenate(corners), np.concatenate(widths)
    split, weight = np.full(nodes, np.nan), np.zeros(nodes)
    level_of = np.repeat(np.arange(depth), 1 << np.arange(depth)) % 2
    axis[:inner] = level_of
    child[:inner] = 2 * child[:inner] + 1
    halfway = corner[:inner] + 0.5 * width[:inner]
    split[:inner] = halfway[np.arange(inner), level_of]
    ix, iy = np.rint(corner[inner:] * len(values)).astype(np.intp).T
    weight[inner:] = values[ix, iy] / values.sum()
    return DensityTree(PLANE, 0.0, low, side, axis, split, child, corner, width, weight)
