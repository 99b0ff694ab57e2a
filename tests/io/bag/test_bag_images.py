"""Images and compressed images of a bag, against what was put into them."""

from io import BytesIO

import numpy as np
import pytest
from PIL import Image as Pillow

from mcloc.errors import ConfigError, LogError
from mcloc.events import Image, Odometry, Scan
from mcloc.io.log import read_log

LEVELS = np.arange(12, dtype=np.uint8).reshape(3, 4) * 20


def raw(ros, t, encoding, table, *, pad=0, big=0, topic="/ceiling"):
    """A sensor_msgs/Image of a table (H, W) or (H, W, C), its rows with `pad` bytes more."""
    rows = np.ascontiguousarray(table).view(np.uint8).reshape(len(table), -1)
    data = np.pad(rows, ((0, 0), (0, pad)))
    fields = {
        "header": ros.header(t, "camera"),
        "height": len(table),
        "width": table.shape[1],
        "encoding": encoding,
        "is_bigendian": big,
        "step": data.shape[1],
        "data": data.ravel(),
    }
    return topic, "sensor_msgs/msg/Image", fields


def compressed(ros, t, data, kind="png", topic="/ceiling"):
    fields = {
        "header": ros.header(t, "camera"),
        "format": kind,
        "data": np.frombuffer(data, dtype=np.uint8),
    }
    return topic, "sensor_msgs/msg/CompressedImage", fields


def encoded(table, kind):
    stream = BytesIO()
    Pillow.fromarray(table).save(stream, kind, **({"quality": 98} if kind == "JPEG" else {}))
    return stream.getvalue()


def images(write, script, kind="mcap", **topics):
    log = read_log(write(script, kind), topics={"image": "/ceiling", **topics})
    return [e for e in log if isinstance(e, Image)], log.skipped


COLOURS = np.zeros((3, 4, 3), dtype=np.uint8)
COLOURS[..., 0], COLOURS[..., 1] = LEVELS, 30
LUMA = (0.299 * COLOURS[..., 0] + 0.587 * 30) / 255.0
ALPHA = np.full((3, 4, 1), 9, dtype=np.uint8)
WORDS = (LEVELS.astype(np.uint16) * 257).astype("<u2")


@pytest.mark.parametrize(
    ("encoding", "table", "options", "expected"),
    [
        ("mono8", LEVELS, {}, LEVELS / 255.0),
        ("mono8", LEVELS, {"pad": 5}, LEVELS / 255.0),
        ("8UC1", LEVELS, {}, LEVELS / 255.0),
        ("mono16", WORDS, {}, LEVELS / 255.0),
        ("16UC1", WORDS.astype(">u2"), {"big": 1}, LEVELS / 255.0),
        ("rgb8", COLOURS, {}, LUMA),
        ("bgr8", COLOURS[..., ::-1], {"pad": 2}, LUMA),
        ("rgba8", np.concatenate([COLOURS, ALPHA], axis=2), {}, LUMA),
        ("bgra8", np.concatenate([COLOURS[..., ::-1], ALPHA], axis=2), {}, LUMA),
    ],
)
def test_pixels_are_brightness_by_encoding(ros, write, encoding, table, options, expected):
    t = ros.STAMP + 0.5
    script = [ros.odometry(t), raw(ros, t, encoding, table, **options)]
    (image,), skipped = images(write, script)
    assert image.pixels == pytest.approx(expected, abs=1e-6)
    assert (image.t, image.source) == (pytest.approx(t), "/ceiling")
    assert not skipped


@pytest.mark.parametrize(("kind", "off"), [("PNG", 1e-6), ("JPEG", 0.03)])
def test_compressed_images_are_decoded_in_every_kind_of_bag(ros, write, kind, off):
    for bag in ("mcap", "sqlite", "ros1"):
        script = [ros.odometry(ros.STAMP), compressed(ros, ros.STAMP, encoded(LEVELS, kind))]
        log = read_log(write(script, bag, name=bag), topics={"image": "/ceiling"})
        (image,) = (e for e in log if isinstance(e, Image))
        assert image.pixels == pytest.approx(LEVELS / 255.0, abs=off)


def test_what_is_no_image_is_counted(ros, write):
    t = ros.STAMP
    good = raw(ros, t + 3, "mono8", LEVELS)
    short = raw(ros, t + 1, "mono8", LEVELS)
    short[2]["data"] = short[2]["data"][:-1]
    narrow = raw(ros, t + 1, "mono8", LEVELS)
    narrow[2]["step"] = 2
    unset = raw(ros, 0, "mono8", LEVELS)
    script = [ros.odometry(t), short, narrow, unset, raw(ros, t, "bayer_rggb8", LEVELS), good]
    found, skipped = images(write, script)
    assert len(found) == 1
    assert skipped == {
        "image without all of its pixels": 2,
        "stamp not set": 1,
        "image of encoding bayer_rggb8": 1,
    }
    script = [
        ros.odometry(t),
        compressed(ros, t, b"nothing"),
        compressed(ros, t, encoded(LEVELS, "PNG")),
    ]
    log = read_log(write(script, name="other"), topics={"image": "/ceiling"})
    assert len([e for e in log if isinstance(e, Image)]) == 1
    assert log.skipped == {"image that cannot be read": 1}


def test_images_come_with_scans_and_only_where_they_are_asked_for(ros, write):
    path = write([*ros.drive(3), raw(ros, ros.STAMP + 1, "mono8", LEVELS)])
    without = list(read_log(path))
    assert not any(isinstance(e, Image) for e in without)
    both = list(read_log(path, topics={"image": "/ceiling"}))
    assert sum(isinstance(e, Scan) for e in both) == 3
    assert sum(isinstance(e, Image) for e in both) == 1
    assert sum(isinstance(e, Odometry) for e in both) == 3


def test_a_topic_that_is_no_camera_is_refused(ros, write):
    path = write([*ros.drive(2), raw(ros, ros.STAMP + 1, "mono8", LEVELS)])
    with pytest.raises(ConfigError, match="not sensor_msgs/Image or sensor_msgs/CompressedImage"):
        read_log(path, topics={"image": "/scan"})
    path = write([ros.odometry(1.0), raw(ros, 1.0, "mono8", LEVELS)], name="other")
    with pytest.raises(LogError, match="holds no sensor_msgs/LaserScan"):
        read_log(path)
