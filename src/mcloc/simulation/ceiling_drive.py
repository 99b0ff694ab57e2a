"""A tour guide drives through a museum under a ceiling: odometry and images, as a stream, and where
it truly was  [the setting of Fox01 §19.2.5 and §19.3.4].
"""

import heapq
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from mcloc.errors import ConfigError
from mcloc.events import Event, Odometry
from mcloc.geometry import Poses, compose, inverse, wrap
from mcloc.maps.mosaic import Mosaic
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.registry import Configurable, param
from mcloc.simulation.ceiling import ceiling_mosaic
from mcloc.simulation.ceiling_camera import CeilingCamera
from mcloc.simulation.robot import follow
from mcloc.simulation.route import Roadmap, way_along
from mcloc.simulation.spread import spread
from mcloc.simulation.wheels import Wheels
from mcloc.trajectory import Trajectory

EXHIBITS = 8  # between which the robot drives
PACE = 0.5  # m/s at which ways are driven before they are sped up
TURN = 1.2  # rad/s, the fastest turn
ODOMETRY_EVERY = 0.1  # s
PLACES = 100  # random ones, of which the exhibits are chosen far from each other

Reals = NDArray[np.float64]


@dataclass(frozen=True)
class CeilingTour(Configurable):
    """How the robot drives, and what happens to its wheels.

    From exhibit to exhibit it has another speed on each way, up to `fastest`. Where it enters or
    leaves the carpet in the middle of the floor it crosses a bump that turns it, and moves it, by
    errors that its wheels do not see. `jump_at`: s, when the odometry errs by `jump` (m, m, rad) at
    once; None for never.
    """

    duration: float = param(600.0, "s", "of the drive", low=1.0, high=1e6)
    images: float = param(5.185, "", "images each second", low=0.1, high=100)
    slowest: float = param(0.3, "", "speed, m/s", low=0.05, high=3)
    fastest: float = param(1.0, "", "speed, m/s", low=0.05, high=3)
    carpet: float = param(0.5, "", "width of the carpet, in widths of the floor", low=0, high=1)
    bump: float = param(0.0, "m", "deviation of the move over the bump", low=0, high=10)
    bump_turn: float = param(0.0, "rad", "deviation of the turn over the bump", low=0, high=3)
    jump_at: float | None = None
    jump: tuple[float, float, float] = (0.0, 0.0, 0.0)
    wheels: Wheels = field(default_factory=Wheels)
    camera: CeilingCamera = field(default_factory=CeilingCamera)


@dataclass(frozen=True, eq=False)
class CeilingDrive:
    """A drive whose events are made while they are read, the same each time.

    grid: the map. mosaic: of its ceiling. truth: at each image. bumps: stamps at which the wheels
    erred. odometry: (N, 3) at each stamp t (N,) of the wheels.
    """

    grid: OccupancyGrid
    mosaic: Mosaic
    truth: Trajectory
    wheels: Trajectory
    bumps: tuple[float, ...]
    camera: CeilingCamera
    seed: int

    def __iter__(self) -> Iterator[Event]:
        rng = np.random.default_rng([self.seed, 1])
        told = (
            Odometry(float(t), p) for t, p in zip(self.wheels.t, self.wheels.poses, strict=True)
        )
        at = self.wheels.at(self.truth.t)
        seen = self.camera.images(self.mosaic, self.truth.t, self.truth.poses, rng, at)
        return heapq.merge(told, seen, key=lambda event: event.t)

    @property
    def distance(self) -> float:
        """Metres that the robot drove."""
        return float(np.hypot(*np.diff(self.truth.poses[:, :2], axis=0).T).sum())


