"""Drives of several robots on one floor, and when they see each other: from where they are, by line
of sight.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from mcloc.errors import ConfigError
from mcloc.events import Detection, Event
from mcloc.geometry import Poses, compose, wrap
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.registry import Configurable, param
from mcloc.simulation.drive import Scenario, simulate
from mcloc.simulation.ranges import first_walls
from mcloc.trajectory import Trajectory

MOST_ROBOTS = 10


@dataclass(frozen=True)
class Spotter(Configurable):
    """How a robot sees others: by a camera that looks for them.

    The defaults are those of [Fox01 §19.4.2]: a mean error of 48.26 cm, which is σ √(2/π), one of
    2.2° in bearing, and 6.9 % of what it sees is none of them: such a detection has any range and
    bearing. mount: x, y, θ of the camera in the robot's frame, metres and radians.
    """

    sigma_range: float = param(0.605, "m", "deviation of a range", low=0.0, high=100.0)
    sigma_bearing: float = param(0.048, "rad", "deviation of a bearing", low=0.0, high=2.0)
    sigma_heading: float = param(0.1, "rad", "deviation of a relative heading", low=0.0, high=2.0)
    headings: bool = param(False, "", "whether it sees how the other robot is turned")
    range_max: float = param(8.0, "m", "it sees no farther", above=0.0, high=1e3)
    fov: float = param(math.pi, "rad", "angle of view", above=0.0, high=2.0 * math.pi)
    p_seen: float = param(0.9, "", "chance that it sees a robot in view", low=0.0, high=1.0)
    p_false: float = param(0.069, "", "share of detections that are none", low=0.0, high=0.99)
    period: float = param(1.0, "s", "between two looks", low=0.05, high=1e4)
    mount: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        if np.shape(self.mount) != (3,) or not np.isfinite(self.mount).all():
            raise ConfigError(f"Spotter.mount must be x, y, θ, got {self.mount}")

    def look(
        self,
        grid: OccupancyGrid,
        t: NDArray[np.float64],
        seer: Poses,
        seen: Poses,
        name: str,
        rng: np.random.Generator,
    ) -> Iterator[Detection]:
        """The detections of a robot by that name, of looks at the stamps t (N,), where the poses of
        the two are seer and seen (N, 3).
        """
        camera = compose(seer, self.mount)
        dx, dy = (seen - camera)[:, :2].T
        d, b = np.hypot(dx, dy), wrap(np.arctan2(dy, dx) - camera[:, 2])
        within = (d <= self.range_max) & (np.abs(b) <= 0.5 * self.fov)
        noise, chance = rng.standard_normal((3, len(t))), rng.random((4, len(t)))
        looked = within & (chance[0] < self.p_seen)
        looked[looked] = in_sight(grid, camera[looked], seen[looked])
        false = chance[1] < self.p_false
        r = np.where(false, self.range_max * chance[2], d + self.sigma_range * noise[0])
        bearing = np.where(false, self.fov * (chance[3] - 0.5), b + self.sigma_bearing * noise[1])
        turned = seen[:, 2] - camera[:, 2] + self.sigma_heading * noise[2]
        turned = np.where(false, 2.0 * math.pi * rng.random(len(t)), turned)
        # A range that the noise makes none is not told.
        for k in np.flatnonzero(looked & (r > 0.0) & (r <= self.range_max)):
            heading = float(wrap(turned[k])) if self.headings else math.nan
            told = float(r[k]), float(wrap(bearing[k])), heading
            yield Detection(float(t[k]), name, *told, mount=np.array(self.mount))


@dataclass(frozen=True, eq=False)
class TeamDrive:
    """What the robots of a team left behind, by name.

    grid: the map. events: of each robot in the order of time, t in seconds from 0 on, on one clock.
    truth: in the map frame.
    """

    grid: OccupancyGrid
    events: Mapping[str, tuple[Event | Detection, ...]]
    truth: Mapping[str, Trajectory]

    def merged(self) -> list[tuple[str, Event | Detection]]:
        """All events in the order of time, each with the robot that it is of."""
        every = [(name, event) for name, events in self.events.items() for event in events]
        return sorted(every, key=lambda of: of[1].t)


def simulate_team(
    world: OccupancyGrid,
    seed: int,
    robots: int = 2,
    scenario: Scenario | None = None,
    spotter: Spotter | None = None,
) -> TeamDrive:
    """Robots 1, 2, … drive through a world, each as `simulate` has it, until the first one is at
    its end. They are no obstacles to each other, nor to their lasers: only cameras see them.

    One seed, the same drives; the first robots of a larger team drive as those of a smaller one.
    Raises ConfigError for a seed < 0, or more or fewer robots than 2 to 10; MapError for a world
    without room to drive.
    """
    if not 2 <= robots <= MOST_ROBOTS:
        raise ConfigError(f"a team has 2 to {MOST_ROBOTS} robots, got {robots}")
    if seed < 0:
        raise ConfigError(f"seed must be a whole number >= 0, got {seed}")
    spotter = spotter or Spotter()
    names = [str(k + 1) for k in range(robots)]
    drives = {}
    for name in names:
        of_robot = np.random.SeedSequence([seed, int(name)]).generate_state(1, np.uint64)
        drives[name] = simulate(world, int(of_robot[0]), scenario)
    end = min(float(drive.truth.t[-1]) for drive in drives.values())
    truth = {name: _until(end, drive.truth) for name, drive in drives.items()}
    t = np.arange(spotter.period, end, spotter.period)
    poses = {name: path.at(t) for name, path in truth.items()}
    events: dict[str, list[Event | Detection]] = {
        name: [event for event in drive.events if event.t <= end] for name, drive in drives.items()
    }
    for seer, seen in permutations(names, 2):
        rng = np.random.default_rng(np.random.SeedSequence([seed, int(seer), int(seen)]))
        events[seer] += spotter.look(world, t, poses[seer], poses[seen], seen, rng)
    ordered = {name: _in_order(of) for name, of in events.items()}
    return TeamDrive(next(iter(drives.values())).grid, ordered, truth)


def in_sight(grid: OccupancyGrid, start: Poses, end: Poses) -> NDArray[np.bool_]:
    """(N,): whether no wall stands between the places of the poses start and end (N, 3)."""
    a, b = grid.to_grid(start)[:, :2].T, grid.to_grid(end)[:, :2].T
    d = np.hypot(*(b - a))
    direction = (b - a) / np.maximum(d, 1e-9)
    farthest = float(d.max(initial=0.0)) + grid.resolution
    hits = first_walls(grid.occupied, grid.resolution, a, direction, farthest)
    clear: NDArray[np.bool_] = hits.length >= d
    return clear


def _until(end: float, path: Trajectory) -> Trajectory:
    within = path.t <= end
    return Trajectory(path.t[within], path.poses[within])


def _in_order(events: Sequence[Event | Detection]) -> tuple[Event | Detection, ...]:
    return tuple(sorted(events, key=lambda event: event.t))
