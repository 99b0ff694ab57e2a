"""Localizer: events in, in order of time; estimates out."""

import operator
import secrets
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcloc.draws import Draws
from mcloc.estimate import Hypothesis
from mcloc.events import Event, Measurement, Odometry
from mcloc.filters.catalog import Composition
from mcloc.filters.filter import Belief, Filter
from mcloc.geometry import Pose, between
from mcloc.localizer.estimate import Estimate, Update, carried
from mcloc.localizer.given_pose import covariance_of, given_pose
from mcloc.localizer.pace import Offline, Pace
from mcloc.localizer.policy import UpdatePolicy
from mcloc.localizer.queue import LATENCY, Queue
from mcloc.localizer.record import Records, noted, told
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.particles import Particles
from mcloc.protocols import Density
from mcloc.sensors.messages import silence

INITIAL_SIGMA = (0.5, 0.5, float(np.deg2rad(15.0)))  # m, m, rad
NOTHING = 1e-6  # readings: a measurement that is worth no more tells nothing of the place
PREDICTED = 3 << 16  # part of the random numbers; a filter's are less
WHEELS = "wheels"  # the source of messages that say nothing


class Localizer:
    """Localizes one robot on one map, by all of its sensors.

    grid: the map. filter: a name of the catalog or a Composition of parts. aids: maps of what else
    its sensors see, such as Landmarks. seed: 0 … 2⁶⁴ − 1; None takes a fresh one, to be read from
    `seed`. initial: (3,) start pose in the map frame (m, m, rad), or None to start from nothing
    (global localization). initial_sigma: (3,) its standard deviations. Raises McLocError for
    anything that cannot be right.

    Each sensor has its own test of whether the robot has moved far enough for its next scan or
    image to be used; `policy` says how far. Sightings of landmarks are all used. `pace` says how
    long the filter is then busy: scans that it would have used meanwhile are lost, and counted in
    `ignored`; None loses none. Call `set_pose`, `start_globally`, `force_update` and `swap_map`
    between two events. `belief` makes one to go on with instead of a start: not every filter can
    start from nothing. `withheld` are the measurements of the last event for which the filter told
    no pose: the stamp of each, and the wheels' pose. `record` is how well each sensor has fitted;
    `told_start`, whether the belief began at a pose that somebody said.
    """

    def __init__(
        self,
        grid: OccupancyGrid,
        filter: str | Composition = "mixture",
        *,
        aids: Sequence[Any] = (),
        seed: int | None = None,
        initial: ArrayLike | None = None,
        initial_sigma: ArrayLike = INITIAL_SIGMA,
        policy: UpdatePolicy | None = None,
        pace: Pace | None = None,
        belief: Callable[[Filter[Any]], Belief] | None = None,
    ) -> None:
        self.composition = Composition(filter=filter) if isinstance(filter, str) else filter
        self.grid, self.aids = grid, tuple(aids)
        self.seed = secrets.randbits(32) if seed is None else operator.index(seed)
        self.policy = policy or UpdatePolicy()
        self.pace = pace or Offline()
        self.filter = self.composition.build(grid, *self.aids)
        self._motion = self.composition.motion_model()
        self.ignored: Counter[str] = Counter()
        self.withheld: list[tuple[float, Pose]] = []
        self.step = 0  # of the random numbers; each start and each update takes one
        self.update: Update | None = None
        self.hypotheses: tuple[Hypothesis, ...] = ()  # of the last estimate
        self.record: Records = {}
        self._beacons_alone = True  # so far: nothing conclusive has been used
        self._queue = Queue(self.ignored)
        self._used_at: dict[str, Pose] = {}  # by laser: odometry at its last scan that was used
        self._stepped_at: Pose | None = None  # odometry at the filter's last step
        self._forced = False
        self._busy_until = -np.inf  # s, in the time of the log
        self._warm = False
        self.told_start = initial is not None
        if belief is not None:
            self.belief = belief(self.filter)
        elif initial is None:
            self.belief = self._started(self.filter.environment)
        else:
            covariance = covariance_of(initial_sigma)
            self.belief = self._started(given_pose(grid, "initial pose", initial, covariance))

    def run(self, events: Iterable[Event]) -> Iterator[Estimate]:
        """An estimate for each usable scan, in order."""
        for event in events:
            yield from self.process(event)
            if self.aids and isinstance(event, Odometry):
                yield from self.follow(event.t - LATENCY)
        yield from self.finish()

    def process(self, event: Event) -> list[Estimate]:
        """Take one event in; the estimates that it makes possible.

        A scan without an odometry pose of its own waits for the first odometry at or after its
        stamp, and one of several lasers for the others, up to a second. Events that come late,
        twice or broken are left out and counted in `ignored`.
        """
        self.withheld = []
        if isinstance(event, Odometry):
            self._queue.wheels.add(event)
        elif self._queue.add(event):
            self._busy_until = -np.inf
        return self._release()

    def finish(self) -> list[Estimate]:
        """Estimates for the scans that still wait; they take the last odometry there is."""
        self.withheld = []
        self._queue.finish()
        return self._release(final=True)

    def catch_up(self, t: float) -> list[Estimate]:
        """Process what waits with a stamp up to t and has its odometry, whatever other sensors may
        still bring.
        """
        self.withheld = []
        self._queue.hasten(t)
        return self._release(until=t)

    def follow(self, t: float) -> list[Estimate]:
        """A step by the wheels alone up to t, and the estimates of what waited with a stamp up to
        t; nothing where the robot has moved less than its policy's `coast` since the last step.

        A robot that measures nothing for minutes must not be as sure of its place after a loop as
        after a straight line: the noise of a move is that of its pieces.
        """
        idle = self.placed and t > self.done and t >= self._busy_until
        if not idle or not self._coasted(t):
            return []
        # A sighting after minutes without any waits for the next one, to be confirmed by its stamp.
        found = self.catch_up(t)
        if t > self.done and self._coasted(t):
            at = self.wheels_at(t)
            assert at is not None
            told = self.take(silence(t, WHEELS), at)
            found += [] if told is None else [told]
        return found

    def take(self, z: Measurement, at: Pose) -> Estimate | None:
        """Take in what was measured when the wheels were at `at` (3,), at once: by somebody who
        knows that the stamp is right, and that nothing older will come. None where it is too late,
        which is counted in `ignored`, or while the filter withholds its estimate.
        """
        self.withheld = []
        if z.t < self.done:
            self.ignored[f"late {z.called}"] += 1
            return None
        return self._localize(z, at)

    def predicted(self, at: Pose) -> Particles:
        """What is believed of the robot when its wheels are at `at` (3,), before anything is
        measured there: p(x_t | d_{0…t−1}, u_t), map frame.
        """
        particles = self.belief.particles
        u = np.zeros(3) if self._stepped_at is None else between(self._stepped_at, at)
        if not u.any():
            return particles
        draws = self.draws(PREDICTED)
        states = self._motion.sample(particles.states, u, draws, 0)
        prior = self.filter.environment.log_prior(states)
        return Particles.normalized(states, particles.log_weights + prior)

    def draws(self, part: int) -> Draws:
        """The random numbers of a part of the next step that is no part of the filter."""
        return Draws(self.seed, self.step, part)

    def wheels_at(self, t: float) -> Pose | None:
        """(3,): their pose at t, odometry frame; None where it is not known."""
        return self._queue.wheels.at(t)

    @property
    def wheels_until(self) -> float:
        """Seconds: the newest stamp of the odometry, −inf before the first one."""
        return self._queue.wheels.guard.newest

    def wheels_reach(self, t: float) -> bool:
        """Whether nothing more will be known of them at t."""
        return self._queue.wheels.reaches(t)

    @property
    def placed(self) -> bool:
        """Whether anything is known of the place: a start pose, or something that was measured."""
        return self.told_start or self.update is not None

    @property
    def done(self) -> float:
        """Seconds: what has an earlier stamp comes too late; −inf where the wheels' clock was set
        back.
        """
        return self._queue.late_before

    def moved_since_step(self, at: Pose) -> Pose | None:
        """(3,): the move from the filter's last step to `at`; None before the first one."""
        return None if self._stepped_at is None else between(self._stepped_at, at)

    def set_pose(self, pose: ArrayLike, covariance: ArrayLike) -> None:
        """Believe somebody who says where the robot will be at its next scan, which is then used.

        pose: (3,) in the map frame, m, m, rad. covariance: (3, 3) of x, y, θ. Raises ConfigError
        where no robot can stand, or where the covariance is none.
        """
        self._restart(given_pose(self.grid, "pose", pose, covariance))

    def start_globally(self) -> None:
        """Forget the pose and search for the robot on the whole map, from its next scan on."""
        self._restart(self.filter.environment)

    def force_update(self) -> None:
        """Use the next scan that finds the filter free, whether the robot has moved or not."""
        self._forced = True

    def swap_map(self, grid: OccupancyGrid) -> None:
        """Go on with another map of the same frame; the belief is kept.

        How well scans fit is learned anew: likelihoods on two maps do not compare.
        """
        self.filter = self.composition.build(grid, *self.aids)
        self.grid = grid
        self.belief = self.filter.adopted(self.belief)

    def told(self, z: Measurement) -> Measurement:
        """A measurement with what is known by now of the sensors that it comes from."""
        return told(z, self.record, self._beacons_alone)

    def _coasted(self, t: float) -> bool:
        """Whether it is known to have moved far by t, or where it started is all that is known."""
        at = self.wheels_at(t)
        if at is None:
            return False
        moved = self.moved_since_step(at)
        return moved is None or self.policy.coasted(moved)

    def _restart(self, density: Density) -> None:
        self.belief = self._started(density)
        self.told_start = density is not self.filter.environment
        self.update, self._stepped_at, self._forced = None, None, False
        self._busy_until = -np.inf
        self._used_at.clear()

    def _started(self, density: Density) -> Belief:
        belief: Belief = self.filter.start(density, Draws(self.seed, self.step))
        self.step += 1
        return belief

    def _release(self, final: bool = False, until: float = -np.inf) -> list[Estimate]:
        """Process the waiting measurements whose odometry is known by now; up to `until` without
        regard to what other sensors may bring.
        """
        done = []
        for z, at in self._queue.ready(final, until):
            estimates = [self._localize(part, at) for part in self._parts(z)]
            done += [estimate for estimate in estimates if estimate is not None]
        return done

    def _parts(self, z: Measurement) -> list[Measurement]:
        """What is measured apart: each beacon by itself, so that a bad one is found out; but for
        the first ranges after a start, since several of them tell a place and one of them does not.
        """
        if self.update is None:
            return [z]
        each: list[Measurement] = list(z.parts())
        useful = [one for one in each if one.useful]
        if len(useful) < len(each):
            self.ignored[z.empty] += len(each) - len(useful)
        return useful

    def _localize(self, z: Measurement, at: Pose) -> Estimate | None:
        """Update if due and free to, and carry the hypotheses along the odometry otherwise. None
        while the filter withholds its estimate.
        """
        self._queue.done = z.t
        u = np.zeros(3) if self._stepped_at is None else between(self._stepped_at, at)
        last = self._used_at.get(z.source)
        moved = None if last is None or not z.repeats else between(last, at)
        doubtful = self.update is not None and self.update.info.doubt > 0.0
        due = moved is None or self._forced or not z.repeats or self.policy.due(moved, doubtful)
        if due and z.t < self._busy_until:
            self.ignored[f"{z.called} while the filter was busy"] += 1
            due = False
        if due:
            news = z.novelty if moved is None else self.policy.novelty(moved)
            self._beacons_alone &= not z.conclusive
            self.update = self._measure(self.told(replace(z, novelty=news)), u)
            noted(self.record, z, news, self.update, self.filter.sensor)
            if self.filter.sensor.readings(z) <= NOTHING:
                self.ignored[f"{z.called} that tells nothing"] += 1
            beams = self.filter.sensor.beams(z)
            self._busy_until = z.t + self.pace.seconds(self.update, beams)
            self._stepped_at = at
            self._used_at.update(dict.fromkeys([z.source, *(one.source for one in z.parts())], at))
            self._forced = False
            u = np.zeros(3)
        assert self.update is not None  # the first measurement after a start is always used
        self.hypotheses = tuple(carried(h, u) for h in self.update.hypotheses)
        if not self.hypotheses:
            self.ignored[f"{z.called} while the filter withheld its estimate"] += 1
            self.withheld.append((z.t, at))
            return None
        return Estimate(z, at, self.hypotheses, self.update, due)

    def _measure(self, z: Measurement, u: NDArray[np.float64]) -> Update:
        """A step of the filter, and how long it takes. A pace that goes by that has the first one
        made twice: its time is that of loading the kernels, or of compiling them (7 s).
        """
        for _ in range(2 if self.pace.clocked and not self._warm else 1):
            began = time.perf_counter()
            belief, info = self.filter.step(self.belief, u, z, Draws(self.seed, self.step))
            found = self.filter.hypotheses(belief)
            explained = float("nan")
            if found:
                best = np.ascontiguousarray(found[0].mean[:, None])
                explained = float(self.filter.sensor.explained(best, z)[0])
            took = time.perf_counter() - began
        self.belief, self._warm = belief, True
        self.step += 1
        return Update(self.step - 1, info, belief.particles, found, explained, took)
