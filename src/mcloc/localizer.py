"""The runtime that a user drives: events in, in order of time; estimates out."""

import secrets
import time
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcloc.density import Gaussian
from mcloc.draws import Draws
from mcloc.errors import ConfigError
from mcloc.estimate import Hypothesis, hypotheses
from mcloc.events import Event, Odometry, Scan
from mcloc.filters.catalog import Composition
from mcloc.filters.particle_filter import Belief, StepInfo
from mcloc.geometry import Pose, between, compose, transported
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.odometry_buffer import OdometryBuffer
from mcloc.registry import Configurable, param

INITIAL_SIGMA = (0.5, 0.5, float(np.deg2rad(15.0)))  # m, m, rad
FAR = 1e6  # m; no map reaches there
LEAST_NOVELTY = 0.05  # of a scan from the same place: the sensor's own noise is new


@dataclass(frozen=True)
class UpdatePolicy(Configurable):
    """When a scan is used: after the robot has moved this far or turned this much since the last
    one.
    """

    distance: float = param(0.2, "m", "update after driving this far", low=0)
    angle: float = param(0.2, "rad", "update after turning this far", low=0)
    decorrelation: float = param(
        0.5, "m", "drive (or m·rad turn) after which a scan is news", above=0
    )

    def due(self, u: NDArray[np.float64]) -> bool:
        """Whether the move u (dx, dy, dθ) is enough."""
        return bool(np.hypot(u[0], u[1]) >= self.distance or abs(u[2]) >= self.angle)

    def novelty(self, u: NDArray[np.float64]) -> float:
        """How much of a scan after the move u is news, LEAST_NOVELTY … 1.

        Scans from nearly the same place meet the same people, doors and errors of the map: ten
        scans on one metre say little more than two.
        """
        moved = np.hypot(u[0], u[1]) + self.decorrelation * abs(u[2])
        return float(np.clip(moved / self.decorrelation, LEAST_NOVELTY, 1.0))


@dataclass(frozen=True, eq=False, slots=True)
class Update:
    """What the filter found at its last update.

    info: of the filter's step. hypotheses: at the time of the update. explained: share of the
    scan's returns that end near a wall at the best hypothesis, NaN without returns. duration:
    seconds of computing.
    """

    info: StepInfo
    hypotheses: tuple[Hypothesis, ...]
    explained: float
    duration: float


@dataclass(frozen=True, eq=False, slots=True)
class Estimate:
    """Where the robot is at the stamp of a scan, map frame.

    t: seconds. hypotheses: most likely first, carried along by odometry since the update. update:
    the last one. updated: whether it was made with this very scan.
    """

    t: float
    hypotheses: tuple[Hypothesis, ...]
    update: Update
    updated: bool

    @property
    def pose(self) -> Pose:
        """(3,): the most likely hypothesis; m, m, rad."""
        return self.hypotheses[0].mean

    @property
    def covariance(self) -> NDArray[np.float64]:
        """(3, 3): of that hypothesis."""
        return self.hypotheses[0].covariance


