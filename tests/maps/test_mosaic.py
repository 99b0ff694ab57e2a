"""Mosaics: look-ups against SciPy, patches against plain NumPy, files against what was written."""

import numpy as np
import pytest
import yaml
from PIL import Image as Pillow
from scipy.ndimage import map_coordinates

from mcloc.errors import MapError
from mcloc.filters.catalog import Composition
from mcloc.geometry import between, compose
from mcloc.kernels import jit
from mcloc.maps.mosaic import Mosaic
from mcloc.maps.occupancy import FREE, OccupancyGrid

ORIGIN = np.array([-3.0, 2.0, 0.7])


def mosaic(origin=ORIGIN, holes=True, seed=0):
    rng = np.random.default_rng(seed)
    image = rng.random((40, 60)).astype(np.float32)
    if holes:
        image[10:14, 20:30] = np.nan
    return Mosaic(image, 0.1, origin, name="test")


def places(n=2000, seed=1):
    """On and around the mosaic."""
    local = np.random.default_rng(seed).uniform((-0.5, -0.5, -3.0), (6.5, 4.5, 3.0), (n, 3))
    return np.ascontiguousarray(compose(ORIGIN, local).T)


def test_brightness_is_that_of_scipy_and_nan_where_a_pixel_is_unknown():
    m, x = mosaic(), places()
    local = between(m.origin, x.T)
    at = np.stack([local[:, 1], local[:, 0]]) / m.resolution - 0.5
    expected = map_coordinates(
        m.image.astype(np.float64), at, order=1, mode="constant", cval=np.nan
    )
    found = m.at(x)
    inside = (at >= 0).all(axis=0) & (at[0] <= 39) & (at[1] <= 59)
    known = inside & np.isfinite(expected)
    assert known.sum() > 1000
    assert found[known] == pytest.approx(expected[known], abs=1e-5)
    assert np.isnan(found[~inside]).all()
    assert np.isnan(found[inside & np.isnan(expected)]).all()
    assert np.isnan(expected[inside]).any()


def plain_match(m, x, points, pattern):
    """The same with NumPy, a pose at a time."""
    dots, squares = [], []
    for pose in x.T:
        at = compose(pose, np.column_stack([points.T, np.zeros(len(points.T))]))
        seen = m.at(np.ascontiguousarray(at.T))
        known = np.isfinite(seen)
        d = np.where(known, seen - seen[known].mean(), 0.0) if known.any() else np.zeros(len(seen))
        dots.append(pattern @ d)
        squares.append(d @ d)
    return np.array(dots), np.array(squares)


def test_a_patch_is_matched_as_by_plain_numpy():
    m, x = mosaic(), places(300)
    rng = np.random.default_rng(2)
    points, pattern = rng.uniform(-0.5, 0.5, (2, 11)), rng.standard_normal(11)
    pattern -= pattern.mean()
    dots, squares = m.match(x, points, pattern)
    expected = plain_match(m, x, points, pattern)
    assert dots == pytest.approx(expected[0], abs=1e-5)
    assert squares == pytest.approx(expected[1], abs=1e-5)
    assert (squares == 0.0).any()  # poses off the mosaic
    assert (squares >= 0.0).all()


def test_a_mosaic_does_not_depend_on_threads():
    m, x = mosaic(), places(40_000)
    points, pattern = np.zeros((2, 3)), np.array([1.0, -1.0, 0.0])
    before, found = jit._threads, []
    try:
        for threads in (1, 2):
            jit.set_threads(threads)
            found.append((m.at(x).tobytes(), *(v.tobytes() for v in m.match(x, points, pattern))))
    finally:
        jit.set_threads(before)
    assert found[0] == found[1]


def test_no_place_is_too_odd():
    odd = [np.nan, np.inf, -np.inf, 1e300, -1e300, 1e18, 0.0]
    x = np.array(np.meshgrid(odd, odd, odd)).reshape(3, -1)
    with np.errstate(all="ignore"):
        found = mosaic().at(x)
        dots, squares = mosaic().match(x, np.zeros((2, 2)), np.array([1.0, -1.0]))
    assert (np.isnan(found) | (found >= 0.0)).all()
    assert np.isfinite(dots).all()
    assert np.isfinite(squares).all()


def test_an_average_is_that_of_the_known_pixels_of_a_disc():
    m, radius = mosaic(), 0.25
    averaged = m.averaged(radius)
    known = np.isfinite(m.image)
    assert np.array_equal(np.isfinite(averaged.image), known)
    rows, columns = np.indices(m.image.shape)
    for row, column in ((0, 0), (5, 5), (9, 22), (39, 59), (20, 30)):
        near = (np.hypot(rows - row, columns - column) * m.resolution <= radius) & known
        assert averaged.image[row, column] == pytest.approx(m.image[near].mean(), abs=1e-5)
    assert m.averaged(0.05) is m


@pytest.mark.parametrize("holes", [False, True])
def test_a_mosaic_that_was_written_is_read(tmp_path, holes):
    m = mosaic(holes=holes)
    m.save(tmp_path / "ceiling.yaml")
    read = Mosaic.load(tmp_path / "ceiling.yaml")
    assert np.array_equal(np.isfinite(read.image), np.isfinite(m.image))
    off = 0.5 / (255 if holes else 65535) + 1e-6
    assert np.nanmax(np.abs(read.image - m.image)) <= off
    assert read.origin == pytest.approx(m.origin)
    assert read.resolution == m.resolution
    assert read.checksum != m.checksum  # it was rounded
    assert read.checksum == Mosaic.load(tmp_path / "ceiling.yaml").checksum


