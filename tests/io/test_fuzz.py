"""Whatever the bytes, readers give finite events or a McLocError with one or two lines."""

import gzip

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mcloc.errors import McLocError
from mcloc.events import Odometry
from mcloc.io.log import read_log
from mcloc.io.tum import read_trajectory

CARMEN = b"""# CARMEN Logfile, FLASER
PARAM robot_frontlaser_offset 0.18 nohost 0
ODOM 1 2 3 0.4 0.5 0.6 7.25 host 0.1
FLASER 3 1.0 2.0 81.91 0.1 0 0 0 0 0 1.5 host 1.6
SYNC a
ROBOTLASER1 0 -0.5 3.14 0.25 30 0.01 0 2 1.5 2.5 1 7 1.2 2 0 1 2 0 0.1 0 0.5 0.4 1e6 2.5 host 2
RLASER 2 1.0 2.0 0 0 0 0 0 0 3.5 host 3.6
"""
WEAN = b"O 94.2 -13.9 -1.3 0.02\nL 94.2 -13.9 -1.3 88.5 -16.4 -1.3" + b" 66" * 180 + b" 0.05\n"
CSV = b"t,x,y,theta,share\n0.5,1,2,3,1\n1.5,2,3,4,0.5\n"
TUM = b"# t x y z qx qy qz qw\n0.5 1 2 0 0 0 0.3 0.9\n1.5 1 2 0 0 0 0.3 0.9\n"


@st.composite
def damaged(draw, whole):
    """A whole file with some bytes changed, cut off or doubled, before or after compression."""
    content = gzip.compress(whole, mtime=0) if draw(st.booleans()) else whole
    content = bytearray(content)
    for _ in range(draw(st.integers(0, 4))):
        content[draw(st.integers(0, len(content) - 1))] = draw(st.integers(0, 255))
    if draw(st.booleans()):
        content = content[: draw(st.integers(0, len(content)))]
    if draw(st.booleans()):
        at, n = draw(st.integers(0, len(content))), draw(st.integers(0, 40))
        content[at:at] = content[at : at + n]
    return bytes(content) if draw(st.booleans()) else gzip.compress(bytes(content), mtime=0)


words = st.one_of(
    st.sampled_from(["FLASER", "RLASER", "ROBOTLASER1", "ODOM", "PARAM", "O", "L", "#"]),
    st.sampled_from(["0", "1", "2", "3", "180", "-1", "nan", "inf", "1e999"]),
    st.integers().map(str),
    st.floats().map(str),
    st.text(max_size=5),
)
lines = st.lists(words, max_size=30).map(" ".join)
logs = st.lists(lines, max_size=8).map(lambda rows: "\n".join(rows).encode("utf-8", "replace"))


def check_log(path):
    for event in read_log(path):
        pose = event.pose if isinstance(event, Odometry) else event.odometry
        assert np.isfinite(event.t)
        assert np.isfinite(pose).all()
        if not isinstance(event, Odometry):
            assert len(event.ranges) == len(event.angles) > 0
            assert np.isfinite(event.angles).all()
            assert np.isfinite(event.mount).all()
            assert event.range_max > 0


def check_trajectory(path):
    trajectory = read_trajectory(path)
    assert len(trajectory) > 0
    assert np.isfinite(trajectory.poses).all()
    assert (np.diff(trajectory.t) > 0).all()


def complaint(check, path):
    try:
        check(path)
    except McLocError as error:
        return str(error)
    return f"{path}: no complaint"


def succeeds_or_says_why(check, path, content):
    path.write_bytes(content)
    said = complaint(check, path)
    assert str(path) in said
    assert len(said.splitlines()) <= 2


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return tmp_path_factory.mktemp("fuzz") / "fuzzed"


@settings(max_examples=300, deadline=None)
@given(st.one_of(damaged(CARMEN), damaged(WEAN), logs, st.binary(max_size=300)))
def test_logs(path, content):
    succeeds_or_says_why(check_log, path, content)


@settings(max_examples=300, deadline=None)
@given(st.one_of(damaged(CSV), damaged(TUM), st.binary(max_size=300)))
def test_trajectories(path, content):
    succeeds_or_says_why(check_trajectory, path, content)


def test_the_undamaged_files_are_read(path):
    """Else the fuzzing above would exercise the errors of one line only."""
    for content, check in [(CARMEN, check_log), (WEAN, check_log), (CSV, check_trajectory)]:
        path.write_bytes(content)
        check(path)
    path.write_bytes(TUM)
    check_trajectory(path)
