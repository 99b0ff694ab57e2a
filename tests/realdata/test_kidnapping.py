"""One recorded log holds a kidnapping; the drift of no other robot's wheels is mistaken for one."""

from pathlib import Path

import numpy as np
import pytest

from mcloc.evaluation.kidnapping import find_kidnappings
from mcloc.events import Scan
from mcloc.io.log import read_log
from mcloc.io.tum import read_trajectory
from mcloc.trajectory import Trajectory

KIDNAPPED = ("wean/robotdata_1then4.log.gz", "wean/robotdata_1then4.ref.csv")
CONTINUOUS = [
    *((f"wean/robotdata{k}.log.gz", f"wean/robotdata{k}.ref.csv") for k in (1, 3, 4)),
    ("intel/intel_test0.log.gz", "intel/intel_test0.ref.csv"),
    ("intel/intel_all.log.gz", "intel/intel_all.ref.csv"),
    ("fhw/fhw_test0.log.gz", "fhw/fhw_test0.ref.csv"),
    ("fhw/fhw_all.log.gz", "fhw/fhw_all.ref.csv"),
    ("freiburg-079/freiburg-079_test0.log.gz", "freiburg-079/freiburg-079_test0.ref.csv"),
    ("malaga/scans.log.gz", "malaga/ref.csv"),
]

# freiburg-079's wheels report reversing as going ahead, 4 m off within 2 m: that is no drift.
SPARSE = [
    (names, spacing)
    for names in CONTINUOUS
    for spacing in (2.0, 5.0, 10.0)
    if spacing == 10.0 or not names[0].startswith("freiburg")
]


def odometry_and_reference(folder: Path, names: tuple[str, str]) -> tuple[Trajectory, Trajectory]:
    stamped = {
        event.t: event.odometry
        for event in read_log(folder / names[0])
        if isinstance(event, Scan) and event.odometry is not None
    }
    t = sorted(stamped)
    odometry = Trajectory(np.array(t), np.array([stamped[stamp] for stamp in t]))
    return odometry, read_trajectory(folder / names[1])


def test_the_kidnapping_of_the_joined_log_is_found(data_dir: Path) -> None:
    odometry, reference = odometry_and_reference(data_dir, KIDNAPPED)
    found = find_kidnappings(reference.t, reference.poses, odometry)
    assert [kidnapping.first for kidnapping in found] == [713]
    # The jump lies somewhere between the references 712 and 713, 1.2 s apart; its end is given.
    assert found[0].t == pytest.approx(136.036, abs=1e-3)


@pytest.mark.parametrize("names", CONTINUOUS, ids=lambda names: names[1])
def test_a_continuous_log_holds_none(data_dir: Path, names: tuple[str, str]) -> None:
    odometry, reference = odometry_and_reference(data_dir, names)
    assert find_kidnappings(reference.t, reference.poses, odometry) == []


@pytest.mark.parametrize(("names", "spacing"), SPARSE)
def test_drift_between_sparse_references_is_none(
    data_dir: Path, names: tuple[str, str], spacing: float
) -> None:
    """References thinned to one every few metres driven, by which most wheels are off by > 1 m."""
    odometry, reference = odometry_and_reference(data_dir, names)
    step = np.diff(odometry.at(reference.t)[:, :2], axis=0)
    driven = np.append(0.0, np.cumsum(np.hypot(step[:, 0], step[:, 1])))
    for start in np.linspace(0.0, spacing, 8, endpoint=False):
        kept = np.unique(np.searchsorted(driven, np.arange(start, driven[-1], spacing)))
        assert find_kidnappings(reference.t[kept], reference.poses[kept], odometry) == []
