"""Kidnappings in a recorded log: the robot is carried off at random, to another moment of the log.

P(carried off within d metres of true path) = 1 − exp(−λ d), wherever the robot is. What it reports
is what was recorded; only stamps and the frame of the odometry are changed, so that neither tells
that anything happened.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from mcloc.errors import ConfigError
from mcloc.evaluation.errors import STAMP_TOLERANCE
from mcloc.events import Event, Odometry
from mcloc.geometry import Pose, Poses, compose, inverse
from mcloc.simulation.moments import Recording, Stretch
from mcloc.trajectory import Trajectory

ROUNDING = 1e-6  # m, of a path that is a sum of many steps


@dataclass(eq=False)
class Teleported:
    """A log with kidnappings; iterate over it as over any log.

    events: in the order of their stamps. truth: in the map frame, as the references have it.
    kidnappings: the stamps of the first scans in a new place, seconds. path: what it is, in words.
    skipped: nothing; what the recorded log left out, that log tells.
    """

    events: tuple[Event, ...]
    truth: Trajectory
    kidnappings: tuple[float, ...]
    path: str = "a log with kidnappings"
    skipped: dict[str, int] = field(default_factory=dict)

    def __iter__(self) -> Iterator[Event]:
        return iter(self.events)


def teleported(
    log: Iterable[Event],
    truth: Trajectory,
    seed: int,
    per_metre: float = 0.01,
    away: float = 5.0,
    length: float | None = None,
) -> Teleported:
    """The drive of a log, with kidnappings of which the odometry knows nothing.

    log: its events, taken in the order of their stamps. truth: its references, map frame. seed: one
    seed, the same drive. per_metre: λ, kidnappings per metre of true path, 0 … below 1. away:
    metres, at least so far the robot is carried. length: metres of true path in all; by default as
    long as the log's own. Where the log ends before, the robot is carried off there too.

    Moments are scans, of any laser, that the truth covers with a reference within 0.5 s. The drive
    begins at the first one. The robot leaves at the first moment at or after the drawn distance,
    and is carried to one of those that are far enough away, each as likely as the true path from
    there to the next one is long: so everywhere along the path is equally likely, and nobody
    arrives where the robot only stood. The next event is the scan of that moment, one median scan
    interval later. The wheels stood still meanwhile: the odometry is turned and moved to go on from
    the pose at which it was. Where scans carry none of their own, both moments get an Odometry.

    The true path is the straight way from reference to reference. Over a gap of more than 3 m
    between two of them the way is not known: it counts no metre, and the robot is neither carried
    off nor put down within. A kidnapping that the log itself holds stays in it, and is not listed.

    Raises ConfigError for arguments that cannot be right, and where no moment is far enough away;
    LogError for a log without scans or without odometry; TruthError for a truth that does not
    overlap the log, or does not move along it.
    """
    _check(seed, per_metre, away, length)
    recording = Recording(sorted(log, key=lambda event: event.t), truth)
    stretches = _stretches(recording, np.random.default_rng(seed), per_metre, away, length)
    return _joined(recording, stretches)


def _stretches(
    recording: Recording,
    rng: np.random.Generator,
    per_metre: float,
    away: float,
    length: float | None,
) -> list[Stretch]:
    """Which parts of the log are driven, one after the other."""
    path, end = recording.path, len(recording.path) - 1
    left = float(path[-1]) if length is None else length
    first = 0
    stretches: list[Stretch] = []
    while True:
        carried_off = rng.exponential(1.0 / per_metre) if per_metre > 0.0 else np.inf
        done, last = np.searchsorted(path, path[first] + np.array([left - ROUNDING, carried_off]))
        done, last = max(int(done), first), min(max(int(last), first), end)
        if done <= last:
            return [*stretches, Stretch(first, done)]
        stretches.append(Stretch(first, last))
        left -= float(path[last] - path[first])
        first = _elsewhere(recording, last, away, rng)


def _elsewhere(recording: Recording, here: int, away: float, rng: np.random.Generator) -> int:
    """The moment that a robot which is carried off is carried to."""
    x, y = recording.places[here]
    distance = np.hypot(recording.places[:, 0] - x, recording.places[:, 1] - y)
    likely = np.where(distance >= away, np.append(np.diff(recording.path), 0.0), 0.0)
    total = np.cumsum(likely)
    if total[-1] == 0.0:
        raise ConfigError(
            f"away = {away:g} m: the log goes nowhere so far from x = {x:.2f}, y = {y:.2f} m, "
            "where the robot is carried off; give a smaller one"
        )
    return int(np.searchsorted(total, rng.random() * total[-1], side="right"))


def _joined(recording: Recording, stretches: list[Stretch]) -> Teleported:
    """The stretches on one clock and in one odometry frame."""
    events: list[Event] = []
    stamps: list[NDArray[np.float64]] = []
    truth: list[Poses] = []
    kidnappings: list[float] = []
    frame = np.zeros(3)  # of the log's odometry, in that of the drive
    now = recording.scan(0).t  # of the drive
    for k, stretch in enumerate(stretches):
        begin, end = recording.scan(stretch.first).t, recording.scan(stretch.last).t
        if k > 0:
            now += recording.scan_interval
            left_at = compose(frame, recording.odometry(stretches[k - 1].last))
            frame = compose(left_at, inverse(recording.odometry(stretch.first)))
        later = now - begin
        if k > 0:
            kidnappings.append(begin + later)
        events += _moved(recording.within(stretch), later, frame)
        reference = recording.truth
        part = (reference.t >= begin - STAMP_TOLERANCE) & (reference.t <= end + STAMP_TOLERANCE)
        stamps.append(reference.t[part] + later)
        truth.append(reference.poses[part])
        now = end + later
    return Teleported(
        tuple(events), Trajectory(np.concatenate(stamps), np.concatenate(truth)), tuple(kidnappings)
    )


def _moved(events: list[Event], later: float, frame: Pose) -> Iterator[Event]:
    """The same events, some seconds later, with their odometry in another frame."""
    told = [event.pose if isinstance(event, Odometry) else event.odometry for event in events]
    poses = iter(compose(frame, np.array([pose for pose in told if pose is not None])))
    for event, pose in zip(events, told, strict=True):
        t = event.t + later
        if isinstance(event, Odometry):
            yield Odometry(t, next(poses))
        else:
            yield replace(event, t=t, odometry=None if pose is None else next(poses))


def _check(seed: int, per_metre: float, away: float, length: float | None) -> None:
    if seed < 0:
        raise ConfigError(f"seed must be a whole number >= 0, got {seed}")
    if not 0.0 <= per_metre < 1.0:
        raise ConfigError(f"per_metre, kidnappings, must be from 0 to below 1, got {per_metre}")
    if not (0.0 <= away < np.inf):
        raise ConfigError(f"away must be a number of metres >= 0, got {away}")
    if length is not None and not (0.0 < length < np.inf):
        raise ConfigError(f"length must be a number of metres > 0, got {length}")
