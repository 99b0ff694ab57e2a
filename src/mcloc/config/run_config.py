"""Everything that a run depends on: metres, radians, seconds, and names of parts.

Paths are taken as they are given: a relative one starts at the folder in which the run is started,
not at the one that the configuration lies in.
"""

import math
import secrets
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any

from mcloc.config.typed import check_path, defaults, typed
from mcloc.errors import ConfigError
from mcloc.filters.catalog import REGISTRIES, Composition
from mcloc.localizer import PACES, Pace, UpdatePolicy
from mcloc.registry import Registry, Value, named, parameters, suggest

Triple = tuple[float, float, float]
Settings = Mapping[str, Mapping[str, Value]]

Topics = Mapping[str, str | Sequence[str]]

TOPICS = ("scan", "odometry", "image", "map", "truth")
"""What a topic of a bag can be for."""

SENSORS = ("scan", "odometry", "image")
"""Those that hold events."""

CHOICES: Mapping[str, Registry[Any]] = {**REGISTRIES, "pace": PACES}
"""What is chosen by name."""

PARTS = (*CHOICES, "update")
"""What has parameters to set; `update` says when a scan is used."""

FARTHEST_MOUNT = 10.0
"""m from the robot's centre."""

_NOTES = {
    "map": "null: the topic of the log that `topics` names, or the landmarks of an MRCLAM folder",
    "robot": "its number, of the log that is an MRCLAM folder; null: the log is of one robot",
    "topics": "of a bag, by role: scan, odometry, image, map, truth; none: found by type",
    "initial": "x, y, theta in m, m, rad; null: search on the whole map",
    "initial_sigma": "standard deviations in m, m, rad",
    "start": "s, stamp of the log; null: its beginning",
    "end": "s, stamp of the log; null: its end",
    "mount": "x, y, theta of the laser on the robot in m, m, rad; null: what the log says",
    "beacons": "beacon_id, x, y, z of radio beacons (m, map frame); null: none",
    "beacon_ranges": "the ranges to them: scan_index or t, beacon_id, range_m",
    "ceiling": "mosaic of the ceiling: .yaml with image, resolution, origin; null: none",
    "images": "folder of its images with stamps; null: the image topic of the bag",
    "scans": "false: localize by what else the log and its files hold",
    "derive_sonar": "a ring of so many sonars, derived from the scans; null: the scans themselves",
    "threads": "null: one a core; no result depends on it",
}


