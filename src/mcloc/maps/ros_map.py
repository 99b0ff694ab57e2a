"""ROS map_server: YAML and an image, row 0 at the top; p = 1 − shade is the chance of a wall.

    trinary  p > occupied_thresh: 100; p < free_thresh: 0; else unknown. An alpha channel is
             averaged in with the colours.
    scale    the same, but linear between the thresholds, 1 … 99; any transparency is unknown.
    raw      the pixel's value is the cell: 0 … 100, above that unknown; negate does not apply.

`negate: 1` makes white occupied. All as nav2_map_server has it (map_io.cpp), but for scale: its
rounding lets cells between the thresholds become 0 or 100, too.
"""

import os
import warnings
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mcloc.errors import MapError
from mcloc.maps.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from mcloc.textfile import TextFile

if TYPE_CHECKING:
    from PIL import Image

SUFFIXES = (".yaml", ".yml")
MODES = ("trinary", "scale", "raw")
IMAGES = ("PPM", "PNG", "BMP")  # Pillow calls PGM "PPM"; no other decoder is let near a file
NEGATE = {"0": False, "false": False, "no": False, "1": True, "true": True, "yes": True}
SHADES = {OCCUPIED: 0, UNKNOWN: 205, FREE: 254}


def read(text: TextFile) -> OccupancyGrid:
    """The map of a YAML file and its image. Raises MapError."""
    fields = yaml_fields(text)
    mode = fields.get("mode", "trinary")
    if mode not in MODES:
        raise MapError(f"{text.path}: mode must be one of {', '.join(MODES)}, got {mode!r}")
    negate = str(fields.get("negate", "0")).lower()
    if negate not in NEGATE:
        raise MapError(f"{text.path}: negate must be 0 or 1, got {negate!r}")
    image = fields.get("image")
    if not isinstance(image, str) or not image:
        raise MapError(f"{text.path}: has no image; name the PGM or PNG with image:")
    resolution = yaml_number(text, fields, "resolution")
    occupied = yaml_number(text, fields, "occupied_thresh", "0.65")
    free = yaml_number(text, fields, "free_thresh", "0.196")
    origin = yaml_origin(text, fields)

    levels, white, transparent = _open_image(text, Path(text.path).parent / image, mode)
    shade = np.arange(white + 1) / white
    cells = _cells_by_level(shade, mode, NEGATE[negate], occupied, free)[levels]
    if mode == "scale" and transparent is not None:
        cells[transparent] = UNKNOWN
    grid = OccupancyGrid(cells[::-1], resolution, origin, occupied, free, text.path)
    if (
        mode == "scale"
    ):  # the thresholds have done their work: 100 is occupied, 0 free, else neither
        return replace(grid, occupied_thresh=1.0, free_thresh=0.0)
    return grid


def write(grid: OccupancyGrid, path: Path) -> None:
    """Write the YAML to `path` and a PGM beside it: trinary where that keeps every cell, else raw.

    Reading it gives the same cells, states, thresholds and origin. The files are
    replaced once both are written out. Raises MapError.
    """
    import yaml

    if path.suffix.lower() not in SUFFIXES:
        raise MapError(f"{path}: the name of a map to write must end in {' or '.join(SUFFIXES)}")
    cells, mode = grid.cells, "raw"
    pixels = cells.view(np.uint8)  # −1, unknown, becomes 255
    shades = [np.uint8(shade) for shade in SHADES.values()]
    if np.isin(cells, list(SHADES)).all() and _tells_apart(grid):
        mode = "trinary"
        pixels = np.select([cells == cell for cell in SHADES], shades).astype(np.uint8)
    height, width = cells.shape
    image = path.with_suffix(".pgm")
    fields = {
        "image": image.name,
        "mode": mode,
        "resolution": float(grid.resolution),
        "origin": grid.origin.tolist(),
        "negate": 0,
        "occupied_thresh": float(grid.occupied_thresh),
        "free_thresh": float(grid.free_thresh),
    }
    _write_all(
        {
            image: b"P5\n%d %d\n255\n" % (width, height) + pixels[::-1].tobytes(),
            path: yaml.safe_dump(fields, sort_keys=False, allow_unicode=True).encode(),
        }
    )


