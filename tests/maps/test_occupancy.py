"""OccupancyGrid: what no map can be."""

import numpy as np
import pytest

from mcloc.errors import MapError
from mcloc.maps.occupancy import OccupancyGrid

CELLS = np.zeros((2, 2), dtype=np.int8)


@pytest.mark.parametrize("origin", [(1e12, 0.0, 0.0), (0.0, -1e7, 0.0)])
def test_an_origin_off_the_earth_is_refused(origin: tuple[float, float, float]) -> None:
    with pytest.raises(MapError, match=r"hall: origin must be less than 1e\+07 m away, got \["):
        OccupancyGrid(CELLS, 0.05, np.array(origin), name="hall")


def test_a_map_in_utm_is_taken() -> None:
    grid = OccupancyGrid(CELLS, 0.05, np.array([833_000.0, 9_300_000.0, 0.0]))
    assert grid.state_at([833_000.05, 9_300_000.05, 0.0]) == "free"
