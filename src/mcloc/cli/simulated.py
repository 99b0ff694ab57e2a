"""What `mcloc simulate` has written, and how to go on from there."""

import math
import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mcloc.simulation import SimulatedDrive

LOGS = {"mcap": "log", "carmen": "log.gz"}  # the log of each format, in the folder
LABELS = {
    **{name: name for name in ("map", "log", "truth", "beacons")},
    "beacon_ranges": "ranges",
    **{name: name for name in ("ceiling", "images", "mrclam")},
    "next": "go on",
    "next_without_laser": "no laser",
    "next_by_landmarks": "landmarks",
}


def written(
    drive: "SimulatedDrive",
    out: Path,
    format: str,
    aids: Mapping[str, Path],
    mrclam: Path | None,
) -> dict[str, Any]:
    """What is in the folder now, and the commands that go on from there: with the laser, and, where
    other sensors can do without it, from the true start by these.

    aids: the files of these, by the options of `mcloc run`. mrclam: the folder of one that sees
    landmarks instead, if there is one.
    """
    from mcloc.events import Scan

    files = {"map": out / "map.yaml", "log": out / LOGS[format], "truth": out / "truth.csv", **aids}
    options = {f"--{name.replace('_', '-')}": str(path) for name, path in files.items()}
    command = ["mcloc", "run", *(word for option in options.items() for word in option)]
    story: dict[str, Any] = {
        "world": f"{drive.grid.name}, {drive.grid.extent()}",
        "duration_s": float(drive.truth.t[-1]),
        "distance_m": drive.distance,
        "scans": sum(isinstance(event, Scan) for event in drive.events),
        "kidnappings_s": list(drive.kidnappings),
        **{name: str(path) for name, path in files.items()},
        "next": shlex.join(command),
    }
    x, y, theta = drive.truth.poses[0]
    start = ["--initial", f"{x:.3f},{y:.3f},{math.degrees(theta):.1f}"]
    if aids:
        story["next_without_laser"] = shlex.join([*command, "--no-scans", *start])
    if mrclam is not None:
        story["mrclam"] = str(mrclam)
        log = ["--map", str(files["map"]), "--log", str(mrclam), "--robot", "1"]
        story["next_by_landmarks"] = shlex.join(["mcloc", "run", *log, *start])
    return story


def told(written: dict[str, Any]) -> str:
    """The same for people."""
    w = written
    lines = [
        f"world      {w['world']}",
        f"drive      {w['distance_m']:.1f} m in {w['duration_s']:.1f} s, {w['scans']} scans",
        *(f"kidnapped  at t = {t:.2f} s" for t in w["kidnappings_s"]),
        *(f"{label:10} {w[name]}" for name, label in LABELS.items() if name in w),
    ]
    return "".join(f"{line}\n" for line in lines)