@pytest.mark.parametrize("suffix", ["png", "jpg", "bmp", "tif", "pgm"])
def test_any_image_is_read_with_its_first_row_on_top(tmp_path, suffix):
    levels = np.zeros((20, 30), dtype=np.uint8)
    levels[:10] = 200
    Pillow.fromarray(levels).save(tmp_path / f"c.{suffix}")
    read = Mosaic.load(tmp_path / f"c.{suffix}", 0.2, [1.0, 2.0, 0.0])
    assert read.image[-1].mean() == pytest.approx(200 / 255, abs=0.02)
    assert read.image[0].mean() == pytest.approx(0.0, abs=0.02)
    assert read.at(np.array([[1.5], [5.5]])) == pytest.approx(200 / 255, abs=0.02)


def test_colours_count_by_luma_and_dark_pixels_may_be_unknown(tmp_path):
    colours = np.zeros((4, 4, 3), dtype=np.uint8)
    colours[:2] = (255, 0, 0)
    colours[2:, :2] = (1, 1, 1)
    colours[2:, 2:] = (255, 255, 255)
    Pillow.fromarray(colours).save(tmp_path / "c.png")
    fields = {"image": "c.png", "resolution": 0.1, "origin": [0, 0, 0], "unknown_below": 0.02}
    (tmp_path / "c.yaml").write_text(yaml.safe_dump(fields))
    read = Mosaic.load(tmp_path / "c.yaml").image
    assert read[2:] == pytest.approx(0.299, abs=1e-3)
    assert np.isnan(read[:2, :2]).all()
    assert read[:2, 2:] == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("image", "resolution", "origin", "told"),
    [
        (np.zeros((1, 5)), 0.1, np.zeros(3), "at least 2 × 2"),
        (np.full((4, 4), np.nan), 0.1, np.zeros(3), "no pixel is known"),
        (np.full((4, 4), 200.0), 0.1, np.zeros(3), "divide by the value of white"),
        (np.zeros((4, 4)), 0.0, np.zeros(3), "resolution"),
        (np.zeros((4, 4)), 0.1, np.zeros(2), "origin"),
        (np.zeros((4, 4)), 0.1, np.array([0.0, np.nan, 0.0]), "origin"),
    ],
)
def test_what_is_no_mosaic_is_refused(image, resolution, origin, told):
    with pytest.raises(MapError, match=told):
        Mosaic(image, resolution, origin)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("resolution: 0.1\norigin: [0, 0, 0]\n", "has no image"),
        ("image: none.png\nresolution: 0.1\norigin: [0, 0, 0]\n", "no image"),
        ("image: broken.png\nresolution: 0.1\norigin: [0, 0, 0]\n", "cannot be read"),
        ("image: c.png\norigin: [0, 0, 0]\n", "resolution"),
        ("image: c.png\nresolution: 0.1\n", "origin"),
        ("image: c.png\nresolution: 0.1\norigin: [0, 0]\n", "origin"),
    ],
)
def test_a_file_that_is_wrong_is_told_apart(tmp_path, text, told):
    (tmp_path / "broken.png").write_bytes(b"\x89PNG no")
    Pillow.fromarray(np.zeros((4, 4), dtype=np.uint8)).save(tmp_path / "c.png")
    (tmp_path / "c.yaml").write_text(text)
    with pytest.raises(MapError, match=told):
        Mosaic.load(tmp_path / "c.yaml")


def test_an_image_alone_is_refused_and_so_is_a_name_without_yaml(tmp_path):
    Pillow.fromarray(np.zeros((4, 4), dtype=np.uint8)).save(tmp_path / "c.png")
    with pytest.raises(MapError, match="does not say where it lies"):
        Mosaic.load(tmp_path / "c.png")
    with pytest.raises(MapError, match="must end in"):
        mosaic().save(tmp_path / "c.png")
    with pytest.raises(MapError, match="cannot be written"):
        mosaic().save(tmp_path / "nowhere" / "c.yaml")


def test_pixels_of_32_bits_are_read_where_white_is_1_and_refused_elsewhere(tmp_path):
    levels = np.tile(np.linspace(0.0, 1.0, 8, dtype=np.float32), (8, 1))
    Pillow.fromarray(levels).save(tmp_path / "f.tif")
    read = Mosaic.load(tmp_path / "f.tif", 0.1, [0, 0, 0]).image
    assert read == pytest.approx(levels)
    Pillow.fromarray(255.0 * levels).save(tmp_path / "f.tif")
    with pytest.raises(MapError, match="not 0 to 1"):
        Mosaic.load(tmp_path / "f.tif", 0.1, [0, 0, 0])
    Pillow.fromarray((255 * levels).astype(np.int32)).save(tmp_path / "i.tif")
    with pytest.raises(MapError, match="8 or 16"):
        Mosaic.load(tmp_path / "i.tif", 0.1, [0, 0, 0])
    Pillow.fromarray((65535 * levels).astype(np.uint16)).save(tmp_path / "i.png")
    assert Mosaic.load(tmp_path / "i.png", 0.1, [0, 0, 0]).image == pytest.approx(levels, abs=1e-4)


def test_a_mosaic_that_lies_above_no_floor_is_refused():
    grid = OccupancyGrid(np.full((40, 50), FREE, dtype=np.int8), 0.1, np.array([1.0, 2.0, 0.3]))
    image = np.random.default_rng(0).random((60, 60))
    near, far = (Mosaic(image, 0.05, np.array([x, 2.0, 0.3]), name="sky") for x in (3.0, 500.0))
    assert near.covers(grid)
    assert not far.covers(grid)
    Composition(camera="ceiling-brightness").build(grid, near)
    with pytest.raises(MapError, match="sky: the mosaic lies above no free cell"):
        Composition(camera="ceiling-brightness").build(grid, far)
