"""Mosaics of ceilings from and to files: an image, and a YAML file like that of a ROS map.

    image: ceiling.png      any format that Pillow reads, row 0 at the top
    resolution: 0.05        metres a pixel
    origin: [x, y, yaw]     of the lower left corner in the map frame, m, m, rad
    unknown_below: 0.02     optional: darker pixels are unknown, as around a stitched mosaic

Transparent pixels are unknown. Colours count by their luma.
"""

import os
import warnings
from contextlib import suppress
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcloc.errors import MapError
from mcloc.maps.brightness import brightness
from mcloc.maps.mosaic import Mosaic
from mcloc.maps.ros_map import SUFFIXES, yaml_fields, yaml_number, yaml_origin
from mcloc.textfile import TextFile


def read(
    path: str | Path, resolution: float | None = None, origin: ArrayLike | None = None
) -> Mosaic:
    """See `Mosaic.load`. Raises MapError."""
    if Path(path).suffix.lower() not in SUFFIXES:
        if resolution is None or origin is None:
            raise MapError(
                f"{path}: an image alone does not say where it lies; give a .yaml file with image, "
                "resolution and origin"
            )
        frame = np.array(origin, dtype=np.float64)
        return Mosaic(_image(str(path), Path(path)), resolution, frame, name=str(path))
    text = TextFile(str(path), MapError)
    fields = yaml_fields(text)
    image = fields.get("image")
    if not isinstance(image, str) or not image:
        raise MapError(f"{path}: has no image; name the picture of the ceiling with image:")
    scale = yaml_number(text, fields, "resolution") if resolution is None else resolution
    frame = yaml_origin(text, fields) if origin is None else np.array(origin, dtype=np.float64)
    table = _image(str(path), Path(path).parent / image)
    table[table < yaml_number(text, fields, "unknown_below", "0")] = np.nan
    return Mosaic(table, scale, frame, name=str(path))


def write(mosaic: Mosaic, path: Path) -> None:
    """See `Mosaic.save`. Both files are replaced once they are written out."""
    import yaml
    from PIL import Image

    if path.suffix.lower() not in SUFFIXES:
        raise MapError(f"{path}: the name of a mosaic to write must end in {' or '.join(SUFFIXES)}")
    upright = mosaic.image[::-1]
    known = np.isfinite(upright)
    if known.all():
        picture = Image.fromarray(np.rint(upright * 65535.0).astype(np.uint16))
    else:
        levels = np.rint(np.where(known, upright, 0.0) * 255.0).astype(np.uint8)
        picture = Image.fromarray(np.dstack([levels, np.where(known, 255, 0).astype(np.uint8)]))
    image = path.with_suffix(".png")
    fields = {
        "image": image.name,
        "resolution": float(mosaic.resolution),
        "origin": mosaic.origin.tolist(),
    }
    parts = {file: file.with_name(file.name + ".part") for file in (image, path)}
    try:
        picture.save(parts[image], format="PNG")
        text = yaml.safe_dump(fields, sort_keys=False, allow_unicode=True)
        parts[path].write_text(text, encoding="utf-8")
        for file, part in parts.items():
            os.replace(part, file)
    except OSError as cause:
        for part in parts.values():
            with suppress(OSError):
                part.unlink()
        raise MapError(f"{path}: cannot be written ({cause.strerror})") from cause


def _image(told: str, path: Path) -> NDArray[np.float32]:
    """(H, W) brightness, row 0 lowest. told: what the user named, for messages."""
    from PIL import Image

    if not os.path.isfile(path):
        raise MapError(f"{told}: there is no image {path}")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", Image.DecompressionBombWarning)
            with Image.open(path) as image:
                table = brightness(image)[::-1].copy()
    except Exception as cause:  # for a damaged file decoders raise SyntaxError, struct.error, …
        raise MapError(f"{told}: the image {path} cannot be read ({cause})") from cause
    return table
