"""Whatever happened to the bytes of a bag, it gives finite events or a McLocError of one line."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mcloc.errors import McLocError
from mcloc.events import Odometry
from mcloc.io.bag_map import read_map
from mcloc.io.bag_truth import read_truth
from mcloc.io.log import read_log

FUZZED = [
    "ros1",
    "ros1 bz2",
    "ros1 lz4",
    "sqlite",
    "sqlite messages",
    "mcap",
    "mcap files",
    "mcap chunks",
    "independent lz4",
]


class Whole:
    """An undamaged bag: its path, its files and their contents."""

    def __init__(self, path):
        self.path = path
        self.files = [path] if path.is_file() else sorted(path.iterdir())
        self.contents = [file.read_bytes() for file in self.files]

    def __repr__(self):
        return str(self.path)  # not its bytes, where a test fails


@st.composite
def damage(draw):
    """Bytes to change, each by its place and its new value, and where to cut; places as shares."""
    share = st.floats(0.0, 1.0, exclude_max=True)
    near_an_end = st.one_of(share, share.map(lambda s: s**4), share.map(lambda s: 1.0 - s**4))
    flips = draw(st.lists(st.tuples(near_an_end, st.integers(0, 255)), max_size=6))
    return flips, draw(st.one_of(st.just(1.0), near_an_end))


def check(path):
    for event in read_log(path):
        assert np.isfinite(event.t)
        if isinstance(event, Odometry):
            assert np.isfinite(event.pose).all()
        else:
            assert len(event.ranges) == len(event.angles) > 0
            assert np.isfinite(event.angles).all()
            assert np.isfinite(event.mount).all()
            assert event.range_max > max(0.0, event.range_min)


def complaint(read, path):
    try:
        read(path)
    except McLocError as error:
        return str(error)
    return f"{path}: no complaint"


@pytest.fixture(scope="module", params=FUZZED)
def bag(request, ros, tmp_path_factory):
    header, pose = ros.header(ros.STAMP, "map"), ros.pose(1.0, 2.0, ros.yaw(0.5))
    truth = ("/truth", "geometry_msgs/msg/PoseStamped", {"header": header, "pose": pose})
    script = [truth, *ros.drive()]
    path = ros.write_bag(tmp_path_factory.mktemp("fuzz") / "drive", script, request.param)
    return Whole(path)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(damage=damage(), which=st.integers(0, 1))
def test_damaged_bags(bag, damage, which):
    flips, cut = damage
    i = which % len(bag.files)
    content = bytearray(bag.contents[i])
    for place, value in flips:
        content[min(int(place * len(content)), len(content) - 1)] = value
    try:
        bag.files[i].write_bytes(content[: int(cut * len(content))])
        for read in (check, lambda p: read_map(p, "/map"), lambda p: read_truth(p, "/truth")):
            said = complaint(read, bag.path)
            assert str(bag.path) in said
            assert len(said.splitlines()) == 1
    finally:
        bag.files[i].write_bytes(bag.contents[i])


def test_the_undamaged_bag_is_read(bag):
    """Else the fuzzing above would exercise nothing behind the first error."""
    check(bag.path)
    assert len(read_truth(bag.path, "/truth")) == 1
