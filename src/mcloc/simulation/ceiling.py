"""A ceiling as a mosaic shows it: plaster that is lit unevenly, tiles, beams, rows of lamps,
skylights.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, zoom

from mcloc.maps.mosaic import Mosaic
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.registry import Configurable, param

LAMP = (1.2, 0.3)  # m
JOINT = 0.02  # m, between tiles
BEAM = 0.3  # m
BLUR = 0.04  # m, of edges
COARSE = 0.5  # m, of what shading is drawn with


@dataclass(frozen=True)
class CeilingPlan(Configurable):
    """What a ceiling is made of. Lamps and beams repeat, as they do on ceilings: it is lamps that
    are out, dirty tiles, skylights and light from the windows that tell one place from another.
    """

    plaster: float = param(0.45, "", "brightness without light on it", low=0.1, high=0.9)
    shading: float = param(0.08, "", "deviation of the light from windows", low=0, high=0.3)
    shade_length: float = param(3.0, "m", "over which that changes", low=0.5, high=100)
    tile: float = param(0.6, "m", "side of a tile", low=0.1, high=10)
    dirt: float = param(0.04, "", "deviation from tile to tile", low=0, high=0.3)
    bay: float = param(5.0, "m", "between beams", low=1, high=100)
    row: float = param(2.5, "m", "between rows of lamps", low=0.5, high=100)
    gap: float = param(2.0, "m", "between lamps of a row", low=0.5, high=100)
    out: float = param(0.2, "", "share of the lamps that are out", low=0, high=1)
    skylights: float = param(0.01, "", "skylights, for each square metre", low=0, high=1)


def ceiling_mosaic(
    grid: OccupancyGrid, seed: int, plan: CeilingPlan | None = None, resolution: float = 0.05
) -> Mosaic:
    """A ceiling above a whole map, in the map's own frame; one seed, the same ceiling.

    resolution: metres a pixel.
    """
    plan = plan or CeilingPlan()
    rng = np.random.default_rng(seed)
    depth, width = np.array(grid.cells.shape) * grid.resolution
    shape = math.ceil(depth / resolution), math.ceil(width / resolution)
    y = (np.arange(shape[0])[:, None] + 0.5) * resolution
    x = (np.arange(shape[1])[None, :] + 0.5) * resolution
    image = plan.plaster + plan.shading * _shading(shape, resolution, plan.shade_length, rng)
    image += plan.dirt * _tiles(x, y, plan.tile, rng)
    image[np.broadcast_to(_stripes(x, plan.tile, JOINT), shape)] -= 0.05
    image[np.broadcast_to(_stripes(y, plan.tile, JOINT), shape)] -= 0.05
    image[np.broadcast_to(_stripes(x - rng.uniform(0.0, plan.bay), plan.bay, BEAM), shape)] -= 0.15
    for place in _lamps(plan, width, depth, rng):
        _fill(image, resolution, place, LAMP, 0.95)
    for _ in range(rng.poisson(plan.skylights * width * depth)):
        place = rng.uniform((0.0, 0.0), (width, depth))
        _fill(image, resolution, place, rng.uniform(0.8, 2.5, 2), rng.uniform(0.75, 1.0))
    image = np.clip(gaussian_filter(image, BLUR / resolution, mode="nearest"), 0.0, 1.0)
    return Mosaic(image.astype(np.float32), resolution, grid.origin, name=f"ceiling({seed})")


def _shading(
    shape: tuple[int, int], resolution: float, length: float, rng: np.random.Generator
) -> NDArray[np.float64]:
    """A smooth field of deviation 1."""
    step = max(COARSE, resolution)
    coarse = [math.ceil(n * resolution / step) + 2 for n in shape]
    noise = gaussian_filter(rng.standard_normal(coarse), length / step, mode="wrap")
    noise /= max(float(noise.std()), 1e-12)
    fine: NDArray[np.float64] = zoom(noise, step / resolution, order=1)[: shape[0], : shape[1]]
    return fine


def _tiles(
    x: NDArray[np.float64], y: NDArray[np.float64], side: float, rng: np.random.Generator
) -> NDArray[np.float64]:
    """A standard normal number for each tile."""
    column, row = (x / side).astype(np.intp), (y / side).astype(np.intp)
    return rng.standard_normal((int(row.max()) + 1, int(column.max()) + 1))[row, column]


def _stripes(at: NDArray[np.float64], every: float, width: float) -> NDArray[np.bool_]:
    """Where a stripe begins each `every` metres."""
    stripes: NDArray[np.bool_] = np.mod(at, every) < width
    return stripes


def _lamps(
    plan: CeilingPlan, width: float, depth: float, rng: np.random.Generator
) -> NDArray[np.float64]:
    """(L, 2): the middles of those that are lit, m."""
    east = np.arange(rng.uniform(0.0, plan.gap), width, plan.gap)
    north = np.arange(rng.uniform(0.0, plan.row), depth, plan.row)
    places = np.stack(np.meshgrid(east, north), axis=-1).reshape(-1, 2)
    lit: NDArray[np.float64] = places[rng.random(len(places)) >= plan.out]
    return lit


def _fill(
    image: NDArray[np.float64],
    resolution: float,
    middle: NDArray[np.float64],
    size: tuple[float, float] | NDArray[np.float64],
    brightness: float,
) -> None:
    """A rectangle, as far as it lies in the image. middle, size: east and north, m."""
    low, high = (
        np.maximum(np.rint((np.asarray(middle) + sign * 0.5 * np.asarray(size)) / resolution), 0)
        for sign in (-1, 1)
    )
    image[int(low[1]) : int(high[1]), int(low[0]) : int(high[0])] = brightness