@dataclass(frozen=True)
class RunConfig:
    """A run that can be made and repeated.

    map, log, truth: paths. topics: {role: name} of a bag, for the roles TOPICS; "scan" may have
    several names; without them scans and odometry are found by type, and map and truth are files.
    initial: start pose in the map frame, None for global localization; initial_sigma: its standard
    deviations. start, end: stamps of the log between which it is used. mount: the laser's pose on
    the robot, None for what the log says. beacons, beacon_ranges: paths, of a map of radio beacons
    and of the ranges that the robot measured; both or neither. ceiling, images: paths, of a mosaic
    of the ceiling and of a folder of images of it; those of a bag need no folder. scans: whether
    those of the log are used; its odometry is in any case. derive_sonar: instead of them, a ring of
    so many sonars. seed: None for a fresh one. robot: which one of an MRCLAM folder, None for other
    logs. threads: None for one a core. filter … message: names of parts. pace: that of the replay.
    settings: {part: {parameter: value}} where they differ from the defaults; text is read as what
    the parameter is.

    Raises ConfigError for unknown names and parameters, and for values of a wrong kind.
    """

    map: str | None
    log: str
    truth: str | None = None
    topics: Topics = field(default_factory=dict)
    initial: Triple | None = None
    initial_sigma: Triple = (0.5, 0.5, math.radians(15.0))
    start: float | None = None
    end: float | None = None
    mount: Triple | None = None
    robot: int | None = None
    beacons: str | None = None
    beacon_ranges: str | None = None
    ceiling: str | None = None
    images: str | None = None
    scans: bool = True
    derive_sonar: int | None = None
    seed: int | None = None
    threads: int | None = None
    filter: str = Composition.filter
    motion: str = Composition.motion
    sensor: str = Composition.sensor
    environment: str = Composition.environment
    size: str = Composition.size
    resampler: str = Composition.resampler
    recovery: str = Composition.recovery
    people: str = Composition.people
    sampler: str = Composition.sampler
    sightings: str = Composition.sightings
    ranging: str = Composition.ranging
    camera: str = Composition.camera
    message: str = Composition.message
    pace: str = "offline"
    settings: Settings = field(default_factory=dict)

    def __post_init__(self) -> None:
        for part in self.settings:
            if part not in PARTS:
                raise ConfigError(f"unknown part {part!r}; {suggest(part, PARTS)}")
        self._check_topics()
        for role in ("map", "log", "truth", "beacons", "beacon_ranges", "ceiling", "images"):
            check_path(role, getattr(self, role) or "")
        if (self.beacons is None) != (self.beacon_ranges is None):
            raise ConfigError(
                "beacons need both files: beacons says where they are, beacon_ranges what was "
                "measured"
            )
        seen = self.images is not None or "image" in self.topics
        if seen != (self.ceiling is not None):
            raise ConfigError(
                "a ceiling camera needs both: ceiling, the mosaic, and images, a folder, or the "
                "topic of a bag that is the image"
            )
        if self.mount is not None:
            check_mount(self.mount)
        if self.threads is not None and self.threads < 1:
            raise ConfigError(f"threads must be >= 1, got {self.threads}")
        for name, stamp in (("start", self.start), ("end", self.end)):
            if stamp is not None and not math.isfinite(stamp):
                raise ConfigError(f"{name} must be a finite number of seconds, got {stamp}")
        if self.start is not None and self.end is not None and self.start > self.end:
            raise ConfigError(f"start = {self.start:g} s must not lie after end = {self.end:g} s")
        self._check_scans()
        settings = {part: self._typed(part) for part in PARTS}
        object.__setattr__(self, "settings", {part: of for part, of in settings.items() if of})

    def _check_topics(self) -> None:
        for role in self.topics:
            if role not in TOPICS:
                raise ConfigError(f"unknown role {role!r} of a topic; {suggest(role, TOPICS)}")
            if role not in ("scan", "image") and not isinstance(self.topics[role], str):
                raise ConfigError(f"only one topic can be the {role}, got {self.topics[role]}")
        for role, path in (("map", self.map), ("truth", self.truth)):
            if path is not None and role in self.topics:
                raise ConfigError(f"{role} is given twice, as a file and as a topic: give one")
        if self.map is None and "map" not in self.topics and self.robot is None:
            raise ConfigError(
                "which map? Give a file, or the topic of a bag that holds one, or of an MRCLAM "
                "folder the robot"
            )

    def _check_scans(self) -> None:
        """Robots of an MRCLAM folder have no laser."""
        derived = self.derive_sonar is not None
        for option, given in (("--no-scans", not self.scans), ("--derive-sonar", derived)):
            if given and self.robot is not None:
                raise ConfigError(
                    f"{option} is about the scans of a log, and an MRCLAM folder has none: leave "
                    "it out (scans: true, derive_sonar: null)"
                )

    def resolved(self) -> "RunConfig":
        """The same run with a seed, and with the value of each parameter spelt out."""
        settings = {
            part: {**defaults(self._class(part)), **self.settings.get(part, {})} for part in PARTS
        }
        seed = secrets.randbits(32) if self.seed is None else self.seed
        return replace(self, seed=seed, settings=settings)

    def topic(self, role: str) -> str:
        """The one topic of a role that has one."""
        return str(self.topics[role])

    @property
    def sensor_topics(self) -> Topics:
        """Those that hold events."""
        return {role: names for role, names in self.topics.items() if role in SENSORS}

    @property
    def composition(self) -> Composition:
        """The filter."""
        names = {name: getattr(self, name) for name in REGISTRIES}
        settings = {part: of for part, of in self.settings.items() if part in REGISTRIES}
        return Composition(**names, settings=settings)

    @property
    def policy(self) -> UpdatePolicy:
        """When a scan is used."""
        with named("update"):
            return UpdatePolicy(**dict(self.settings.get("update", {})))  # type: ignore[arg-type]

    @property
    def replay_pace(self) -> Pace:
        """How long the filter is busy with a scan."""
        return PACES.make(self.pace, **self.settings.get("pace", {}))

    def to_yaml(self) -> str:
        """As a file for `read_entries`; units stand in comments."""
        return "\n".join([*self._lines(), ""])

    def _lines(self) -> Iterator[str]:
        yield "# A run of mcloc; `mcloc run --config` with this file repeats it."
        yield "# Relative paths start at the folder in which mcloc is run."
        for f in fields(self):
            if f.name != "settings":
                yield _line(f.name, getattr(self, f.name), _NOTES.get(f.name, ""))
        yield "settings:" if self.settings else "settings: {}"
        for part, values in self.settings.items():
            yield f"  {part}:"
            units = {f.name: f.metadata["unit"] for f in parameters(self._class(part))}
            for name, value in values.items():
                yield "    " + _line(name, value, units[name])

    def _class(self, part: str) -> type[Any]:
        kind: type[Any] = (
            UpdatePolicy if part == "update" else CHOICES[part].get(getattr(self, part))
        )
        return kind

    def _typed(self, part: str) -> dict[str, Value]:
        """The settings of a part, text turned into what the parameter is."""
        owner = part if part == "update" else f"{part} {getattr(self, part)!r}"
        return typed(part, self._class(part), self.settings.get(part, {}), owner)


def check_mount(mount: Triple) -> None:
    """Raises ConfigError for a laser that is not on the robot."""
    near = len(mount) == 3 and math.hypot(*mount[:2]) <= FARTHEST_MOUNT
    if not (near and math.isfinite(mount[2])):
        raise ConfigError(
            f"mount must be a pose on the robot, at most {FARTHEST_MOUNT:g} m from its centre, got "
            f"{list(mount)} (m, m, rad)"
        )


def _line(key: str, value: object, note: str) -> str:
    """`key: value  # note`."""
    import yaml

    listed = list(value) if isinstance(value, tuple) else value
    text = yaml.safe_dump(listed, default_flow_style=True, allow_unicode=True, width=10**6)
    # One scalar is a whole document to YAML, which it ends with "...".
    text = text.removesuffix("...\n").rstrip("\n")
    return f"{key}: {text}  # {note}" if note else f"{key}: {text}"
