"""CARMEN logs, in metres, radians and seconds: `message … ipc_timestamp host logger_timestamp`.

    ODOM x y theta tv rv accel
    FLASER n [ranges] laser_x laser_y laser_theta robot_x robot_y robot_theta
    RLASER (the same, of a laser at the back)
    ROBOTLASER1 type start_angle field_of_view angular_resolution maximum_range accuracy
        remission_mode n [ranges] m [remissions] laser_x laser_y laser_theta
        robot_x robot_y robot_theta tv rv forward_safety side_safety turn_axis
    PARAM name value

An event's stamp is the ipc_timestamp: when it was measured, not when the logger got round to it.
Other messages are skipped and counted.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import lru_cache, partial

import numpy as np
from numpy.typing import NDArray

from mcloc.events import Event, Odometry, Scan
from mcloc.geometry import Pose
from mcloc.io import messages
from mcloc.io.messages import Fields, Format, Parser, Skipped, count, expect, floats, mount_of
from mcloc.io.sick import RANGE_MAX, beam_angles
from mcloc.textfile import TextFile

MESSAGES = frozenset(
    ["FLASER", "RLASER", "ROBOTLASER1", "ROBOTLASER2", "RAWLASER1", "RAWLASER2", "ODOM", "PARAM"]
)
COINCIDE = 1e-6  # m, rad: the logs' own precision


@dataclass(frozen=True)
class _Side:
    """One of the two lasers: its name, what PARAM lines call it, and where it faces unless they
    tell.
    """

    name: str
    offset: str
    range_max: str
    facing: float


_FRONT = _Side("front", "robot_frontlaser", "robot_front_laser_max", 0.0)
_REAR = _Side("rear", "robot_rearlaser", "robot_rear_laser_max", np.pi)


@dataclass
class _Carmen:
    """The parsers of the messages, and what PARAM lines have said so far."""

    params: dict[str, str] = field(default_factory=dict)

    @property
    def parsers(self) -> dict[str, Parser]:
        return {
            "FLASER": partial(self.laser, _FRONT),
            "RLASER": partial(self.laser, _REAR),
            "ROBOTLASER1": self.robot_laser,
            "ODOM": self.odom,
            "PARAM": self.param,
        }

    def param(self, fields: Fields) -> None:
        self.params[fields[0]] = fields[1]

    def odom(self, fields: Fields) -> Odometry:
        expect(fields, 9)
        return Odometry(float(fields[6]), floats(fields[:3]))

    def laser(self, side: _Side, fields: Fields) -> Scan:
        n = count(fields[0])
        expect(fields, n + 10)
        tail = fields[n + 1 :]
        robot = floats(tail[3:6])
        return Scan(
            t=float(tail[6]),
            ranges=floats(fields[1 : n + 1]),
            angles=beam_angles(n),
            range_max=_range_max(self._number(side.range_max, RANGE_MAX)),
            mount=self._mount(side, floats(tail[:3]), robot),
            odometry=robot,
            source=side.name,
        )

    def robot_laser(self, fields: Fields) -> Scan:
        n = count(fields[7])
        m = count(fields[n + 8])
        expect(fields, n + m + 23)
        tail = fields[n + m + 9 :]
        robot = floats(tail[3:6])
        return Scan(
            t=float(tail[11]),
            ranges=floats(fields[8 : n + 8]),
            angles=_angles(n, float(fields[1]), float(fields[3])),
            range_max=_range_max(float(fields[4])),
            mount=self._mount(_FRONT, floats(tail[:3]), robot),
            odometry=robot,
            source=_FRONT.name,
        )

    def _mount(self, side: _Side, laser: Pose, robot: Pose) -> Pose:
        """By the two poses; where they coincide it is one pose twice: PARAM lines may tell."""
        mount = mount_of(laser, robot)
        if np.abs(mount).max() <= COINCIDE:
            x = self._number(f"{side.offset}_offset", 0.0)
            y = self._number(f"{side.offset}_side_offset", 0.0)
            return np.array([x, y, self._number(f"{side.offset}_angular_offset", side.facing)])
        return mount

    def _number(self, name: str, default: float) -> float:
        try:
            return float(self.params.get(name, default))
        except ValueError:
            raise ValueError(f"PARAM {name} is {self.params[name]!r}, not a number") from None


def _range_max(stated: float) -> float:
    """A log may state less than the laser's own limit; 0, NaN and more are no statement."""
    return stated if 0.0 < stated < RANGE_MAX else RANGE_MAX


@lru_cache(maxsize=64)
def _angles(n: int, start: float, step: float) -> NDArray[np.float64]:
    if not (np.isfinite(start) and np.isfinite(step) and step != 0.0):
        raise ValueError(f"start_angle {start}, angular_resolution {step} give no beams")
    return start + step * np.arange(n, dtype=np.float64)


def _events(text: TextFile, skipped: Skipped) -> Iterator[Event]:
    return messages.events(text, _Carmen().parsers, skipped)


CARMEN = Format("CARMEN", lambda words: words[0] in MESSAGES, _events)
