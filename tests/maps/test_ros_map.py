"""ROS maps: what map_server makes of a YAML file and an image."""

import math
import os

import numpy as np
import pytest
from PIL import Image

from mcloc.errors import MapError
from mcloc.maps.files import load

YAML = "image: map.png\nresolution: 0.05\norigin: [1.0, 2.0, 0.0]\nnegate: 0\n"
YAML += "occupied_thresh: 0.65\nfree_thresh: 0.196\n"


@pytest.fixture
def read(tmp_path):
    def read(pixels, extra="", image="map.png", mode=None):
        picture = Image.fromarray(np.atleast_2d(np.asarray(pixels)))
        (picture.convert(mode) if mode else picture).save(tmp_path / image)
        path = tmp_path / "map.yaml"
        path.write_text(YAML.replace("map.png", image) + extra)
        return load(path)

    return read


def grey(*levels):
    return np.array([levels], dtype=np.uint8)


def opaque(levels, alpha):
    return np.array([[(v, v, v, a) for v, a in zip(levels, alpha, strict=True)]], dtype=np.uint8)


@pytest.mark.parametrize("image", ["map.png", "map.pgm", "map.bmp"])
def test_the_top_row_of_the_image_is_the_largest_y(read, image):
    grid = read(np.array([[254, 205], [0, 254]], dtype=np.uint8), image=image)
    assert grid.cells.tolist() == [[100, 0], [0, -1]]
    assert grid.resolution == 0.05
    assert grid.origin.tolist() == [1.0, 2.0, 0.0]
    assert grid.state_at((1.01, 2.01, 0.0)) == "occupied"


def test_the_origin_may_be_turned(read):
    grid = read(grey(0, 254), "origin: [1.0, 2.0, 1.5707963267948966]\n")
    assert grid.state_at((0.99, 2.01, 0.0)) == "occupied"
    assert grid.state_at((0.99, 2.06, 0.0)) == "free"


def test_trinary_has_three_values_for_all_256_levels(read):
    levels = np.arange(256)
    grid = read(levels.astype(np.uint8))
    p = (255 - levels) / 255
    expected = np.where(p > 0.65, 100, np.where(p < 0.196, 0, -1))
    assert grid.cells[0].tolist() == expected.tolist()
    assert grid.cells[0][[205, 206]].tolist() == [-1, 0]  # the shades about free_thresh


def test_scale_is_linear_between_the_thresholds_and_keeps_their_verdict(read):
    levels = np.arange(256)
    grid = read(levels.astype(np.uint8), "mode: scale\n")
    p = (255 - levels) / 255
    inside = (p >= 0.196) & (p <= 0.65)
    assert (grid.cells[0][p > 0.65] == 100).all()
    assert (grid.cells[0][p < 0.196] == 0).all()
    assert grid.cells[0][inside] == pytest.approx(100 * (p[inside] - 0.196) / 0.454, abs=1.0)
    assert set(grid.cells[0][inside]) <= set(range(1, 100))
    trinary = read(levels.astype(np.uint8))
    for state in ("free", "occupied", "unknown"):
        assert getattr(grid, state).tolist() == getattr(trinary, state).tolist()


def test_raw_is_the_level_itself(read):
    grid = read(np.arange(256, dtype=np.uint8), "mode: raw\n")
    assert grid.cells[0].tolist() == [*range(101)] + [-1] * 155
    assert (grid.occupied_thresh, grid.free_thresh) == (0.65, 0.196)


@pytest.mark.parametrize("negate", ["1", "true"])
def test_negate_makes_white_occupied(read, negate):
    assert read(grey(0, 127, 255), f"negate: {negate}\n").cells.tolist() == [[0, -1, 100]]
    assert read(grey(0, 50, 101), f"negate: {negate}\nmode: raw\n").cells.tolist() == [[0, 50, -1]]


