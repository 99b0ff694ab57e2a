"""Trajectories as text: CSV `t,x,y,theta`, the estimates of a run, or TUM `t x y z qx qy qz qw`."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcloc.errors import ConfigError, TruthError
from mcloc.geometry import wrap
from mcloc.textfile import TextFile
from mcloc.trajectory import Trajectory

POSE = ("t", "x", "y", "theta")
COVARIANCE = [f"cov_{pair}" for pair in ("xx", "xy", "xt", "xy", "yy", "yt", "xt", "yt", "tt")]

_Table = NDArray[np.float64]
FAR = 1e9  # m; a trajectory on this planet is shorter


def read_trajectory(path: str | Path) -> Trajectory:
    """The trajectory in a file, gzip or not; `#` begins a comment.

    CSV has a header that names at least t, x, y and theta; cov_xx, cov_xy, cov_xt, cov_yy, cov_yt,
    cov_tt and share are taken where they are there, other columns are left. In TUM, height, roll
    and pitch are left. Poses out of order are sorted; of several with one stamp the first counts.
    Raises TruthError for a file that is missing, unreadable, empty or neither, and for a pose that
    is not finite or absurdly far off.
    """
    text = TextFile(str(path), TruthError)
    lines = [(i, s) for i, line in text.lines() if (s := line.strip()) and not s.startswith("#")]
    if not lines:
        raise TruthError(f"{path}: holds no poses; give CSV t,x,y,theta or TUM (8 columns)")
    (first, header), body = lines[0], lines[1:]
    if "," not in header:
        return _from_tum(text, lines)
    names = [name.strip() for name in header.split(",")]
    if missing := [name for name in POSE if name not in names]:
        raise text.fault(first, f"the header lacks {', '.join(missing)}; it must name t,x,y,theta")
    return _from_csv(text, names, body)


def write_tum(trajectory: Trajectory, path: str | Path) -> None:
    """Write `t x y z qx qy qz qw`, heights 0. Raises ConfigError where `path` cannot be written."""
    half = trajectory.poses[:, 2] / 2.0
    rows = np.column_stack([trajectory.t, trajectory.poses[:, :2], np.sin(half), np.cos(half)])
    lines = [f"{t:.6f} {x:.6f} {y:.6f} 0 0 0 {qz:.9f} {qw:.9f}" for t, x, y, qz, qw in rows]
    try:
        Path(path).write_text("\n".join(["# t x y z qx qy qz qw", *lines, ""]), encoding="utf-8")
    except OSError as cause:
        raise ConfigError(f"{path}: cannot be written ({cause.strerror})") from cause


def _from_tum(text: TextFile, lines: list[tuple[int, str]]) -> Trajectory:
    table = _table(text, [(number, line.split()) for number, line in lines], 8)
    x, y, z, w = table[:, 4:].T
    norm = np.sqrt(x * x + y * y + z * z + w * w)
    if not (np.isfinite(norm) & (norm > 0.0)).all():
        row = int(np.argmin(np.isfinite(norm) & (norm > 0.0)))
        raise text.fault(lines[row][0], "the quaternion qx qy qz qw must be finite and not zero")
    x, y, z, w = x / norm, y / norm, z / norm, w / norm
    yaw = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return _trajectory(text, [i for i, _ in lines], np.column_stack([table[:, :3], yaw]))


def _from_csv(text: TextFile, names: list[str], lines: list[tuple[int, str]]) -> Trajectory:
    table = _table(text, [(number, line.split(",")) for number, line in lines], len(names))
    numbers = [number for number, _ in lines]
    poses = table[:, [names.index(name) for name in POSE]]
    covariances = share = None
    if set(COVARIANCE) <= set(names):
        covariances = table[:, [names.index(name) for name in COVARIANCE]].reshape(-1, 3, 3)
    if "share" in names:
        share = table[:, names.index("share")]
    return _trajectory(text, numbers, poses, covariances, share)


def _table(text: TextFile, lines: list[tuple[int, list[str]]], columns: int) -> _Table:
    """(N, columns); an empty field is NaN."""
    rows = []
    for number, fields in lines:
        if len(fields) != columns:
            raise text.fault(number, f"{columns} fields expected, {len(fields)} found")
        try:
            rows.append([float(value) if value.strip() else np.nan for value in fields])
        except ValueError as cause:
            raise text.fault(number, str(cause)) from cause
    return np.array(rows, dtype=np.float64).reshape(-1, columns)


def _trajectory(
    text: TextFile,
    numbers: list[int],
    rows: _Table,
    covariances: _Table | None = None,
    share: _Table | None = None,
) -> Trajectory:
    if len(rows) == 0:
        raise TruthError(f"{text.path}: holds a header and no poses")
    finite = np.isfinite(rows).all(axis=1)
    if not finite.all():
        raise text.fault(numbers[int(np.argmin(finite))], "stamp and pose must be finite numbers")
    near = np.abs(rows[:, 1:3]).max(axis=1) < FAR
    if not near.all():
        raise text.fault(numbers[int(np.argmin(near))], f"x and y must be below {FAR:g} m")
    t, first = np.unique(rows[:, 0], return_index=True)
    poses = rows[first, 1:]
    poses[:, 2] = wrap(poses[:, 2])
    return Trajectory(
        t,
        poses,
        None if covariances is None else covariances[first],
        None if share is None else share[first],
    )
