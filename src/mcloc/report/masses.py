"""What a grid or an octree of poses believes, seen from above: by place, over all headings."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mcloc.filters.grid_belief import GridBelief
from mcloc.filters.octree import OctreeBelief

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DECADES = 4.0  # below the largest mass; less is not drawn


def of_grid(bel: GridBelief) -> tuple[NDArray[np.float64], float]:
    """Mass by row and column of squares along the map's own axes, from its corner on; their side,
    m.
    """
    lattice = bel.lattice
    height, width = (
        int(np.ceil(cells * lattice.grid.resolution / lattice.cell))
        for cells in lattice.grid.cells.shape
    )
    x, y, _ = lattice.grid.to_grid(bel.particles.states.T).T / lattice.cell
    within = (x >= 0.0) & (x < width) & (y >= 0.0) & (y < height)
    at = np.floor(y[within]).astype(np.intp) * width + np.floor(x[within]).astype(np.intp)
    mass = np.bincount(at, bel.particles.weights[within], height * width).astype(np.float64)
    return mass.reshape(height, width), lattice.cell


def of_octree(bel: OctreeBelief) -> tuple[NDArray[np.float64], float]:
    """The same, in squares of the smallest leaves; larger ones are spread over theirs."""
    deepest = int(bel.leaves.level.max())
    total = np.zeros((1, 1))
    for level in range(deepest + 1):
        rows, columns = bel.boxes.shape(level)[1:]
        if level:
            total = 0.25 * total.repeat(2, axis=0).repeat(2, axis=1)
        else:
            total = np.zeros((rows, columns))
        _, keys, mass = bel.leaves.chosen(bel.leaves.level == level)
        column, row, _ = bel.boxes.indices(keys, level)
        here = np.bincount(row * columns + column, mass, rows * columns).astype(np.float64)
        total = total + here.reshape(rows, columns)
    return total, float(bel.boxes.sides(deepest)[0])


def draw_masses(axes: "Axes", bel: GridBelief | OctreeBelief) -> None:
    """Squares, the redder the less mass; turned as the map's origin says."""
    from matplotlib.colors import LogNorm
    from matplotlib.transforms import Affine2D

    if isinstance(bel, GridBelief):
        (mass, side), grid, kind = of_grid(bel), bel.lattice.grid, "cells"
    else:
        (mass, side), grid, kind = of_octree(bel), bel.boxes.grid, "leaves"
    height, width = side * np.array(mass.shape)
    x, y, yaw = grid.origin
    most = float(mass.max())
    if most == 0.0:  # all of it is off the map
        return
    image = axes.imshow(
        np.ma.masked_less(mass, 10.0**-DECADES * most),
        cmap="autumn",
        norm=LogNorm(10.0**-DECADES * most, most),
        origin="lower",
        extent=(0.0, width, 0.0, height),
        interpolation="none",
        alpha=0.75,
        zorder=1.5,
    )
    image.set_transform(Affine2D().rotate(yaw).translate(x, y) + axes.transData)
    # For the legend.
    axes.scatter([], [], marker="s", color="#ffb000", label=f"last {kind} (brighter: likelier)")
