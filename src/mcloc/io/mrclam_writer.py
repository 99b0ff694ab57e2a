"""A folder as `mcloc.io.mrclam` reads it, of one robot."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcloc.errors import LogError
from mcloc.events import Detection
from mcloc.geometry import between
from mcloc.io.mrclam import BARCODES, LANDMARKS
from mcloc.maps.landmarks import Landmarks
from mcloc.trajectory import Trajectory


def write_mrclam(
    folder: str | Path,
    robot: int,
    landmarks: Landmarks,
    wheels: Trajectory,
    seen: Sequence[Detection],
    truth: Trajectory,
) -> None:
    """Write what a robot saw of landmarks and other robots, by their numbers, which are their
    barcodes, too; its wheels, as velocities of arcs; and the truth, in the map frame.

    seen: in order of time. Raises LogError where nothing can be written.
    """
    places = zip(landmarks.names, landmarks.places.tolist(), strict=True)
    tables = {
        BARCODES: [f"{name} {name}" for name in (robot, *landmarks.names)],
        LANDMARKS: [f"{name} {x:.6f} {y:.6f} 0 0" for name, (x, y) in places],
        f"Robot{robot}_Odometry.dat": _velocities(wheels),
        f"Robot{robot}_Measurement.dat": [
            f"{d.t:.6f} {d.seen} {d.range:.4f} {d.bearing:.5f}" for d in seen
        ],
        f"Robot{robot}_Groundtruth.dat": _rows(np.column_stack([truth.t, truth.poses])),
    }
    path = Path(folder)
    try:
        path.mkdir(parents=True, exist_ok=True)
        for name, lines in tables.items():
            (path / name).write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")
    except OSError as cause:
        raise LogError(f"{path}: cannot be written to ({cause.strerror})") from cause


def _velocities(wheels: Trajectory) -> list[str]:
    """Lines t, v, ω: from each pose to the next one by an arc, as far as one leads there."""
    ahead, left, turn = between(wheels.poses[:-1], wheels.poses[1:]).T
    chord = np.copysign(np.hypot(ahead, left), ahead)
    length = chord / np.sinc(turn / (2.0 * np.pi))  # of the arc: sin(φ/2) / (φ/2) of it is chord
    velocity = np.column_stack([length, turn]) / np.diff(wheels.t)[:, None]
    return _rows(np.column_stack([wheels.t, np.vstack([velocity, np.zeros(2)])]))


def _rows(table: NDArray[np.float64]) -> list[str]:
    return [" ".join(f"{value:.6f}" for value in row) for row in table.tolist()]
