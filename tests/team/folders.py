"""MRCLAM folders: robots drive circles among landmarks, and see them and each other."""

import numpy as np

from mcloc.geometry import wrap

STEP = 0.2  # s between odometry
REACH, FIELD = 5.0, 1.0  # m, and rad to either side: what a camera sees
NOISE = 0.02, 0.02  # m per m, and rad: of ranges and bearings

CIRCLES = np.array([[-1.5, 0.0, 2.0], [1.5, 0.0, 2.0], [0.0, 1.0, 3.0]])  # x, y, radius (m)
SPEED = 0.3  # m/s
BARCODES = {1: 5, 2: 14, 3: 41, 6: 72, 7: 27, 8: 54, 9: 70, 10: 36, 11: 18, 12: 25}


def pose(robot, t):
    """(3,) of robot 1, 2, 3 at t (s)."""
    x, y, radius = CIRCLES[robot - 1]
    omega = SPEED / radius * (-1) ** robot
    around = 2.0 * robot + omega * t
    heading = wrap(around + np.sign(omega) * np.pi / 2.0)
    return np.array([x + radius * np.cos(around), y + radius * np.sin(around), heading])


def write_folder(folder, *, robots=2, duration=40.0, seed=1, shift=()):
    """Write it. shift: {robot: s} that is added to all of its stamps."""
    rng, shifts = np.random.default_rng(seed), dict(shift)
    folder.mkdir(parents=True, exist_ok=True)
    angles = np.linspace(0.3, 2.0 * np.pi + 0.3, 7, endpoint=False)
    landmarks = np.stack([4.5 * np.cos(angles), 4.0 * np.sin(angles)], axis=1)
    known = list(BARCODES.items())[: 3 + len(landmarks)]
    lines(folder / "Barcodes.dat", known)
    rows = [(6 + k, x, y, 0.0, 0.0) for k, (x, y) in enumerate(landmarks)]
    lines(folder / "Landmark_Groundtruth.dat", rows)
    for robot in range(1, robots + 1):
        odometry, seen, truth = [], [], []
        omega = SPEED / CIRCLES[robot - 1, 2] * (-1) ** robot
        for k, t in enumerate(np.arange(0.0, duration, STEP)):
            stamp = t + 1000.0 + shifts.get(robot, 0.0)
            v, w = SPEED * rng.normal(1.0, 0.03), omega * rng.normal(1.0, 0.03)
            odometry.append((stamp, v, w))
            truth.append((stamp, *pose(robot, t)))
            if k % 5 == robot:  # each at moments of its own
                others = {s: pose(s, t)[:2] for s in range(1, robots + 1) if s != robot}
                places = {6 + i: place for i, place in enumerate(landmarks)} | others
                for subject, place in places.items():
                    r, bearing = sighting(pose(robot, t), place)
                    if r < REACH and abs(bearing) < FIELD:
                        r *= rng.normal(1.0, NOISE[0])
                        bearing += rng.normal(0.0, NOISE[1])
                        seen.append((stamp, BARCODES[subject], r, bearing))
        lines(folder / f"Robot{robot}_Odometry.dat", odometry)
        lines(folder / f"Robot{robot}_Measurement.dat", seen)
        lines(folder / f"Robot{robot}_Groundtruth.dat", truth)
    return folder


def sighting(at, place):
    dx, dy = place - at[:2]
    return np.hypot(dx, dy), wrap(np.arctan2(dy, dx) - at[2])


def lines(path, rows):
    path.write_text(
        "".join(" ".join(f"{v:.6f}".rstrip("0").rstrip(".") for v in row) + "\n" for row in rows)
    )