@pytest.mark.parametrize("image", ["map.png", "map.pgm"])
def test_sixteen_bits(read, image):
    levels = np.array([0, 205 * 257, 254 * 257, 65535, 30 * 257], dtype=np.uint16)
    assert read(levels, image=image).cells.tolist() == [[100, -1, 0, 0, 100]]
    assert read(levels, "mode: raw\n", image).cells.tolist() == [[0, -1, -1, -1, 30]]


def test_colours_are_averaged(read):
    pixels = np.array([[(255, 255, 252), (0, 30, 0), (255, 0, 255)]], dtype=np.uint8)
    assert read(pixels).cells.tolist() == [[0, 100, -1]]


def test_a_palette_is_looked_up(read):
    assert read(grey(0, 205, 254), mode="P").cells.tolist() == [[100, -1, 0]]


def test_black_and_white(read):
    assert read(grey(0, 255), mode="1").cells.tolist() == [[100, 0]]


@pytest.mark.parametrize("mode", ["RGBA", "LA"])
def test_alpha_is_averaged_in_in_trinary_and_is_unknown_in_scale(read, mode):
    pixels = opaque([0, 254, 0, 254], [255, 255, 0, 0])
    # p of opaque black: 1 − (3·0 + 255)/1020 = 0.75; of transparent white: 1 − 3·254/1020 = 0.25
    assert read(pixels, mode=mode).cells.tolist() == [[100, 0, 100, -1]]
    assert read(pixels, "mode: scale\n", mode=mode).cells.tolist() == [[100, 0, -1, -1]]
    assert read(opaque([30], [0]), "mode: raw\n", mode=mode).cells.tolist() == [[30]]


def test_a_pgm_of_few_levels_is_stretched_to_white(tmp_path):
    (tmp_path / "map.pgm").write_bytes(b"P2\n# by hand\n3 1\n4\n0 3 4\n")
    (tmp_path / "map.yaml").write_text(YAML.replace("png", "pgm"))
    assert load(tmp_path / "map.yaml").cells.tolist() == [[100, -1, 0]]


def test_numbers_as_ros_writes_them(read):
    grid = read(grey(0), "resolution: 5e-2\norigin: [-1e1, 2, .5]\nfree_thresh: 1e-1\n")
    assert grid.resolution == 0.05
    assert grid.origin.tolist() == [-10.0, 2.0, 0.5]
    assert grid.free_thresh == 0.1


def test_thresholds_and_negate_have_the_defaults_of_ros(tmp_path):
    Image.fromarray(grey(0, 205, 254)).save(tmp_path / "map.png")
    (tmp_path / "map.yaml").write_text("image: map.png\nresolution: 1\norigin: [0, 0, 0]\n")
    assert load(tmp_path / "map.yaml").cells.tolist() == [[100, -1, 0]]


def test_an_image_elsewhere(tmp_path):
    Image.fromarray(grey(0, 254)).save(tmp_path / "away.png")
    (tmp_path / "maps").mkdir()
    for name in ("../away.png", str(tmp_path / "away.png")):
        (tmp_path / "maps" / "map.yaml").write_text(YAML.replace("map.png", name))
        assert load(tmp_path / "maps" / "map.yaml").cells.tolist() == [[100, 0]]


