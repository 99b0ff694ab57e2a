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
    """The first map on a topic of a bag that has any cells.

    Raises LogError for what is no bag or cannot be read, ConfigError for a topic that is not there
    or of another type, MapError where no message holds a map or the first one cannot be right.
    """
    files = find_bag(path)
    if files is None:
        raise LogError(f"{path}: not a ROS bag, so it has no topic {topic!r}")
    with open_bag(files) as bag:
        name = bag.topic(topic, GRID)
        for _, message in bag.messages([name]):
            if message.info.width and message.info.height:
                return _grid(f"{path}, {name}", message)
    raise MapError(f"{path}, {name}: no message holds a map with cells")


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
