"""sensor_msgs/Image and sensor_msgs/CompressedImage → Image, as brightness."""

import numpy as np
from numpy.typing import NDArray

from mcloc.events import Image
from mcloc.io.bag import Message
from mcloc.io.bag_messages import COMPRESSED_IMAGE, seconds
from mcloc.io.images import decoded
from mcloc.maps.brightness import of_colours

Reals = NDArray[np.float64]

GREY = {"mono8": 1, "8uc1": 1, "mono16": 2, "16uc1": 2}
"""Bytes a pixel."""

COLOURS = {
    "rgb8": (0, 1, 2),
    "bgr8": (2, 1, 0),
    "8uc3": (2, 1, 0),
    "rgba8": (0, 1, 2),
    "bgra8": (2, 1, 0),
}
"""Which channels are red, green and blue."""


def image_of(topic: str, kind: str, message: Message) -> Image | str:
    """The event, or why there is none."""
    t = seconds(message)
    if t is None:
        return "stamp not set"
    if kind == COMPRESSED_IMAGE:
        try:
            pixels = decoded(bytes(message.data))
        except ValueError:
            return "image that cannot be read"
    else:
        told = _raw(message)
        if isinstance(told, str):
            return told
        pixels = told
    return Image(t, pixels, source=topic)


def _raw(message: Message) -> Reals | str:
    """(H, W) of an Image, or why there is none."""
    encoding = str(message.encoding).lower()
    height, width, step = int(message.height), int(message.width), int(message.step)
    each = GREY.get(encoding, 4 if encoding.endswith("a8") else 3)
    if encoding not in GREY and encoding not in COLOURS:
        return f"image of encoding {encoding or 'none'}"
    data = np.frombuffer(bytes(message.data), dtype=np.uint8)
    if min(height, width) < 1 or step < each * width or len(data) < step * height:
        return "image without all of its pixels"
    rows = data[: step * height].reshape(height, step)[:, : each * width]
    if encoding in COLOURS:
        channels = rows.reshape(height, width, each)[..., COLOURS[encoding]]
        return of_colours(channels).astype(np.float64)
    if each == 1:
        return rows / 255.0
    words = np.ascontiguousarray(rows).view(">u2" if message.is_bigendian else "<u2")
    return words / 65535.0
