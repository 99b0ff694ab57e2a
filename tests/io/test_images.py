"""Folders of images beside a log."""

from collections import Counter

import numpy as np
import pytest
from PIL import Image as Pillow

from mcloc.errors import LogError
from mcloc.events import Image, Odometry, Scan
from mcloc.io.images import ImageFolder, write_images


def save(path, level=100, size=(6, 4)):
    Pillow.fromarray(np.full(size, level, dtype=np.uint8)).save(path)


def odometry(*stamps):
    return iter([Odometry(t, np.array([t, 0.0, 0.0])) for t in stamps])


def told(folder, *stamps):
    skipped = Counter()
    events = list(ImageFolder.opened(folder).among(odometry(*stamps), skipped))
    return [(type(e).__name__, e.t) for e in events], skipped


def test_images_of_an_index_come_before_the_first_later_event(tmp_path):
    for name in ("a", "b", "c"):
        save(tmp_path / f"{name}.png")
    (tmp_path / "index.csv").write_text("t,file\n2.5,b.png\n1.0,a.png\n9.0,c.png\n")
    found, skipped = told(tmp_path, 0.0, 1.0, 2.0, 3.0)
    assert found == [
        ("Odometry", 0.0),
        ("Image", 1.0),
        ("Odometry", 1.0),
        ("Odometry", 2.0),
        ("Image", 2.5),
        ("Odometry", 3.0),
        ("Image", 9.0),
    ]
    assert not skipped


def test_names_are_stamps_where_there_is_no_index(tmp_path):
    for name in ("1.5.png", "1700000000500000000.jpg", "0.25.png", "notes.png"):
        save(tmp_path / name)
    (tmp_path / "3.0.txt").write_text("no image")
    found, _ = told(tmp_path)
    assert [t for _, t in found] == pytest.approx([0.25, 1.5, 1_700_000_000.5])


def test_pixels_are_brightness_with_the_first_row_first(tmp_path):
    levels = np.arange(12, dtype=np.uint8).reshape(3, 4) * 20
    Pillow.fromarray(levels).save(tmp_path / "1.0.png")
    (image,) = ImageFolder.opened(tmp_path).among(odometry(), Counter())
    assert image.pixels == pytest.approx(levels / 255.0, abs=1e-6)
    assert image.pixels.dtype == np.float64


def test_damaged_and_missing_images_are_counted_and_the_rest_goes_on(tmp_path):
    save(tmp_path / "a.png")
    (tmp_path / "b.png").write_bytes(b"\x89PNG nothing")
    (tmp_path / "index.csv").write_text("t,file\n1,a.png\n2,b.png\n3,none.png\n4,a.png\n")
    found, skipped = told(tmp_path)
    assert [t for _, t in found] == [1.0, 4.0]
    assert skipped == {"image that cannot be read": 2}


def test_odometry_that_comes_with_scans_alone_is_told(tmp_path):
    save(tmp_path / "1.5.png")
    scans = [
        Scan(t, np.ones(3), np.zeros(3), 8.0, odometry=np.array([t, 0.0, 0.0])) for t in (1.0, 2.0)
    ]
    events = list(ImageFolder.opened(tmp_path).among(iter(scans), Counter()))
    assert [type(e).__name__ for e in events] == ["Scan", "Odometry", "Image", "Scan", "Odometry"]


@pytest.mark.parametrize(
    ("index", "match"),
    [
        ("t,name\n1,a.png\n", "lacks file"),
        ("t,file\nsoon,a.png\n", "line 2: t must be a finite number"),
        ("t,file\n", "no image in it has a stamp"),
    ],
)
def test_a_wrong_index_is_refused_with_its_line(tmp_path, index, match):
    (tmp_path / "index.csv").write_text(index)
    with pytest.raises(LogError, match=match):
        ImageFolder.opened(tmp_path)


def test_no_folder_and_an_empty_one_are_refused(tmp_path):
    with pytest.raises(LogError, match="no such folder"):
        ImageFolder.opened(tmp_path / "none")
    with pytest.raises(LogError, match="no image in it has a stamp"):
        ImageFolder.opened(tmp_path)


def test_images_that_were_written_are_read(tmp_path):
    rng = np.random.default_rng(0)
    images = [Image(0.5 * k, rng.random((5, 5))) for k in range(3)]
    assert write_images(tmp_path / "new" / "images", iter(images)) == 3
    found = list(ImageFolder.opened(tmp_path / "new" / "images").among(odometry(), Counter()))
    for one, other in zip(images, found, strict=True):
        assert other.t == one.t
        assert other.pixels == pytest.approx(one.pixels, abs=0.5 / 255 + 1e-6)
    (tmp_path / "file").write_text("")
    with pytest.raises(LogError, match="cannot be written"):
        write_images(tmp_path / "file", iter(images))
