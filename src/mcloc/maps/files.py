"""Maps from and to files, by what is in them."""

from pathlib import Path

from mcloc.errors import MapError
from mcloc.maps import ros_map, wean_map
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.textfile import TextFile


def load(path: str | Path) -> OccupancyGrid:
    """The map in a file: ROS map_server YAML with its image, or CMU's wean.dat, gzip or not.

    Raises MapError for a file that is missing, unreadable, empty, damaged or no map.
    """
    text = TextFile(str(path), MapError)
    head = text.head()
    if any(line.startswith(wean_map.START) for line in head):
        return wean_map.read(text)
    if Path(path).suffix.lower() in ros_map.SUFFIXES:
        return ros_map.read(text)
    raise MapError(
        f"{path}: not a map that can be read; give a ROS map's .yaml (not its image) or a wean.dat"
    )


def save(grid: OccupancyGrid, path: str | Path) -> None:
    """Write a ROS map: `path`, a name ending in .yaml, and the image beside it. Raises MapError."""
    ros_map.write(grid, Path(path))
