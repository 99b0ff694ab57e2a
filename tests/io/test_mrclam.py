"""MRCLAM folders: arcs against a fine integration, barcodes, gaps, and what can be wrong."""

from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from mcloc.errors import ConfigError, LogError, MapError, McLocError, TruthError
from mcloc.events import Detection, Odometry, Sightings
from mcloc.io.log import read_log
from mcloc.io.mrclam import Mrclam, is_mrclam, robots_in

FILES = {
    "Barcodes.dat": "# Subject #    Barcode #\n  1 \t   5 \n  2\t14\n  6\t63\n 7  81\n 8 7\n",
    "Landmark_Groundtruth.dat": "  6 \t 0.5 \t -4.25 \t 0.0 \t 0.0 \n 7 1.5 2.0 0 0\n",
    "Robot2_Odometry.dat": "# t v w\n10.0 \t 0.5 \t 0.0\n11.0 0.4 0.8\n13.0 0.0 -0.5\n14.0 0 0\n",
    "Robot2_Measurement.dat": (
        "10.5 63 3.0 0.1\n10.5 5 2.0 0.2\n10.5 81 4.0 -0.3\n12.0 7 1.0 0.0\n12.5 99 1.0 0.0\n"
        "13.5\t 81 \t 2.5 \t 0.25 \n"
    ),
    "Robot2_Groundtruth.dat": "9.0 1 2 0.5\n9.1 1 2 0.6\n12.0 1.5 2.5 3.5\n12.1 1.5 2.5 3.6\n",
    "Robot5_Odometry.dat": "1.0 0 0\n",
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
    return tmp_path


def log_of(folder: Path) -> tuple[list[Odometry], list[Sightings], dict[str, int]]:
    log = read_log(folder, robot=2)
    events = list(log)
    assert [e.t for e in events] == sorted(e.t for e in events)
    odometry = [e for e in events if isinstance(e, Odometry)]
    return odometry, [e for e in events if isinstance(e, Sightings)], log.skipped


def test_velocities_become_arcs(folder: Path) -> None:
    """Against 10⁵ short straight moves a second."""
    odometry, _, _ = log_of(folder)
    assert [e.t for e in odometry] == [10.0, 11.0, 13.0, 14.0]
    pose, n = np.zeros(3), 100_000
    for v, omega, seconds, event in zip(
        (0.5, 0.4, 0.0), (0.0, 0.8, -0.5), (1.0, 2.0, 1.0), odometry[1:], strict=True
    ):
        headings = pose[2] + omega * seconds * (np.arange(n) + 0.5) / n
        along = v * seconds * np.exp(1j * headings).mean()
        pose = np.add(pose, [along.real, along.imag, omega * seconds])
        assert event.pose[:2] == pytest.approx(pose[:2], abs=1e-9)
        assert np.exp(1j * event.pose[2]) == pytest.approx(np.exp(1j * pose[2]))
    assert (odometry[0].pose == 0.0).all()


def test_sightings_are_grouped_by_stamp_and_name_landmarks(folder: Path) -> None:
    _, sightings, skipped = log_of(folder)
    first, second = sightings
    assert (first.t, second.t) == (10.5, 13.5)
    assert first.landmark.tolist() == [0, 1]
    assert first.range.tolist() == [3.0, 4.0]
    assert first.bearing.tolist() == [0.1, -0.3]
    assert second.landmark.tolist() == [1]
    assert skipped == {
        "sighting of another robot": 1,
        "sighting of a landmark whose place is not known": 1,
        "sighting of an unknown barcode": 1,
    }
    landmarks = Mrclam(str(folder), 2).landmarks
    assert landmarks.names == ("6", "7")
    assert landmarks.places.tolist() == [[0.5, -4.25], [1.5, 2.0]]


def test_a_team_sees_robots_and_landmarks_where_asked_for(folder: Path) -> None:
    log = Mrclam(str(folder), 2)
    events = list(log.team_events(np.zeros(3), landmarks=True))
    assert [e.t for e in events] == sorted(e.t for e in events)
    (seen,) = [e for e in events if isinstance(e, Detection)]
    assert (seen.t, seen.seen, seen.range, seen.bearing) == (10.5, "1", 2.0, 0.2)
    assert np.isnan(seen.heading)
    assert sum(isinstance(e, Sightings) for e in events) == 2
    blind = list(log.team_events(np.array([0.1, 0.0, 0.2]), landmarks=False))
    assert not any(isinstance(e, Sightings) for e in blind)
    (seen,) = [e for e in blind if isinstance(e, Detection)]
    assert seen.mount.tolist() == [0.1, 0.0, 0.2]


def test_the_camera_sits_where_it_is_said_to(folder: Path) -> None:
    (seen, *_) = [e for e in read_log(folder, [0.1, 0.0, 0.2], robot=2) if isinstance(e, Sightings)]
    assert seen.mount.tolist() == [0.1, 0.0, 0.2]


def test_truth_has_gaps_and_headings_are_wrapped(folder: Path) -> None:
    truth = Mrclam(str(folder), 2).truth
    assert truth is not None
    assert truth.t.tolist() == [9.0, 9.1, 12.0, 12.1]
    assert truth.poses[2] == pytest.approx([1.5, 2.5, 3.5 - 2.0 * np.pi])
    (folder / "Robot2_Groundtruth.dat").unlink()
    assert Mrclam(str(folder), 2).truth is None


def test_stamps_that_repeat_or_go_back_do_no_harm(folder: Path) -> None:
    odometry = folder / "Robot2_Odometry.dat"
    odometry.write_text(
        "10 1 0\n10 0.5 0\n12 0.25 0\n11 9 9\n14 0 0\n nan 1 1\n 15 inf 0\n16 0 0\n"
    )
    log = read_log(folder, robot=2)
    at = {e.t: e.pose[0] for e in log if isinstance(e, Odometry)}
    assert at == {10.0: 0.0, 12.0: 1.0, 11.0: 1.0, 14.0: 1.5, 16.0: 1.5}
    assert log.skipped["stamp not finite"] == log.skipped["odometry not finite"] == 1


def test_a_single_wrong_stamp_holds_up_nothing(folder: Path) -> None:
    """Neither wheels nor sightings; a pause, after which all stamps are later, is none."""
    odometry, measured = folder / "Robot2_Odometry.dat", folder / "Robot2_Measurement.dat"
    odometry.write_text("10 1 0\n11 1 0\n900012 1 0\n13 1 0\n14 0 0\n100 1 0\n101 0 0\n")
    measured.write_text("10.5 63 3 0\n900011 63 3 0\n12 63 3 0\n90 63 3 0\n95 81 3 0\n")
    log = read_log(folder, robot=2)
    events = list(log)
    assert [e.t for e in events if isinstance(e, Sightings)] == [10.5, 12.0, 90.0, 95.0]
    at = {e.t: e.pose[0] for e in events if isinstance(e, Odometry)}
    assert at == {10.0: 0.0, 11.0: 1.0, 13.0: 3.0, 14.0: 4.0, 100.0: 4.0, 101.0: 5.0}
    assert log.skipped["odometry stamp from the future"] == 1
    assert log.skipped["sighting stamp from the future"] == 1


def test_nobody_drives_to_a_stamp_that_is_far_off(folder: Path) -> None:
    """The last one, which nothing contradicts: a velocity holds for 10 s at most."""
    (folder / "Robot2_Odometry.dat").write_text("10 1 0\n11 1 0\n900012 1 0\n")
    last = [e for e in read_log(folder, robot=2) if isinstance(e, Odometry)][-1]
    assert last.pose[0] == 11.0


def test_a_line_that_is_repeated_counts_once(folder: Path) -> None:
    """Other readings of the same landmark at the same stamp count, and so do those that say the
    same later; a bearing alone may be repeated, too.
    """
    (folder / "Robot2_Measurement.dat").write_text(
        "10.5 63 3 0.1\n10.5 5 2 0.2\n10.5 63 3 0.1\n10.5 63 3.1 0.1\n10.5 5 2 0.2\n"
        "10.5 63 3 0.1\n10.5 81 nan 0.3\n10.5 81 nan 0.3\n12 63 3 0.1\n"
    )
    _, (first, second), skipped = log_of(folder)
    assert first.landmark.tolist() == [0, 0, 1]
    assert first.range.tolist() == pytest.approx([3.0, 3.1, np.nan], nan_ok=True)
    assert second.range.tolist() == [3.0]
    assert skipped == {"duplicate sighting": 4, "sighting of another robot": 1}
    seen = Mrclam(str(folder), 2).team_events(np.zeros(3), landmarks=False)
    assert sum(isinstance(e, Detection) for e in seen) == 1


def test_it_is_told_by_its_barcodes(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> None:
    assert is_mrclam(folder)
    assert robots_in(folder) == [2, 5]
    other = tmp_path_factory.mktemp("other")
    assert not is_mrclam(other)
    assert not is_mrclam(folder / "Barcodes.dat")
    assert not is_mrclam("no\0such")
    with pytest.raises(ConfigError, match="leave --robot out"):
        read_log(other / "drive.log", robot=2)
    with pytest.raises(ConfigError, match="topics"):
        read_log(folder, topics={"scan": "/scan"}, robot=2)


@pytest.mark.parametrize("robot", [None, 3])
def test_a_robot_that_is_not_there_is_refused_with_those_that_are(folder: Path, robot: int) -> None:
    with pytest.raises(ConfigError, match=r"2, 5; give one with --robot"):
        read_log(folder, robot=robot)


WRONG: dict[str, tuple[str, str, type[McLocError], str]] = {
    "odometry cut": ("Robot2_Odometry.dat", "10 0.5 0\n11 0.", LogError, "line 2: 3 numbers"),
    "odometry foreign": ("Robot2_Odometry.dat", "GIF89a 1 2\n", LogError, "line 1"),
    "measurement cut": ("Robot2_Measurement.dat", "10 63 1\n", LogError, "line 1: 4 numbers"),
    "measurement empty": ("Robot2_Measurement.dat", "# nothing\n", LogError, "holds no"),
    "barcodes cut": ("Barcodes.dat", "1 5\n6\n", LogError, r"Barcodes\.dat, line 2: 2 numbers"),
    "barcode twice": ("Barcodes.dat", "1 5\n6 63\n7 63\n", LogError, "line 3: barcode 63"),
    "landmarks cut": ("Landmark_Groundtruth.dat", "6 0.5 1\n", MapError, "line 1: 5 numbers"),
    "landmarks empty": ("Landmark_Groundtruth.dat", "#\n", MapError, "no landmark"),
    "landmark twice": ("Landmark_Groundtruth.dat", "6 1 1 0 0\n6 2 2 0 0\n", MapError, "twice"),
    "landmark nowhere": ("Landmark_Groundtruth.dat", "6 nan 1 0 0\n", MapError, "finite"),
    "truth cut": ("Robot2_Groundtruth.dat", "9 1 2 3\n9.1 1 2\n", TruthError, "line 2: 4 numbers"),
    "truth nowhere": ("Robot2_Groundtruth.dat", "9 1 inf 3\n", TruthError, "line 1: stamp"),
    "truth empty": ("Robot2_Groundtruth.dat", "\n", TruthError, "holds no poses"),
}


ASK: dict[type[McLocError], Callable[[Path], object]] = {
    LogError: lambda folder: list(read_log(folder, robot=2)),
    MapError: lambda folder: Mrclam(str(folder), 2).landmarks,
    TruthError: lambda folder: Mrclam(str(folder), 2).truth,
}


@pytest.mark.parametrize(("name", "text", "error", "what"), WRONG.values(), ids=WRONG)
def test_what_is_wrong_is_named(
    folder: Path, name: str, text: str, error: type[McLocError], what: str
) -> None:
    (folder / name).write_text(text)
    with pytest.raises(error, match=what) as raised:
        ASK[error](folder)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("name", ["Landmark_Groundtruth.dat", "Robot2_Measurement.dat"])
def test_a_file_that_is_missing_is_named(folder: Path, name: str) -> None:
    (folder / name).unlink()
    with pytest.raises((LogError, MapError), match=name):
        list(read_log(folder, robot=2))


def test_lines_before_a_cut_have_been_delivered(folder: Path) -> None:
    measured = folder / "Robot2_Measurement.dat"
    measured.write_text(measured.read_text()[:-10])
    events = iter(read_log(folder, robot=2))
    delivered = [next(events) for _ in range(2)]
    assert [e.t for e in delivered] == [10.0, 10.5]
    with pytest.raises(LogError, match="line 6"):
        next(events)


def test_the_recorded_robots(data_dir: Path) -> None:
    """All five: what the folder's description says of them, and truth that fits the sightings."""
    counted = {1: (1534, 1), 2: (3239, 0), 3: (4348, 2), 4: (2023, 3), 5: (4239, 0)}
    driven = []
    assert robots_in(data_dir / "mrclam6") == [1, 2, 3, 4, 5]
    for robot, (seen, unknown) in counted.items():
        folder = Mrclam(str(data_dir / "mrclam6"), robot)
        skipped: Counter[str] = Counter()
        events = list(folder.events(np.zeros(3), skipped))
        sightings = [e for e in events if isinstance(e, Sightings)]
        assert sum(len(e.landmark) for e in sightings) == seen
        assert skipped["sighting of an unknown barcode"] == unknown
        odometry = np.array([e.pose for e in events if isinstance(e, Odometry)])
        driven.append(np.hypot(*np.diff(odometry[:, :2], axis=0).T).sum())
        truth, places = folder.truth, folder.landmarks.places
        assert truth is not None
        assert len(places) == 15
        inside = [e for e in sightings if truth.t[0] <= e.t <= truth.t[-1]]
        off = []
        for e, pose in zip(inside, truth.at(np.array([e.t for e in inside])), strict=True):
            dx, dy = (places[e.landmark] - pose[:2]).T
            off += np.abs(np.hypot(dx, dy) - e.range).tolist()
        assert np.median(off) < 0.2
        assert 0.005 < np.mean(np.array(off) > 0.5) < 0.036
    assert 43.0 < min(driven) < max(driven) < 58.0
