"""What grid-based Markov localization believes: a mass for each cell of a grid of poses."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mcloc.filters.recovery import Evidence
from mcloc.kernels.blur import SIDE, mark_active
from mcloc.kernels.jit import share
from mcloc.maps.pose_lattice import PoseLattice
from mcloc.particles import Particles
from mcloc.statespace import States

Cells = NDArray[np.float32]

AT_ONCE = 1 << 16  # cells


@dataclass(frozen=True, eq=False)
class GridBelief:
    """cells: (K, H, W), the mass of each; in all 1. offsets: (K, 2) by how much the cells of each
    slice of headings have moved along x and y, in cells; turn: by how much all slices have turned,
    rad. least: the mass from which on a cell is active.
    """

    lattice: PoseLattice
    cells: Cells
    offsets: NDArray[np.float64]
    turn: float
    least: float
    evidence: Mapping[str, Evidence] = field(default_factory=dict)

    @property
    def active(self) -> NDArray[np.intp]:
        """(n,): the cells that are active, block by block; the largest if none is. They hold nearly
        all mass. Found anew each time: to keep them takes 8 bytes each.
        """
        _, height, width = self.lattice.shape
        k, i, j = (
            index[:, None, None] for index in np.nonzero(active_blocks(self.cells, self.least))
        )
        row, column = np.arange(SIDE)[:, None], np.arange(SIDE)
        found = (((k * height + i * SIDE + row) * width) + j * SIDE + column).ravel()
        flat = self.cells.ravel()
        found = found[flat[found] > self.least]
        return found if len(found) else np.array([flat.argmax()])

    def middles(self, cells: NDArray[np.intp]) -> Iterator[tuple[slice, States]]:
        """(3, m): of some of these cells (n,) after the other, map frame: the room that many at a
        time take is small.
        """
        for first in range(0, len(cells), AT_ONCE):
            here = slice(first, first + AT_ONCE)
            yield here, self.lattice.poses(cells[here], self.offsets, self.turn)

    @cached_property
    def particles(self) -> Particles:
        """The middles of the active cells."""
        active = self.active
        states = np.empty((3, len(active)))
        for here, x in self.middles(active):
            states[:, here] = x
        with np.errstate(divide="ignore"):
            return Particles.normalized(states, np.log(self.cells.ravel()[active], dtype=float))


def active_blocks(cells: Cells, least: float) -> NDArray[np.bool_]:
    """(K, H / SIDE, W / SIDE): which blocks have a cell above `least`."""
    count, height, width = cells.shape
    active = np.zeros((count, height // SIDE, width // SIDE), dtype=np.bool_)
    shared(mark_active, count, 0.2 * cells.size, cells, np.float32(least), active)
    return active


def shared(kernel: Callable[..., None], n: int, work: float, *given: object) -> None:
    """The kernel over [0, n), by several threads. work: ns, about."""
    share(lambda start, stop: kernel(*given, start, stop), n, work)
