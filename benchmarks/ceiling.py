"""How much faster than real time a robot is localized by its ceiling camera: 4,000 s with 20,740
images, as in [Fox01 Fig. 19.14], replayed with the default MCL; and the same weighing in plain
NumPy.

    python benchmarks/ceiling.py [--duration 4000] [--seed 0] [--out FILE]

The drive is made first, its images held in memory: what is timed is the replay, all of it, by the
Localizer and its default policy, by the clock and by the time of the processors, which other work
on the machine changes less. The images are weighed by kernels and by NumPy in turn, for
particles around the robot as many as the replay had, and the results are held to each other.
"""

import argparse
import os
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcloc import __version__
from mcloc.events import Event, Image
from mcloc.filters.catalog import Composition
from mcloc.kernels.jit import set_threads
from mcloc.localizer import Localizer
from mcloc.maps.mosaic import Mosaic
from mcloc.sensors import CAMERAS
from mcloc.sensors.ceiling import CeilingBrightness
from mcloc.sensors.ceiling_patch import CeilingPatch
from mcloc.simulation import CeilingDrive, CeilingTour, ceiling_drive, museum_world

Reals = NDArray[np.float64]
REPEATS = 40  # images that are weighed in both ways
WANTED = 50.0  # times as fast as real time


def plain(mosaic: Mosaic, x: Reals, y: Reals) -> Reals:
    """Brightness at places, bilinear, with NumPy alone."""
    ox, oy, yaw = mosaic.origin
    cos, sin, pixel = np.cos(yaw), np.sin(yaw), mosaic.resolution
    column = (cos * (x - ox) + sin * (y - oy)) / pixel - 0.5
    row = (cos * (y - oy) - sin * (x - ox)) / pixel - 0.5
    height, width = mosaic.image.shape
    off = (row < 0) | (column < 0) | (row > height - 1) | (column > width - 1)
    i = np.clip(row, 0, height - 2).astype(np.intp)
    j = np.clip(column, 0, width - 2).astype(np.intp)
    b, a = row - i, column - j
    table = mosaic.image
    low = (1 - a) * table[i, j] + a * table[i, j + 1]
    high = (1 - a) * table[i + 1, j] + a * table[i + 1, j + 1]
    return np.where(off, np.nan, (1 - b) * low + b * high)


@dataclass(frozen=True)
class PlainBrightness(CeilingBrightness):
    """The same by NumPy."""

    def log_likelihood(self, x: Reals, z: Image) -> Reals:
        b = min(self.middle(z), 1.0)
        if not b > self.dark:
            return np.zeros(x.shape[1])
        p = self.density(b, plain(self.expected, x[0], x[1]))
        return z.novelty * np.log(p / float(self.density(b, np.array(b))))


@dataclass(frozen=True)
class PlainPatch(CeilingPatch):
    """The same by NumPy."""

    def _compared(self, x: Reals, v: Reals) -> tuple[Reals, Reals]:
        cos, sin = np.cos(x[2])[:, None], np.sin(x[2])[:, None]
        east = x[0][:, None] + cos * self.points[0] - sin * self.points[1]
        north = x[1][:, None] + sin * self.points[0] + cos * self.points[1]
        seen = plain(self.expected, east, north)
        known = np.isfinite(seen)
        filled = np.where(known, seen, 0.0)
        mean = filled.sum(axis=1) / np.maximum(known.sum(axis=1), 1)
        d = np.where(known, seen - mean[:, None], 0.0)
        squares = np.einsum("nk,nk->n", d, d)
        rho = np.divide(d @ v, np.sqrt(squares), out=np.zeros(len(d)), where=squares > 0)
        return self.concentration(squares), np.clip(rho, -1.0, 1.0)


PLAIN = {"ceiling-patch": PlainPatch, "ceiling-brightness": PlainBrightness}


