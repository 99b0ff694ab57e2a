"""The work of the kernels as a competent user of NumPy writes it: whole arrays, float64, one pass,
no Python loop over particles. What the kernels are measured against, and held to by a test.

States are (3, N) as everywhere: x, y in m, θ in rad, map frame. Maps lie with their corner (0, 0)
at `corner` and are not turned.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt
from scipy.special import ndtri

from mcloc.geometry import compose
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.simulation.ranges import first_walls, rays

Array = NDArray[np.float64]
Whole = NDArray[np.int64]


@dataclass(frozen=True)
class Table:
    """A value for each cell (height, width), the outermost ring standing for all beyond."""

    values: Array
    corner: tuple[float, float]  # m, map frame
    resolution: float  # m


def wrap(angle: Array) -> Array:
    """The same angle in (−π, π]."""
    wrapped: Array = np.pi - np.mod(np.pi - angle, 2.0 * np.pi)
    return wrapped


def cells(x: Array, points: Array, table: Table) -> tuple[Whole, Whole]:
    """Row and column (N, B) of the cell that each point (B, 2) of the robot's frame falls into."""
    cos, sin = np.cos(x[2])[:, None], np.sin(x[2])[:, None]
    left, bottom = table.corner
    in_x = x[0][:, None] + cos * points[:, 0] - sin * points[:, 1]
    in_y = x[1][:, None] + sin * points[:, 0] + cos * points[:, 1]
    height, width = table.values.shape
    row = np.clip((in_y - bottom) / table.resolution, 0, height - 1).astype(np.int64)
    column = np.clip((in_x - left) / table.resolution, 0, width - 1).astype(np.int64)
    return row, column


def sum_over_points(x: Array, points: Array, table: Table) -> Array:
    """(N,): Σ over the points of the table's value: the likelihood field."""
    total: Array = table.values[cells(x, points, table)].sum(axis=1)
    return total


def cast(
    grid: OccupancyGrid, blur: float, x: Array, mount: Array, angles: Array, range_max: float
) -> Array:
    """(N, B): exact expected ranges, m; inf for no wall within range_max, NaN where a ray leaves
    known space before. Unknown cells within `blur` of a wall let rays pass.
    """
    near = distance_transform_edt(~grid.occupied) * grid.resolution <= blur
    passable = np.pad(grid.free | (grid.unknown & near), 1)
    ring = grid.resolution * np.array([1.0, 1.0])
    start, direction = rays(grid, compose(x.T, mount), angles)
    hits = first_walls(~passable, grid.resolution, start + ring[:, None], direction, range_max)
    column, row = np.clip(hits.cell, 0, np.array(passable.shape)[::-1, None] - 1)
    wall = np.pad(grid.occupied, 1)[row, column] | np.isinf(hits.length)
    return np.where(wall, hits.length, np.nan).reshape(-1, len(angles))


def interpolated(lengths: Array, log_p: Array, spacing: float) -> Array:
    """(N,): Σ over the beams of log_p (B, K + 2) at the ranges (N, B), linear between its K knots;
    its last columns are for no wall within reach, inf, and for what is not known, NaN.
    """
    beams, knots = np.arange(lengths.shape[1]), log_p.shape[1] - 2
    known = np.isfinite(lengths)
    at = np.where(known, lengths, 0.0) / spacing
    knot = np.minimum(at.astype(np.int64), knots - 2)
    here, there = log_p[beams, knot], log_p[beams, knot + 1]
    value = here + (at - knot) * (there - here)
    ended = np.where(np.isnan(lengths), log_p[:, -1], log_p[:, -2])
    total: Array = np.where(known, value, ended).sum(axis=1)
    return total


def looked_up(
    x: Array, mount: Array, angles: Array, rows: NDArray[np.uint16], row_of: Table, log_p: Array
) -> Array:
    """(N,): Σ over the beams of log_p (B, E) at the ranges in rows (R, angles) of the cells."""
    row = row_of.values[cells(x, mount[None, :2], row_of)].astype(np.int64)
    bins = rows.shape[1]
    turn = (x[2, :, None] + mount[2] + angles) * (bins / (2.0 * np.pi))
    column = np.mod(np.rint(turn), bins).astype(np.int64)
    total: Array = log_p[np.arange(len(angles)), rows[row, column]].sum(axis=1)
    return total


def moved(x: Array, drive: tuple[float, ...], rng: np.random.Generator) -> Array:
    """(3, N): the odometry motion model. drive: δ_rot1, δ_trans, δ_rot2 and their deviations."""
    rot1, trans, rot2, sd_rot1, sd_trans, sd_rot2 = drive
    noise = rng.standard_normal(x.shape)
    turn, driven = rot1 + sd_rot1 * noise[0], trans + sd_trans * noise[1]
    heading = x[2] + turn
    return np.stack(
        [
            x[0] + driven * np.cos(heading),
            x[1] + driven * np.sin(heading),
            wrap(heading + rot2 + sd_rot2 * noise[2]),
        ]
    )


def systematic(weights: Array, offset: float, n: int) -> Whole:
    """(n,): ancestors, by systematic resampling."""
    cumulative = np.cumsum(weights)
    teeth = (offset + np.arange(n)) / n * cumulative[-1]
    ancestors: Whole = np.searchsorted(cumulative, teeth, side="right")
    return ancestors


def kld_size(x: Array, sides: Array, epsilon: float, delta: float, limits: tuple[int, int]) -> int:
    """How many of the states KLD-sampling asks for, at most all of them."""
    bins = np.floor(x / sides[:, None]).astype(np.int64)
    bins -= bins.min(axis=1, keepdims=True)
    keys = np.ravel_multi_index(tuple(bins), tuple(bins.max(axis=1) + 1))
    _, first = np.unique(keys, return_index=True)
    new = np.zeros(x.shape[1], dtype=np.int64)
    new[first] = 1
    k = np.maximum(np.cumsum(new), 2)
    a = 2.0 / (9.0 * (k - 1))
    bound = (k - 1) / (2.0 * epsilon) * (1.0 - a + np.sqrt(a) * ndtri(1.0 - delta)) ** 3
    enough = np.arange(1, x.shape[1] + 1) >= np.clip(bound, *limits)
    return int(enough.argmax()) + 1 if enough.any() else x.shape[1]


def log_sum_exp(a: Array) -> float:
    """log Σ exp."""
    top = a.max()
    return float(top + np.log(np.exp(a - top).sum()))
