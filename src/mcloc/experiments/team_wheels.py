"""Three robots in a small office, two of which have their wheels and what they are told: the world
of E23.
"""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mcloc.events import Odometry, Scan
from mcloc.experiments.team_world import POLICY, SCENARIO, SENSOR, driven
from mcloc.filters.catalog import Composition
from mcloc.geometry import Pose, wrap
from mcloc.localizer import Localizer
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.maps.teammates import Teammates
from mcloc.particles import Particles
from mcloc.simulation import TeamDrive, Wheels
from mcloc.team.detection import DetectionModel
from mcloc.team.policy import TeamPolicy
from mcloc.team.team import Team

ROBOTS, LEADER, ROOMS = 3, "1", 5
PARTICLES = 2000
SIGMA = (0.3, 0.3, 0.1)  # m, m, rad: how well they are told where they start
MOMENTS = np.arange(4.0, 60.0, 2.0)  # s
LEVEL = 0.95
WHEELS = Wheels(scale=0.0, drift=0.0, sigma_distance=0.1, sigma_turn=0.06, sigma_drift=0.05)
STEP = POLICY.coast  # m and rad between two steps of a filter that follows its wheels

_ROOT = math.sqrt(STEP)  # the model's deviations grow with a step, those of wheels with its root
MOTION = {
    "alpha1": WHEELS.sigma_turn / _ROOT,
    "alpha2": WHEELS.sigma_drift / _ROOT / math.sqrt(2.0),  # there are two turns in a step
    "alpha3": WHEELS.sigma_distance / _ROOT,
    "alpha4": 0.0,
    "sigma_rot_min": 0.002,
    "sigma_trans_min": 0.002,
}

Told = tuple[float, float, float]


def composition() -> Composition:
    """MCL that knows its wheels, and believes nothing but its models: no random particles."""
    return Composition(
        "mcl",
        size="fixed",
        recovery="none",
        settings={
            "size": {"particles": PARTICLES},
            "recovery": {"doubt_below": 0.0},
            "sensor": SENSOR,
            "motion": MOTION,
        },
    )


def drive_of(seed: int) -> TeamDrive:
    """Three robots with bad wheels, whose errors are all random."""
    return driven(seed, ROBOTS, ROOMS, replace(SCENARIO, wheels=WHEELS))


def followed(seed: int, leads: bool, policy: TeamPolicy | None) -> list[Told]:
    """(covered, NEES, error in m) of the two that follow, at MOMENTS. leads: whether the leader has
    its sensor. policy: None where they tell each other nothing.
    """
    drive = drive_of(seed)
    rng = np.random.default_rng([seed, 23])
    localizers = {
        name: Localizer(
            drive.grid,
            composition(),
            aids=(Teammates(),),
            seed=1000 * seed + int(name),
            initial=start(drive.grid, path.poses[0], rng),
            initial_sigma=SIGMA,
            policy=POLICY,
        )
        for name, path in drive.truth.items()
    }
    team = Team(localizers, DetectionModel(particles=PARTICLES), policy)
    due = {name: MOMENTS.tolist() for name in localizers if name != LEADER}
    found = []
    for name, event in drive.merged():
        if isinstance(event, Scan) and not (leads and name == LEADER):
            continue
        if isinstance(event, Odometry | Scan) or policy is not None:
            team.process(name, event)
        if isinstance(event, Odometry) and due.get(name) and event.t >= due[name][0]:
            due[name].pop(0)
            truth = drive.truth[name].at(np.array([event.t]))[0]
            found.append(judged(localizers[name].predicted(event.pose), truth))
    return found


def start(grid: OccupancyGrid, truth: Pose, rng: np.random.Generator) -> Pose:
    """(3,): what a robot is told of its start, where it can stand."""
    while True:
        pose: Pose = truth + np.array(SIGMA) * rng.standard_normal(3)
        if grid.state_at(pose) == "free":
            return pose


def judged(particles: Particles, truth: Pose) -> Told:
    """Whether the truth lies in the ellipsoid around the mean that holds LEVEL of the particles,
    shaped as their covariance; its NEES; and how far the mean is from it, m.

    Of a truth that is drawn from the belief, the first holds with probability LEVEL and the mean of
    the second is 3, whatever shape the belief has.
    """
    w, x = particles.weights, particles.states
    mean = x @ w
    mean[2] = math.atan2(np.sin(x[2]) @ w, np.cos(x[2]) @ w)
    d = np.column_stack([x - mean[:, None], truth - mean])
    d[2] = wrap(d[2])
    covariance: NDArray[np.float64] = (w * d[:, :-1]) @ d[:, :-1].T + 1e-12 * np.eye(3)
    far = np.einsum("in,in->n", d, np.linalg.solve(covariance, d))
    nearer = w[far[:-1] < far[-1]].sum()
    return float(nearer < LEVEL), float(far[-1]), float(np.hypot(*d[:2, -1]))
