"""Images as tables of brightness, 0 black … 1 white."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from PIL import Image

LUMA = np.array([0.299, 0.587, 0.114], dtype=np.float32)  # of red, green, blue: ITU-R BT.601


def brightness(image: "Image.Image") -> NDArray[np.float32]:
    """(H, W): row 0 at the top; NaN where a pixel is transparent. Raises ValueError for pixels of
    32 bits, of which nobody knows which one is white, but for numbers from 0 to 1; whatever
    decoders raise comes through.
    """
    if image.mode.startswith("I;16") or (image.mode == "I" and image.format == "PNG"):
        return np.asarray(image).astype(np.float32) / np.float32(65535.0)
    if image.mode == "F":
        told = np.asarray(image).astype(np.float32)
        known = told[np.isfinite(told)]
        if known.size and not (known.min() >= 0.0 and known.max() <= 1.0):
            raise ValueError(f"numbers from {known.min():g} to {known.max():g}, not 0 to 1")
        return told
    if image.mode == "I":
        raise ValueError("pixels of 32 bits; save it with 8 or 16")
    if image.mode in ("1", "L") and not image.has_transparency_data:
        return np.asarray(image.convert("L")).astype(np.float32) / np.float32(255.0)
    channels = np.asarray(image.convert("RGBA"))
    table = of_colours(channels[..., :3])
    table[channels[..., 3] < 128] = np.nan
    return table


def of_colours(channels: NDArray[np.uint8]) -> NDArray[np.float32]:
    """(H, W) of red, green and blue, (H, W, 3)."""
    table: NDArray[np.float32] = channels.astype(np.float32) @ (LUMA / np.float32(255.0))
    return np.minimum(table, np.float32(1.0))  # a sum may be rounded up
