"""Whatever the bytes of a map, it is read or a MapError says why, in one or two lines."""

import gzip
import io

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from mcloc.errors import MapError
from mcloc.maps.files import load

WEAN = b"robot_specifications->resolution 10\nglobal_map[0]: 2 3\n-1 1 0\n0.9 0.7 0.3\n"
YAML = b"""image: map.img
mode: scale
resolution: 0.05
origin: [1.0, -2.0, 0.3]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.196
"""


RNG = np.random.default_rng(1)
COLOURS = Image.fromarray(RNG.integers(0, 256, (6, 5, 4), dtype=np.uint8))
DEEP = Image.fromarray(RNG.integers(0, 65536, (6, 5), dtype=np.uint16))


def encoded(image, kind):
    file = io.BytesIO()
    image.save(file, kind)
    return file.getvalue()


IMAGES = [encoded(COLOURS.convert(mode), kind) for mode in ("L", "1") for kind in ("PPM", "BMP")]
IMAGES += [encoded(COLOURS.convert(mode), "PNG") for mode in ("L", "LA", "RGBA", "P")]
IMAGES += [encoded(DEEP, kind) for kind in ("PPM", "PNG")]


@st.composite
def damaged(draw, whole):
    content = bytearray(whole)
    for _ in range(draw(st.integers(0, 4))):
        content[draw(st.integers(0, len(content) - 1))] = draw(st.integers(0, 255))
    if draw(st.booleans()):
        content = content[: draw(st.integers(0, len(content)))]
    return bytes(content)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("fuzz")


def complaint(path):
    try:
        grid = load(path)
    except MapError as error:
        return str(error)
    assert (grid.free.astype(int) + grid.occupied + grid.unknown == 1).all()
    return f"{path}: no complaint"


def loads_or_says_why(path):
    said = complaint(path)
    assert str(path) in said
    assert len(said.splitlines()) <= 2


@settings(max_examples=200, deadline=None)
@given(st.one_of(damaged(WEAN), damaged(WEAN).map(gzip.compress), damaged(gzip.compress(WEAN))))
def test_wean_maps(folder, content):
    (folder / "wean.dat").write_bytes(content)
    loads_or_says_why(folder / "wean.dat")


@settings(max_examples=300, deadline=None)
@given(st.one_of(damaged(YAML), st.binary(max_size=200), st.text(max_size=200).map(str.encode)))
def test_ros_yaml(folder, content):
    (folder / "map.img").write_bytes(IMAGES[0])
    (folder / "map.yaml").write_bytes(content)
    loads_or_says_why(folder / "map.yaml")


@settings(max_examples=300, deadline=None)
@given(st.sampled_from(IMAGES).flatmap(damaged), st.sampled_from([b"trinary", b"scale", b"raw"]))
def test_ros_images(folder, image, mode):
    (folder / "map.img").write_bytes(image)
    (folder / "map.yaml").write_bytes(YAML.replace(b"scale", mode))
    loads_or_says_why(folder / "map.yaml")


def test_the_undamaged_maps_are_read(folder):
    """Else the fuzzing above would exercise the errors of one line only."""
    (folder / "wean.dat").write_bytes(WEAN)
    load(folder / "wean.dat")
    for image in IMAGES:
        (folder / "map.img").write_bytes(image)
        (folder / "map.yaml").write_bytes(YAML)
        load(folder / "map.yaml")
