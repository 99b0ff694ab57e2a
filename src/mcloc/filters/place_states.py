"""The states of topological Markov localization: a node of the map's graph and a range of headings,
each with poses that stand for it.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mcloc.geometry import compose, wrap
from mcloc.kernels.clusters import join_hills
from mcloc.maps.places import Places
from mcloc.statespace import LogWeights, States

VALLEY = 0.5  # two hills are two places if the density between them is below this share of both
TURNS = 4  # poses at each spot that look into one range of headings


@dataclass(frozen=True, eq=False)
class PlaceStates:
    """State `node · headings + k`: all poses in that node with a heading in the kth of equal ranges
    of (−π, π]. spacing: m between the spots at which the poses stand that stand for it.
    """

    places: Places
    headings: int
    spacing: float

    def __len__(self) -> int:
        return len(self.places) * self.headings

    @property
    def poses(self) -> States:
        """(3, n): map frame, in the order of their states; all stand for the same volume."""
        return self._poses[0]

    @property
    def state(self) -> NDArray[np.intp]:
        """(n,): which state each pose is of."""
        return self._poses[1]

    @cached_property
    def sizes(self) -> NDArray[np.intp]:
        """(S,): poses of each state."""
        return np.bincount(self.state, minlength=len(self))

    @property
    def sides(self) -> NDArray[np.float64]:
        """(3,): of what a pose stands for, m, m, rad."""
        turn = 2.0 * np.pi / (self.headings * TURNS)
        return np.array([self.spacing, self.spacing, turn])

    def of(self, x: States) -> NDArray[np.intp]:
        """(n,): the state of each pose x (3, n), of the nearest node where it is in none."""
        row, column = self.places.grid.cell_of(x.T)
        height, width = self.places.nearest.shape
        node = self.places.nearest[row.clip(0, height - 1), column.clip(0, width - 1)]
        k = np.floor((wrap(x[2]) + np.pi) / (2.0 * np.pi) * self.headings).astype(np.intp)
        state: NDArray[np.intp] = node * self.headings + np.minimum(k, self.headings - 1)
        return state

    def log_mean(self, log_p: LogWeights) -> LogWeights:
        """(S,): log of the mean of p over the poses of each state; log_p: (n,)."""
        starts = np.cumsum(self.sizes) - self.sizes
        top = np.maximum.reduceat(log_p, starts)
        shift = np.where(np.isfinite(top), top, 0.0)
        with np.errstate(divide="ignore"):
            total = np.log(np.add.reduceat(np.exp(log_p - shift[self.state]), starts))
        mean: LogWeights = total + shift - np.log(self.sizes)
        return mean

    def near(self, a: NDArray[np.intp], b: NDArray[np.intp]) -> NDArray[np.bool_]:
        """(n,): whether the nodes of states a and b are the same, or at most two edges apart."""
        found: NDArray[np.bool_] = self._near[a // self.headings, b // self.headings]
        return found

    def hills(self, mass: NDArray[np.float64]) -> NDArray[np.int64]:
        """(S,): the top of the hill that each state belongs to, of the density of this mass."""
        density = mass / self.sizes
        root = np.empty(len(self), dtype=np.int64)
        join_hills(np.argsort(-density, kind="stable"), density, self._neighbours, VALLEY, root)
        return root

    @cached_property
    def _poses(self) -> tuple[States, NDArray[np.intp]]:
        grid, each = self.places.grid, self.headings * TURNS
        row, column = self._spots()
        local = np.stack([column + 0.5, row + 0.5, np.zeros(len(row))], axis=-1)
        local[:, :2] *= grid.resolution
        spots = compose(grid.origin, local)[:, :2]
        fine = (np.arange(each) + 0.5) * 2.0 * np.pi / each - np.pi
        node = self.places.nearest[row, column].astype(np.intp)
        state = (node[:, None] * self.headings + np.arange(each) // TURNS).ravel()
        order = np.argsort(state, kind="stable")
        x = np.stack([*np.repeat(spots, each, axis=0).T, np.tile(fine, len(spots))])
        return np.ascontiguousarray(x[:, order]), state[order]

    def _spots(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Rows and columns of a lattice of standing cells; of a node that it misses, the cell that
        is nearest to its centre.
        """
        places, grid = self.places, self.places.grid
        step = max(round(self.spacing / grid.resolution), 1)
        lattice = np.zeros_like(places.standing)
        lattice[step // 2 :: step, step // 2 :: step] = True
        row, column = np.nonzero(places.standing & lattice)
        missed = np.setdiff1d(np.arange(len(places)), places.nearest[row, column])
        for node in missed:
            rows, columns = np.nonzero(places.standing & (places.nearest == node))
            centre = grid.cell_of(np.append(places.centres[node], 0.0))
            k = int(np.hypot(rows - centre[0], columns - centre[1]).argmin())
            row, column = np.append(row, rows[k]), np.append(column, columns[k])
        return row, column

    @cached_property
    def _near(self) -> NDArray[np.bool_]:
        """(K, K): nodes at most two edges apart."""
        touching = np.eye(len(self.places), dtype=np.bool_)
        a, b = self.places.edges.T
        touching[a, b] = touching[b, a] = True
        near: NDArray[np.bool_] = touching.astype(np.float32) @ touching > 0.0
        return near

    @cached_property
    def _neighbours(self) -> NDArray[np.int64]:
        """(S, M): the states beside each: in the same node or one that touches it, with the same
        heading or the next on either side; −1 fills the rows up.
        """
        edges = self.places.edges
        own = np.arange(len(self.places))
        pairs = np.concatenate([np.stack([own, own], axis=1), edges, edges[:, ::-1]])
        pairs = pairs[np.argsort(pairs[:, 0], kind="stable")]
        degree = np.bincount(pairs[:, 0])
        nth = np.arange(len(pairs)) - np.repeat(np.cumsum(degree) - degree, degree)
        table = np.full((len(self), 3 * int(degree.max())), -1, dtype=np.int64)
        for k in range(self.headings):
            for m, way in enumerate((-1, 0, 1)):
                beside = pairs[:, 1] * self.headings + (k + way) % self.headings
                table[pairs[:, 0] * self.headings + k, 3 * nth + m] = beside
        return table
