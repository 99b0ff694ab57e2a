"""A map from a ROS bag: nav_msgs/OccupancyGrid, row 0 lowest in y, −1 unknown, 0 … 100 percent."""

from pathlib import Path

import numpy as np

from mcloc.errors import LogError, MapError
from mcloc.io.bag import Message, open_bag
from mcloc.io.bag_files import find_bag
from mcloc.io.bag_messages import GRID, pose_matrix
from mcloc.io.frames import planar, tilt, upside_down
from mcloc.maps.occupancy import OCCUPIED, UNKNOWN, OccupancyGrid

MOST_TILT = 1e-3  # rad; a floor plan lies flat


def read_map(path: str | Path, topic: str) -> OccupancyGrid:
    """The last map on a topic of a bag that has free cells: SLAM publishes maps as they grow.

    One map at a time is held. Of a bag that is cut, what lies before the cut counts. Raises
    LogError for what is no bag or cannot be read, ConfigError for a topic that is not there or of
    another type, MapError for a map that cannot be right and where none has free cells.
    """
    files = find_bag(path)
    if files is None:
        raise LogError(f"{path}: not a ROS bag, so it has no topic {topic!r}")
    with open_bag(files) as bag:
        name = bag.topic(topic, GRID)
        last = None
        try:
            for _, message in bag.messages([name]):
                if message.info.width and message.info.height:
                    grid = _grid(f"{path}, {name}", message)
                    last = grid if grid.free.any() else last
        except LogError:
            if last is None:
                raise
    if last is None:
        raise MapError(f"{path}, {name}: no message holds a map with free cells")
    return last


def _grid(name: str, message: Message) -> OccupancyGrid:
    width, height = int(message.info.width), int(message.info.height)
    cells = np.asarray(message.data, dtype=np.int8)
    if len(cells) != width * height:
        raise MapError(f"{name}: {width} × {height} cells stated, {len(cells)} given")
    if cells.min() < UNKNOWN or cells.max() > OCCUPIED:
        raise MapError(
            f"{name}: cells must be −1 or 0 … 100, got {cells.min()} … {cells.max()}; a map_server "
            "in raw mode publishes others"
        )
    origin = pose_matrix(message.info.origin)
    if upside_down(origin) or tilt(origin) > MOST_TILT:
        raise MapError(f"{name}: its origin is tilted; a map must lie flat")
    return OccupancyGrid(
        cells.reshape(height, width),
        # A float32: its shortest decimals are the resolution that the map was published with.
        float(str(np.float32(message.info.resolution))),
        planar(origin),
        name=name,
    )