def replayed(
    drive: CeilingDrive, events: list[Event], camera: str
) -> tuple[float, float, float, float]:
    """Seconds by the clock and of processors, median error (m), particles of an update."""
    composition = Composition("mcl", camera=camera)
    start = drive.truth.poses[0]

    def localizer() -> Localizer:
        made = Localizer(drive.grid, composition, aids=[drive.mosaic], seed=0, initial=start)
        return made

    list(localizer().run(events[:200]))  # compiles, or loads what was compiled
    timed = localizer()
    began, busy = time.perf_counter(), time.process_time()
    estimates = list(timed.run(events))
    took, busy = time.perf_counter() - began, time.process_time() - busy
    t = np.array([e.t for e in estimates])
    off = np.array([e.pose for e in estimates])[:, :2] - drive.truth.at(t)[:, :2]
    n = np.mean([e.update.info.n for e in estimates if e.updated])
    return took, busy, float(np.median(np.hypot(*off.T))), float(n)


def weighed(drive: CeilingDrive, images: list[Image], camera: str, n: int) -> tuple[float, float]:
    """Milliseconds to weigh n particles by an image, by kernels and by NumPy, taken in turn."""
    models = CAMERAS.make(camera, drive.mosaic), PLAIN[camera](drive.mosaic)
    set_threads(1)
    rng = np.random.default_rng(0)
    took: tuple[list[float], list[float]] = ([], [])
    for z in images[:: max(len(images) // REPEATS, 1)]:
        pose = drive.truth.at(np.array([z.t]))[0]
        x = pose[:, None] + np.array([[0.2], [0.2], [0.1]]) * rng.standard_normal((3, n))
        found = []
        for model, times in zip(models, took, strict=True):
            model.log_likelihood(x, z)
            began = time.perf_counter()
            found.append(model.log_likelihood(x, z))
            times.append(time.perf_counter() - began)
        assert np.allclose(found[0], found[1], atol=1e-3)
    set_threads(os.cpu_count() or 1)
    kernels, numpy = (1e3 * float(np.median(times)) for times in took)
    return kernels, numpy


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--duration", type=float, default=4000.0)
    options.add_argument("--seed", type=int, default=0)
    options.add_argument("--out", type=Path, default=Path("docs/results/ceiling.md"))
    given = options.parse_args()
    drive = ceiling_drive(
        museum_world(given.seed), given.seed, CeilingTour(duration=given.duration)
    )
    events = list(drive)
    images = [event for event in events if isinstance(event, Image)]
    lines = [
        "# A ceiling camera in real time\n",
        f"Measured with mcloc {__version__} on one virtual machine by\n\n    python "
        "benchmarks/ceiling.py\n",
        f"A simulated drive under a ceiling: {given.duration:g} s, {len(images):,} images, "
        f"{drive.distance:.0f} m, replayed from its start by MCL with its usual parameters, all of "
        f"it timed: {WANTED:g} times real time is wanted. *Particles*: of an update in the mean; "
        "KLD sampling takes many where a camera that tells one number has lost the robot. "
        "*Weighing* is that of as many particles by an image.\n",
        "| camera | replay, s | processors, s | times real time | median error, m | particles "
        "| weighing on one thread: kernels, ms | NumPy, ms | times as fast |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for camera in PLAIN:
        took, busy, error, n = replayed(drive, events, camera)
        kernels, numpy = weighed(drive, images, camera, round(n))
        ratio = given.duration / took
        lines.append(
            f"| {camera} | {took:.1f} | {busy:.1f} | {ratio:.0f} | {error:.2f} | {n:.0f} "
            f"| {kernels:.3f} | {numpy:.3f} | {numpy / kernels:.1f} |"
        )
        print(lines[-1], f"({'as' if ratio >= WANTED else 'NOT as'} fast as wanted)", flush=True)
    given.out.write_text("\n".join([*lines, ""]), encoding="utf-8")


if __name__ == "__main__":
    main()
