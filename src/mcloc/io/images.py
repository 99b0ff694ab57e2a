"""Images with stamps, recorded beside a log, as events between its own.

    ceiling/index.csv       t,file
    ceiling/000001.png      0.193,000001.png

Without an index.csv the name of each image is its stamp in seconds, such as 12.345.png; a whole
number of 16 digits or more counts nanoseconds. Rows are as `events.Image` has them: the first one
lies farthest ahead, its first pixel farthest to the left.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcloc.errors import LogError
from mcloc.events import Event, Image, Odometry, Scan
from mcloc.io.messages import Skipped
from mcloc.maps.brightness import brightness
from mcloc.textfile import TextFile

INDEX = "index.csv"
NANOSECONDS = 16  # digits from which on a whole number is a stamp in ns
SUFFIXES = (".png", ".jpg", ".jpeg", ".pgm", ".ppm", ".bmp", ".tif", ".tiff", ".webp")


@dataclass(frozen=True, eq=False)
class ImageFolder:
    """Images that are read when their turn comes. found: stamps (s) and files, in order of time.

    Raises LogError for a folder that is missing or has no images, and for an index that is wrong.
    """

    folder: Path
    found: Sequence[tuple[float, Path]]

    @classmethod
    def opened(cls, folder: str | Path) -> "ImageFolder":
        """What is in a folder; the images are not read yet."""
        path = Path(folder)
        if not path.is_dir():
            raise LogError(f"{path}: there is no such folder; give the one that holds the images")
        found = _indexed(path) if (path / INDEX).exists() else _named(path)
        if not found:
            raise LogError(
                f"{path}: no image in it has a stamp; add {INDEX} with a header t,file (s), or "
                "name each image by its stamp in seconds"
            )
        return cls(path, sorted(found))

    def among(self, events: Iterator[Event], skipped: Skipped) -> Iterator[Event]:
        """The events of a log with the images in their places: each before the first event that is
        not earlier. Counts in `skipped` those that cannot be read.

        Where a log tells odometry with its scans alone, that is passed on as events of its own.
        """
        images, wheels = self._read(skipped), False
        waiting = next(images, None)
        for event in events:
            while waiting is not None and waiting.t <= event.t:
                yield waiting
                waiting = next(images, None)
            wheels = wheels or isinstance(event, Odometry)
            yield event
            if isinstance(event, Scan) and not wheels and event.odometry is not None:
                yield Odometry(event.t, event.odometry)
        while waiting is not None:
            yield waiting
            waiting = next(images, None)

    def _read(self, skipped: Skipped) -> Iterator[Image]:
        for t, path in self.found:
            try:
                pixels = decoded(path.read_bytes())
            except (OSError, ValueError):
                skipped["image that cannot be read"] += 1
            else:
                yield Image(t, pixels)


def decoded(data: bytes) -> NDArray[np.float64]:
    """(H, W) brightness of an image in a format that Pillow reads. Raises ValueError for others."""
    from PIL import Image as Pillow

    try:
        with Pillow.open(BytesIO(data)) as image:
            return brightness(image).astype(np.float64)
    except Exception as cause:  # for damaged ones decoders raise SyntaxError, struct.error, …
        raise ValueError(f"no image: {cause}") from cause


def write_images(folder: str | Path, images: Iterator[Image]) -> int:
    """Write images as PNG of 8 bits, and their index.csv; how many they are. Raises LogError where
    nothing can be written.
    """
    from PIL import Image as Pillow

    path = Path(folder)
    rows = []
    try:
        path.mkdir(parents=True, exist_ok=True)
        for k, image in enumerate(images):
            name = f"{k:06d}.png"
            levels = np.rint(255.0 * np.nan_to_num(image.pixels)).astype(np.uint8)
            Pillow.fromarray(levels).save(path / name)
            rows.append(f"{image.t:.6f},{name}\n")
        (path / INDEX).write_text("t,file\n" + "".join(rows), encoding="utf-8")
    except OSError as cause:
        raise LogError(f"{path}: cannot be written to ({cause.strerror})") from cause
    return len(rows)


def _indexed(path: Path) -> list[tuple[float, Path]]:
    text = TextFile(str(path / INDEX), LogError)
    return [
        (text.number(line, "t", row["t"]), path / row["file"])
        for line, row in text.records(("t", "file"))
    ]


def _named(path: Path) -> list[tuple[float, Path]]:
    """Those whose names are stamps."""
    found = []
    for file in path.iterdir():
        if file.suffix.lower() not in SUFFIXES:
            continue
        try:
            t = float(file.stem)
        except ValueError:
            continue
        if file.stem.isdigit() and len(file.stem) >= NANOSECONDS:
            t *= 1e-9
        if np.isfinite(t):
            found.append((t, file))
    return found
