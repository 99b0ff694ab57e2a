"""Detections of other robots in a CSV file, and their places in a log."""

import math

import numpy as np
import pytest

from mcloc.errors import LogError
from mcloc.events import Detection, Odometry
from mcloc.io.detections import among, read_detections


def read(tmp_path, text):
    file = tmp_path / "seen.csv"
    file.write_text(text)
    return read_detections(file)


def test_what_was_measured_is_read_in_the_order_of_time(tmp_path):
    header = "t,seen,range,bearing,heading\n"
    found = read(tmp_path, header + "2.5,r2,3.0,-0.4,\n# a note\n1,räuber,1,,2\n")
    assert [(z.t, z.seen, z.range) for z in found] == [(1.0, "räuber", 1.0), (2.5, "r2", 3.0)]
    assert math.isnan(found[0].bearing)
    assert found[0].heading == 2.0
    assert found[1].bearing == -0.4
    assert math.isnan(found[1].heading)


def test_columns_may_be_left_out(tmp_path):
    (z,) = read(tmp_path, "seen,range,t\nr2,3.0,1.0\n")
    assert math.isnan(z.bearing)
    assert math.isnan(z.heading)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "empty"),
        ("t,seen\n1,r2\n", "range"),
        ("t,seen,range\n1,r2\n", "3 fields"),
        ("t,seen,range\nnan,r2,1\n", "t must be a finite number"),
        ("t,seen,range\n1,r2,0\n", "range must be > 0"),
        ("t,seen,range\n1,,2\n", "which robot"),
        ("t,seen,range,bearing\n1,r2,2,left\n", "bearing must be a finite number"),
    ],
)
def test_what_is_wrong_is_said(tmp_path, text, why):
    with pytest.raises(LogError, match=why) as error:
        read(tmp_path, text)
    assert "seen.csv" in str(error.value)


def test_one_wrong_stamp_does_not_bring_detections_before_their_time():
    wheels = [Odometry(t, np.zeros(3)) for t in (0.0, 1.0, 1e6, 3.0, 4.0, 5.0, 6.0)]
    seen = [Detection(t, "r2", 1.0, 0.0) for t in (2.5, 4.5, 7.0)]
    assert [e.t for e in among(wheels, seen)] == [0.0, 1.0, 2.5, 1e6, 3.0, 4.0, 4.5, 5.0, 6.0, 7.0]


def test_a_log_that_goes_on_after_a_pause_is_in_order():
    wheels = [Odometry(t, np.zeros(3)) for t in (0.0, 100.0, 101.0)]
    seen = [Detection(50.0, "r2", 1.0, 0.0)]
    assert [e.t for e in among(wheels, seen)] == [0.0, 50.0, 100.0, 101.0]


def test_detections_come_before_what_is_not_earlier():
    events = [Odometry(t, np.zeros(3)) for t in (1.0, 2.0, 3.0)]
    seen = [Detection(t, "r2", 1.0, 0.0) for t in (0.5, 2.0, 2.5, 9.0)]
    merged = list(among(events, seen))
    stamps = [(e.t, isinstance(e, Detection)) for e in merged]
    assert stamps == [
        *((0.5, True), (1.0, False), (2.0, True), (2.0, False)),
        *((2.5, True), (3.0, False), (9.0, True)),
    ]
