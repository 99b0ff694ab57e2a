"""How the cells of a pose grid move: shift and blur.

The mean of a move shifts each slice of headings as a whole, by any fraction of a cell, and turns
all of them: no cell is touched, and many small moves add up to what they are. Noise around the mean
is blur; its covariance is another in each slice, since the heading turns it.
"""

import math

import numpy as np
from numpy.typing import NDArray

from mcloc.filters.grid_belief import Cells, GridBelief, active_blocks, shared
from mcloc.filters.grid_taps import Taps, taps
from mcloc.kernels.blur import SIDE, gather, mark_reached, put

_REACH, _GATHER = 5.0, 30.0  # ns for a block and tap, and to gather a cell, about


def moved(
    bel: GridBelief, mean: NDArray[np.float64], covariance: NDArray[np.float64]
) -> GridBelief:
    """The belief after a move of that mean (3,) and covariance (3, 3), in the robot's frame: m, m,
    rad. What is passive is shifted, but not blurred. What leaves the grid is lost, unless noise
    carries it over the edge, a block beyond the map: that comes in on the other side.
    """
    lattice = bel.lattice
    headings, sides = lattice.headings(bel.turn), lattice.sides
    turned = np.zeros((len(headings), 3, 3))  # the robot's frame in that of the grid, by slice
    turned[:, 0, 0] = turned[:, 1, 1] = np.cos(headings)
    turned[:, 1, 0] = np.sin(headings)
    turned[:, 0, 1] = -turned[:, 1, 0]
    turned[:, 2, 2] = 1.0
    offsets = bel.offsets + (turned @ mean)[:, :2] / lattice.cell
    cells = bel.cells.copy()
    _clear_seams(cells, bel.offsets, offsets)
    scaled = turned / sides[:, None]
    rounds = taps(np.einsum("kab,bc,kdc->kad", scaled, covariance, scaled), offsets)
    _blur(cells, rounds, bel.least)
    size = np.array(lattice.shape[:0:-1], dtype=np.float64)
    turn = math.remainder(bel.turn + mean[2], 2.0 * math.pi)
    return GridBelief(lattice, cells, np.mod(offsets, size), turn, bel.least)


def _blur(cells: Cells, rounds: list[Taps], least: float) -> None:
    """What active blocks hold is spread; what is passive stays."""
    active = active_blocks(cells, least)
    for noise in rounds:
        of_taps = noise.slices, noise.rows, noise.columns, noise.weights
        reached, blocks = active.copy(), np.stack(np.nonzero(active))
        starts = np.searchsorted(blocks[0], np.arange(len(cells) + 1))
        work = _REACH * blocks.shape[1] * noise.weights.shape[1]
        shared(mark_reached, len(cells), work, blocks, starts, *of_taps, reached)
        blocks = np.stack(np.nonzero(reached))
        out = np.empty((blocks.shape[1], SIDE, SIDE), dtype=np.float32)
        shared(gather, len(out), _GATHER * out.size, cells, out, active, blocks, *of_taps)
        shared(put, len(out), out.size, out, blocks, np.float32(least), cells, active)


def _clear_seams(cells: Cells, before: NDArray[np.float64], after: NDArray[np.float64]) -> None:
    """Nothing comes in on one side that left the grid on the other."""
    _, height, width = cells.shape
    for axis, size in ((0, width), (1, height)):
        middles = np.arange(size) + 0.5
        times = [np.floor((middles + o[:, axis, None]) / size) for o in (before, after)]
        crossed = times[0] != times[1]
        for k in np.flatnonzero(crossed.any(axis=1)):
            lines = cells[k].T if axis == 0 else cells[k]
            lines[crossed[k]] = 0.0