def yaml_fields(text: TextFile) -> dict[str, Any]:
    """A YAML mapping, its scalars as text: YAML 1.1 takes 5e-2 for a word, ROS for a number."""
    import yaml

    source = "".join(text.head())
    try:
        fields = yaml.load(source, yaml.BaseLoader)
    except yaml.YAMLError as cause:
        raise MapError(f"{text.path}: not YAML ({' '.join(str(cause).split())})") from cause
    except RecursionError as cause:
        raise MapError(f"{text.path}: not the YAML of a map (nested too deeply)") from cause
    if not isinstance(fields, dict):
        raise MapError(f"{text.path}: must be a YAML mapping with image, resolution and origin")
    return fields


def yaml_number(
    text: TextFile, fields: dict[str, Any], key: str, default: str | None = None
) -> float:
    """A number. Raises MapError."""
    value = fields.get(key, default)
    if value is None:
        raise MapError(f"{text.path}: has no {key}")
    try:
        return float(value)
    except (TypeError, ValueError):
        raise MapError(f"{text.path}: {key} must be a number, got {value!r}") from None


def yaml_origin(text: TextFile, fields: dict[str, Any]) -> NDArray[np.float64]:
    """x, y, yaw, as many as there are. Raises MapError."""
    value = fields.get("origin")
    try:
        return np.array([float(number) for number in value or ()], dtype=np.float64)
    except (TypeError, ValueError):
        raise MapError(f"{text.path}: origin must be [x, y, yaw], got {value!r}") from None


def _open_image(
    text: TextFile, path: Path, mode: str
) -> tuple[NDArray[np.integer[Any]], int, NDArray[np.bool_] | None]:
    """The level of each pixel, that of white, and which pixels are transparent if any can be."""
    from PIL import Image

    if not os.path.isfile(path):
        raise MapError(f"{text.path}: its image {path} is missing")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", Image.DecompressionBombWarning)
            with Image.open(path, formats=IMAGES) as image:
                return _levels(image, mode)
    except Exception as cause:  # for a damaged file decoders raise SyntaxError, struct.error, …
        raise MapError(f"{text.path}: its image {path} cannot be read ({cause})") from cause


def _levels(
    image: "Image.Image", mode: str
) -> tuple[NDArray[np.integer[Any]], int, NDArray[np.bool_] | None]:
    if image.mode.startswith("I"):  # 16 bits
        return np.asarray(image), 65535, None
    if image.mode in ("1", "L") and not image.has_transparency_data:
        return np.asarray(image.convert("L")), 255, None
    if not image.has_transparency_data:
        return np.asarray(image.convert("RGB")).sum(axis=2, dtype=np.uint16), 3 * 255, None
    channels = np.asarray(image.convert("RGBA"))
    averaged = 4 if mode == "trinary" else 3
    levels = channels[..., :averaged].sum(axis=2, dtype=np.uint16)
    return levels, averaged * 255, channels[..., 3] < 255


def _cells_by_level(
    shade: NDArray[np.float64], mode: str, negate: bool, occupied_thresh: float, free_thresh: float
) -> NDArray[np.int8]:
    """The cell that each shade, 0 black … 1 white, stands for."""
    if mode == "raw":
        value = np.rint(255.0 * shade)
        return np.where(value <= OCCUPIED, value, UNKNOWN).astype(np.int8)
    p = shade if negate else 1.0 - shade
    between: float | NDArray[np.float64] = UNKNOWN
    if mode == "scale":
        between = np.clip(np.rint(np.interp(p, [free_thresh, occupied_thresh], [0, 100])), 1, 99)
    known = np.where(p > occupied_thresh, OCCUPIED, FREE)
    return np.where((p > occupied_thresh) | (p < free_thresh), known, between).astype(np.int8)


def _tells_apart(grid: OccupancyGrid) -> bool:
    """Whether the three shades read back as what they stand for, by the grid's thresholds."""
    cells = np.array(list(SHADES), dtype=np.int8)
    shades = np.array(list(SHADES.values())) / 255.0
    read = _cells_by_level(shades, "trinary", False, grid.occupied_thresh, grid.free_thresh)
    return bool((read == cells).all())


def _write_all(files: dict[Path, bytes]) -> None:
    parts = {path: path.with_name(path.name + ".part") for path in files}
    try:
        for path, part in parts.items():
            part.write_bytes(files[path])
        for path, part in parts.items():
            os.replace(part, path)
    except OSError as cause:
        for part in parts.values():
            with suppress(OSError):
                part.unlink()
        raise MapError(f"{path}: cannot be written ({cause.strerror})") from cause