def ceiling_drive(
    grid: OccupancyGrid,
    seed: int,
    tour: CeilingTour | None = None,
    mosaic: Mosaic | None = None,
) -> CeilingDrive:
    """A drive through a map; mosaic: of its ceiling, by default one that the seed makes. One seed,
    the same drive. Raises MapError for a map without room to drive, ConfigError for a jump after
    the end.
    """
    tour = tour or CeilingTour()
    if tour.jump_at is not None and not 0.0 < tour.jump_at < tour.duration:
        raise ConfigError(
            f"jump_at = {tour.jump_at} s must lie within the drive of {tour.duration:g} s"
        )
    for_route, for_wheels, for_bumps = (
        np.random.default_rng(source) for source in np.random.SeedSequence(seed).spawn(3)
    )
    path = _path(grid, tour, for_route)
    t: Reals = ODOMETRY_EVERY * np.arange(int(tour.duration / ODOMETRY_EVERY) + 2.0)
    poses = path.at(t)
    odometry = tour.wheels.measure(poses, for_wheels)
    odometry, bumps = _bumped(odometry, poses, grid, tour, for_bumps)
    if tour.jump_at is not None:
        odometry = _erring(odometry, [int(tour.jump_at / ODOMETRY_EVERY)], [tour.jump])
    stamps: Reals = (0.5 + np.arange(float(round(tour.duration * tour.images)))) / tour.images
    truth = Trajectory(stamps, path.at(stamps))
    return CeilingDrive(
        grid,
        mosaic or ceiling_mosaic(grid, seed),
        truth,
        Trajectory(t, odometry),
        tuple(t[bumps].tolist()),
        tour.camera,
        seed,
    )


def _path(grid: OccupancyGrid, tour: CeilingTour, rng: np.random.Generator) -> Trajectory:
    """From exhibit to exhibit, as long as the drive lasts."""
    roadmap = Roadmap(grid)
    exhibits = _exhibits(roadmap, rng)
    towards = {goal: roadmap.toward(goal) for goal in exhibits}
    here, now, heading = exhibits[0], 0.0, None
    stamps, legs = [], []
    while now < tour.duration + 1.0:
        goal = int(rng.choice([e for e in exhibits if e != here]))
        leg = follow(roadmap.points[way_along(towards[goal], here)], PACE).poses
        if heading is not None:
            leg = np.concatenate([_turned(legs[-1][-1], leg[0]), leg])
        way = np.hypot(*np.diff(leg[:, :2], axis=0).T)
        turn = np.abs(wrap(np.diff(leg[:, 2])))
        took = np.maximum(way / rng.uniform(tour.slowest, tour.fastest), turn / TURN)
        stamps.append(now + np.cumsum(np.append(0.01, np.maximum(took, 1e-6))))
        legs.append(leg)
        here, now, heading = goal, float(stamps[-1][-1]), leg[-1, 2]
    return Trajectory(np.concatenate([[0.0], *stamps]), np.concatenate([legs[0][:1], *legs]))


def _exhibits(roadmap: Roadmap, rng: np.random.Generator) -> list[int]:
    """Places, each the one of several that is farthest from those before."""
    some = np.array([roadmap.random(rng) for _ in range(PLACES)])
    return [int(place) for place in some[spread(roadmap.points[some], EXHIBITS)]]


def _turned(before: NDArray[np.float64], after: NDArray[np.float64]) -> Poses:
    """Poses of a robot that turns where it is to go on, and drives the rest of the way."""
    off = float(wrap(after[2] - before[2]))
    steps = np.linspace(0.0, 1.0, 2 + int(abs(off) / 0.05))[1:-1]
    poses = np.repeat(before[None, :], len(steps), axis=0)
    poses[:, :2] += steps[:, None] * (after[:2] - before[:2])
    poses[:, 2] = wrap(before[2] + steps * off)
    return poses


def _bumped(
    odometry: Poses,
    poses: Poses,
    grid: OccupancyGrid,
    tour: CeilingTour,
    rng: np.random.Generator,
) -> tuple[Poses, NDArray[np.intp]]:
    """The odometry with its errors at the edges of the carpet, and where these are."""
    size = np.array(grid.cells.shape[::-1]) * grid.resolution
    off = np.abs(grid.to_grid(poses)[:, :2] - 0.5 * size)
    on = (off < 0.5 * tour.carpet * size).all(axis=1)
    bumps = np.flatnonzero(np.diff(on))
    if tour.bump == tour.bump_turn == 0.0:
        return odometry, bumps[:0]
    spread = np.array([tour.bump, tour.bump, tour.bump_turn])
    errors = rng.standard_normal((len(bumps), 3)) * spread
    return _erring(odometry, bumps, errors), bumps


def _erring(
    odometry: Poses,
    after: Sequence[int] | NDArray[np.intp],
    errors: Sequence[tuple[float, float, float]] | Poses,
) -> Poses:
    """Odometry that errs by a move of its own after some of its poses."""
    told = odometry.copy()
    for k, error in zip(after, errors, strict=True):
        before = told[k]
        frame = compose(compose(before, np.asarray(error)), inverse(before))
        told[k + 1 :] = compose(frame, told[k + 1 :])
    return told