class Localizer:
    """Localizes one robot on one map.

    grid: the map. filter: a name of the catalog or a Composition of parts. seed: 0 … 2⁶⁴ − 1; None
    takes a fresh one, to be read from `seed`. initial: (3,) start pose in the map frame (m, m,
    rad), or None to start from nothing (global localization). initial_sigma: (3,) its standard
    deviations. Raises McLocError for anything that cannot be right.
    """

    def __init__(
        self,
        grid: OccupancyGrid,
        filter: str | Composition = "mcl",
        *,
        seed: int | None = None,
        initial: ArrayLike | None = None,
        initial_sigma: ArrayLike = INITIAL_SIGMA,
        policy: UpdatePolicy | None = None,
    ) -> None:
        composition = Composition(filter=filter) if isinstance(filter, str) else filter
        self.grid = grid
        self.seed = secrets.randbits(32) if seed is None else seed
        self.policy = policy or UpdatePolicy()
        self.filter = composition.build(grid)
        self.ignored: Counter[str] = Counter()
        start = (
            self.filter.environment
            if initial is None
            else start_density(grid, initial, initial_sigma)
        )
        self.belief: Belief = self.filter.start(start, Draws(self.seed))
        self._step = 0
        self._odometry = OdometryBuffer()
        self._waiting: list[Scan] = []
        self._last_scan = -np.inf
        self._updated_at: Pose | None = None
        self._update: Update | None = None
        self._forced = False

    def run(self, events: Iterable[Event]) -> Iterator[Estimate]:
        """An estimate for each usable scan, in order."""
        for event in events:
            yield from self.process(event)
        yield from self.finish()

    def process(self, event: Event) -> list[Estimate]:
        """Take one event in; the estimates that it makes possible.

        A scan without an odometry pose of its own waits for the first odometry at or after its
        stamp. Events that come late, twice or broken are left out and counted in `ignored`.
        """
        if isinstance(event, Odometry):
            reason = self._odometry.add(event)
            if reason:
                self.ignored[reason] += 1
            return self._release()
        reason = self._unusable(event)
        if reason:
            self.ignored[reason] += 1
            return []
        self._last_scan = event.t
        self._waiting.append(event)
        return self._release()

    def finish(self) -> list[Estimate]:
        """Estimates for the scans that still wait; they take the last odometry there is."""
        return self._release(final=True)

    def force_update(self) -> None:
        """Use the next scan whether the robot has moved or not."""
        self._forced = True

    def _unusable(self, scan: Scan) -> str:
        """Why a scan is left out, or nothing."""
        if not np.isfinite(scan.t):
            return "scan stamp not finite"
        if scan.t == self._last_scan:
            return "duplicate scan"
        if scan.t < self._last_scan:
            return "late scan"
        if scan.odometry is not None and not np.isfinite(scan.odometry).all():
            return "odometry not finite"
        if not scan.returned.any():
            return "scan without returns"
        return ""

    def _release(self, final: bool = False) -> list[Estimate]:
        """Process the waiting scans whose odometry is known by now."""
        done = []
        while self._waiting:
            scan = self._waiting[0]
            at = scan.odometry if scan.odometry is not None else self._odometry.at(scan.t, final)
            if at is None and not final:
                break
            self._waiting.pop(0)
            if at is None:
                self.ignored["scan without odometry"] += 1
            else:
                done.append(self._localize(scan, at))
        return done

    def _localize(self, scan: Scan, at: Pose) -> Estimate:
        """Update if due, and carry the hypotheses along the odometry otherwise."""
        u = np.zeros(3) if self._updated_at is None else between(self._updated_at, at)
        due = self._update is None or self._forced or self.policy.due(u)
        if due:
            novelty = 1.0 if self._update is None else self.policy.novelty(u)
            self._update = self._measure(replace(scan, novelty=novelty), u)
            self._updated_at, self._forced = at, False
            u = np.zeros(3)
        assert self._update is not None
        moved = tuple(_carried(h, u) for h in self._update.hypotheses)
        return Estimate(scan.t, moved, self._update, due)

    def _measure(self, scan: Scan, u: NDArray[np.float64]) -> Update:
        began = time.perf_counter()
        self._step += 1
        self.belief, info = self.filter.step(self.belief, u, scan, Draws(self.seed, self._step))
        found = hypotheses(self.belief.particles, self.filter.space)
        best = np.ascontiguousarray(found[0].mean[:, None])
        explained = float(self.filter.sensor.explained(best, scan)[0])
        return Update(info, found, explained, time.perf_counter() - began)


def start_density(grid: OccupancyGrid, pose: ArrayLike, sigma: ArrayLike) -> Gaussian:
    """The belief of somebody who was told a pose. Raises ConfigError where a robot cannot stand."""
    mean, deviation = np.asarray(pose, dtype=np.float64), np.asarray(sigma, dtype=np.float64)
    if mean.shape != (3,) or not (np.abs(mean) < FAR).all():
        raise ConfigError(f"the initial pose must be three finite numbers x, y, θ, got {pose!r}")
    if deviation.shape != (3,) or not ((deviation > 0) & (deviation < FAR)).all():
        raise ConfigError(f"the initial sigma must be three numbers > 0 (m, m, rad), got {sigma!r}")
    place = grid.state_at(mean)
    if place in ("outside", "occupied"):
        where = "outside the map" if place == "outside" else "inside a wall"
        raise ConfigError(
            f"the initial pose ({mean[0]:g}, {mean[1]:g}) m is {where} {grid.name}, "
            f"which covers {grid.extent()}"
        )
    return Gaussian(mean, deviation)


def _carried(h: Hypothesis, u: NDArray[np.float64]) -> Hypothesis:
    """A hypothesis after the move u, its covariance turned along; the noise of the move waits for
    the next update.
    """
    if not u.any():
        return h
    return replace(h, mean=compose(h.mean, u), covariance=transported(h.mean, h.covariance, u))
