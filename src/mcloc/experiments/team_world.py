"""Robots of a team that look for themselves in an office: the world of E13 and E22  [Fox01
§19.4.2].
"""

import itertools
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from mcloc.evaluation.convergence import found
from mcloc.evaluation.errors import PoseErrors, pose_errors
from mcloc.events import Detection, Event, Scan
from mcloc.filters.catalog import Composition
from mcloc.localizer import Estimate, Localizer, UpdatePolicy
from mcloc.localizer.localizer import WHEELS
from mcloc.maps.teammates import Teammates
from mcloc.report.history import History
from mcloc.simulation import Laser, Scenario, Spotter, TeamDrive, office_world, simulate_team
from mcloc.team.detection import DetectionModel
from mcloc.team.team import Team
from mcloc.trajectory import Trajectory

ROOMS = 13
LIMIT = 60.0  # s of each drive
SCANS = 2  # of those that the simulator makes, each second one
PARTICLES = 5000
RANDOM = 0.02
LOST, LAST = 1.0, 5.0  # m; s at the end
MOMENTS = np.arange(2.0, LIMIT, 2.0)  # s, of a curve

MCL, MIXTURE = "MCL", "mcloc's mixture"

RING = Laser(beams=8, fov=1.75 * math.pi, range_max=2.0, sigma=0.05, missing=0.05, source="ring")
SCENARIO = Scenario(length=36.0, lasers=(RING,))
SENSOR = {"effective_beams": 3.0, "sigma_hit": 0.3}
POLICY = UpdatePolicy(distance=0.4, angle=0.4)

WORLD = f"""
Robots drive through an office, each for {LIMIT:g} s at up to 0.5 m/s from somewhere to somewhere,
and do not know where they are: {ROOMS} rooms on both sides of a corridor, other ones for each seed.

- *Sensors*: the paper does not tell by what its robots are localized. Here it is a ring of
  {RING.beams} beams that reach {RING.range_max:g} m, with an error of {RING.sigma:g} m; a scan
  counts as {SENSOR["effective_beams"]:g} readings with a deviation of {SENSOR["sigma_hit"]:g} m. By
  a laser that looks 4 m far a robot is found within 2 to 4 m of driving, alone as well: nothing
  would be left to tell. The ring was chosen by four drives, of seeds 1000 to 1003, of robots that
  do not see each other: with it MCL found 3 of 8 within 30 s and 5 within a minute.
- *Detections*: once a second a robot looks for others, and sees one ahead (within 90° to either
  side), within 8 m and in sight with probability 0.9. Ranges and bearings have the paper's mean
  errors, 48.26 cm and 2.2°; 6.9 % of the detections are none and have any range and bearing. The
  model of detections is told these numbers.
- *MCL*: {PARTICLES:,} particles, {100 * RANDOM:g} % of them random, since a robot whose place no
  particle holds would not be found, whoever tells it [Fox99: "a small number"]; no doubt in the
  wheels. *mcloc's mixture* is its default filter with as many particles.
- A team is mcloc's: both messages of a detection from the beliefs before it, each told by
  {DetectionModel().particles:,} poses; repeated sightings of the same pair are ignored within 10 s,
  unless one of the two has moved 2.5 m, and count by what the wheels have made new.
- A robot is *found* at the first moment from which its error stays below 0.5 m and 10° for 3 m. One
  that is not found within {LIMIT:g} s counts as {LIMIT:g} s: means are restricted means, and nobody
  is left out. It is *lost at the end* if its mean error in the last {LAST:g} s is above
  {LOST:g} m.
"""


@lru_cache(maxsize=1)  # runs come seed by seed
def driven(seed: int, robots: int, rooms: int = ROOMS, scenario: Scenario = SCENARIO) -> TeamDrive:
    """What the robots of a team left behind up to LIMIT, with a scan each 0.4 s."""
    drive = simulate_team(office_world(seed, rooms=rooms), seed, robots, scenario, Spotter())
    truth = {
        name: Trajectory(path.t[path.t <= LIMIT], path.poses[path.t <= LIMIT])
        for name, path in drive.truth.items()
    }
    return TeamDrive(drive.grid, {k: _thinned(of) for k, of in drive.events.items()}, truth)


def _thinned(events: tuple[Event | Detection, ...]) -> tuple[Event | Detection, ...]:
    scans = itertools.count()
    return tuple(
        event
        for event in events
        if event.t <= LIMIT and (not isinstance(event, Scan) or next(scans) % SCANS == 0)
    )


def of_first(drive: TeamDrive, n: int) -> TeamDrive:
    """The first n robots of a team, who see each other only."""
    names = list(drive.events)[:n]
    events = {
        name: tuple(
            event
            for event in drive.events[name]
            if not isinstance(event, Detection) or event.seen in names
        )
        for name in names
    }
    return TeamDrive(drive.grid, events, {name: drive.truth[name] for name in names})


def composition(method: str) -> Composition:
    """MCL or MIXTURE, with PARTICLES."""
    settings: dict[str, dict[str, float]] = {"size": {"particles": PARTICLES}, "sensor": SENSOR}
    if method == MIXTURE:
        settings["filter"] = {"particles": PARTICLES}
        return Composition("mixture", size="fixed", settings=settings)
    settings["recovery"] = {"doubt_below": 0.0, "share": RANDOM}
    return Composition("mcl", size="fixed", recovery="random", settings=settings)


@dataclass(frozen=True, eq=False)
class Found:
    """How one robot fared. time: s until it was found, LIMIT where it was not. position: m, its
    error at MOMENTS.
    """

    time: float
    found: bool
    lost: bool
    position: NDArray[np.float64]

    @classmethod
    def of(cls, errors: PoseErrors) -> "Found":
        """From its errors, which begin at 0 s."""
        when = found(errors, [])[0].after_s
        at = np.minimum(np.searchsorted(errors.t, MOMENTS), len(errors.t) - 1)
        end = errors.position[errors.t > errors.t[-1] - LAST]
        return cls(
            LIMIT if when is None else min(when, LIMIT),
            when is not None and when < LIMIT,
            bool(end.mean() > LOST),
            errors.position[at],
        )


@dataclass(frozen=True, eq=False)
class Replay:
    """How all robots of a team fared, by name. used: detections. weighed: particles that were
    weighed by scans. told: those that were pushed or weighed for detections.
    """

    robots: Mapping[str, Found]
    used: int
    weighed: int
    told: int


def replayed(drive: TeamDrive, method: str, seed: int, detections: bool) -> Replay:
    """Localize a team from nothing, with or without what its robots see of each other."""
    localizers = {
        name: Localizer(
            drive.grid,
            composition(method),
            aids=(Teammates(),),
            seed=1000 * seed + int(name),
            policy=POLICY,
        )
        for name in drive.events
    }
    team = Team(localizers)
    histories = {name: History() for name in drive.events}
    weighed = told = 0
    for name, estimate in estimates(team, drive, detections):
        histories[name].add(estimate)
        if estimate.updated and isinstance(estimate.measurement, Scan):
            weighed += estimate.update.info.weighed
        elif estimate.updated and estimate.measurement.source != WHEELS:
            told += estimate.update.info.weighed + team.model.particles
    found = {
        name: Found.of(pose_errors(history.trajectory, drive.truth[name]))
        for name, history in histories.items()
    }
    return Replay(found, team.used, weighed, told)


def estimates(team: Team, drive: TeamDrive, detections: bool) -> Iterator[tuple[str, Estimate]]:
    """What a team finds, with whose it is."""
    for name, event in drive.merged():
        if detections or not isinstance(event, Detection):
            yield from team.process(name, event)
    yield from team.finish()