@pytest.mark.parametrize(
    ("field", "value", "reason"),
    [
        ("resolution", None, "has no resolution"),
        ("resolution", "0", "resolution must be from"),
        ("resolution", "-0.05", "resolution must be from"),
        ("resolution", "nan", "resolution must be from"),
        ("resolution", "fine", "resolution must be a number, got 'fine'"),
        ("resolution", "[1]", "resolution must be a number"),
        ("image", None, "has no image"),
        ("image", "''", "has no image"),
        ("image", "[map.png]", "has no image"),
        ("image", "other.png", "other.png is missing"),
        ("image", ".", "is missing"),
        ("image", '"a\\0b.png"', "is missing"),
        ("origin", None, "origin must be"),
        ("origin", "[0, 0]", "origin must be"),
        ("origin", "[0, 0, north]", "origin must be"),
        ("origin", "[0, 0, nan]", "origin must be"),
        ("origin", "0", "origin must be"),
        ("origin", "{x: 1}", "origin must be"),
        ("mode", "colour", "mode must be one of trinary, scale, raw, got 'colour'"),
        ("mode", "[raw]", "mode must be one of"),
        ("negate", "maybe", "negate must be 0 or 1"),
        ("free_thresh", "0.7", "free_thresh < occupied_thresh"),
        ("occupied_thresh", "high", "occupied_thresh must be a number"),
    ],
)
@pytest.mark.parametrize("mode", ["trinary", "scale"])
def test_a_field_that_cannot_be_used_is_named(tmp_path, field, value, reason, mode):
    Image.fromarray(grey(0, 254)).save(tmp_path / "map.png")
    lines = [line for line in [*YAML.splitlines(), f"mode: {mode}"] if not line.startswith(field)]
    if value is not None:
        lines.append(f"{field}: {value}")
    (tmp_path / "map.yaml").write_text("\n".join(lines))
    with pytest.raises(MapError, match=r"map\.yaml") as raised:
        load(tmp_path / "map.yaml")
    assert reason in str(raised.value)


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        ("- a\n- list\n", "YAML mapping"),
        ("word", "YAML mapping"),
        ("# comment", "YAML mapping"),
        ("image: [", "not YAML"),
        ("a: b: c", "not YAML"),
        ("image: \x01", "not YAML"),
        ("[" * 5000, "nested too deeply"),
        ("? [1]\n: 2\n", "not YAML"),
    ],
)
def test_what_is_no_mapping(tmp_path, content, reason):
    (tmp_path / "map.yaml").write_text(content)
    with pytest.raises(MapError, match=reason) as raised:
        load(tmp_path / "map.yaml")
    assert "\n" not in str(raised.value)


def whole(tmp_path, kind):
    Image.fromarray(np.zeros((50, 40), dtype=np.uint8)).save(tmp_path / f"whole.{kind}")
    return (tmp_path / f"whole.{kind}").read_bytes()


@pytest.mark.parametrize("kind", ["png", "pgm"])
@pytest.mark.parametrize("kept", [0.0, 0.05, 0.5])
def test_a_broken_image(tmp_path, kind, kept):
    content = whole(tmp_path, kind)
    (tmp_path / "map.png").write_bytes(content[: int(kept * len(content))])
    (tmp_path / "map.yaml").write_text(YAML)
    with pytest.raises(MapError, match=r"map\.yaml: its image .*map\.png cannot be read"):
        load(tmp_path / "map.yaml")


def test_an_image_of_another_kind(tmp_path):
    for name, content in {"gif": b"GIF89a", "eps": b"%!PS-Adobe-3.0 EPSF-3.0\n"}.items():
        (tmp_path / "map.png").write_bytes(content * 20)
        (tmp_path / "map.yaml").write_text(YAML)
        with pytest.raises(MapError, match="cannot be read"):
            load(tmp_path / "map.yaml"), name


def test_a_pipe_instead_of_an_image_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "map.png")
    (tmp_path / "map.yaml").write_text(YAML)
    with pytest.raises(MapError, match="missing"):
        load(tmp_path / "map.yaml")


@pytest.mark.parametrize(
    "side", [9500, 15000]
)  # over Pillow's limits for its warning and its error
def test_an_image_that_would_fill_the_memory(tmp_path, side):
    (tmp_path / "map.png").write_bytes(b"P5\n%d %d\n255\n" % (side, side))
    (tmp_path / "map.yaml").write_text(YAML)
    with pytest.raises(MapError, match="pixels"):
        load(tmp_path / "map.yaml")


def test_a_large_map(tmp_path):
    width, height = 10_000, 7_000
    with (tmp_path / "map.png").open("wb") as file:
        file.write(b"P5\n%d %d\n255\n" % (width, height))
        file.truncate(file.tell() + width * height)
    (tmp_path / "map.yaml").write_text(YAML)
    grid = load(tmp_path / "map.yaml")
    assert grid.cells.shape == (height, width)
    assert math.prod(grid.cells.shape) == np.count_nonzero(grid.cells == 100)
