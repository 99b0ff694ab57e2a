"""Kidnappings injected into recorded logs: where they are is known, and nothing else is changed."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mcloc.evaluation import evaluate
from mcloc.evaluation.kidnapping import find_kidnappings
from mcloc.events import Scan
from mcloc.geometry import between
from mcloc.io.log import read_log
from mcloc.io.tum import read_trajectory
from mcloc.simulation import Teleported, teleported
from mcloc.trajectory import Trajectory

LOGS = ["intel/intel_test0", "fhw/fhw_test0", "freiburg-079/freiburg-079_test0"]


@pytest.fixture(params=LOGS)
def recorded(request, data_dir: Path) -> tuple[list[Scan], Trajectory]:
    log = list(read_log(data_dir / f"{request.param}.log.gz"))
    assert all(isinstance(event, Scan) for event in log)
    return log, read_trajectory(data_dir / f"{request.param}.ref.csv")


def drive_of(recorded: tuple[list[Scan], Trajectory], seed: int) -> tuple[Teleported, np.ndarray]:
    """A drive of 500 m, and which scan of the log each of its scans is."""
    drive = teleported(*recorded, seed=seed, length=500.0)
    index = {id(scan.ranges): k for k, scan in enumerate(recorded[0])}
    return drive, np.array([index[id(scan.ranges)] for scan in drive])


def stamps_of(scans: object) -> np.ndarray:
    return np.array([scan.t for scan in scans])


def odometry_of(scans: object) -> np.ndarray:
    return np.array([scan.odometry for scan in scans])


@pytest.mark.parametrize("seed", range(3))
def test_scans_and_wheels_are_those_of_the_log(recorded, seed: int) -> None:
    log = recorded[0]
    drive, source = drive_of(recorded, seed)
    for scan, k in zip(drive, source.tolist(), strict=True):
        assert replace(scan, t=log[k].t, odometry=log[k].odometry) == log[k]

    t, own = stamps_of(drive), stamps_of(log)
    jumped = np.isin(t[1:], drive.kidnappings)
    assert jumped.sum() == len(drive.kidnappings) > 1
    np.testing.assert_array_equal(np.diff(source)[~jumped], 1)
    np.testing.assert_allclose(
        np.diff(t), np.where(jumped, np.median(np.diff(own)), np.diff(own, append=0.0)[source[:-1]])
    )
    wheels, here = odometry_of(log), odometry_of(drive)
    moved = between(wheels[source[:-1]], wheels[source[1:]])
    moved[jumped] = 0.0
    np.testing.assert_allclose(between(here[:-1], here[1:]), moved, atol=1e-9)


@pytest.mark.parametrize("seed", range(3))
def test_the_truth_belongs_to_the_scans_and_jumps_far(recorded, seed: int) -> None:
    log, reference = recorded
    drive, source = drive_of(recorded, seed)
    assert (np.diff(drive.truth.t) > 0.0).all()
    assert len(drive.truth) == len(drive.events)  # in these logs each scan has its reference
    assert np.abs(drive.truth.t - stamps_of(drive)).max() <= 1e-3
    own = np.abs(stamps_of(log)[:, None] - reference.t).argmin(axis=1)
    np.testing.assert_array_equal(drive.truth.poses, reference.poses[own[source]])

    step = np.hypot(*np.diff(drive.truth.poses[:, :2], axis=0).T)
    jumped = np.isin(stamps_of(drive)[1:], drive.kidnappings)
    assert (step[jumped] >= 5.0).all()
    assert step[~jumped].max() < 1.5
    assert 500.0 - 1e-6 <= step[~jumped].sum() < 501.5


@pytest.mark.parametrize("seed", range(3))
def test_evaluation_finds_exactly_these_kidnappings(recorded, seed: int) -> None:
    drive, _ = drive_of(recorded, seed)
    wheels = Trajectory(stamps_of(drive), odometry_of(drive))
    found = evaluate(drive.truth, drive.truth, odometry=wheels, kidnappings=drive.kidnappings)
    assert tuple(recovery.t for recovery in found.recoveries) == drive.kidnappings
    step = np.hypot(*np.diff(drive.truth.poses[:, :2], axis=0).T)
    stretches = np.split(np.append(0.0, step), np.searchsorted(stamps_of(drive), drive.kidnappings))
    for recovery, way in zip(found.recoveries, stretches[1:], strict=True):
        assert recovery.path_m == pytest.approx(way[1:].sum())
        assert recovery.recovered == (way[1:].sum() >= 3.0 - 1e-6 and len(way) >= 5)
    by_odometry = find_kidnappings(drive.truth.t, drive.truth.poses, wheels)
    assert [k.t for k in by_odometry] == pytest.approx(drive.kidnappings, abs=1e-3)
