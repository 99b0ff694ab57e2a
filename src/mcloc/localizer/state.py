"""A Localizer's complete state as values and arrays: a restored one goes on with the same bytes."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import numpy as np

from mcloc.errors import ConfigError, StateError
from mcloc.estimate import Hypothesis
from mcloc.events import MEASUREMENTS, Measurement, Odometry, arrays_of
from mcloc.filters.catalog import Composition
from mcloc.filters.filter import StepInfo
from mcloc.filters.recovery import Evidence
from mcloc.localizer.estimate import Update
from mcloc.localizer.leap_guard import LeapGuard
from mcloc.localizer.localizer import Localizer
from mcloc.localizer.pace import PACES, Pace
from mcloc.localizer.policy import UpdatePolicy
from mcloc.localizer.record import Record
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.particles import Particles
from mcloc.registry import parameters
from mcloc.storage import Arrays, read_state, write_state

VERSION = 8


def save(localizer: Localizer, path: str | Path) -> None:
    """Write the complete state of a localizer to one .npz file, whole or not at all.

    Raises ConfigError where it cannot be written, or has a pace of the user's own.
    """
    values, arrays = packed(localizer)
    write_state(path, {"version": VERSION, **values}, arrays)


def restore(path: str | Path, grid: OccupancyGrid, aids: Sequence[Any] = ()) -> Localizer:
    """The localizer that was saved; grid, aids: the maps it was on.

    Raises StateError for a file that is damaged or was saved on another map.
    """
    values, arrays = read_state(path, VERSION)
    return unpacked(str(path), values, arrays, grid, aids)


def packed(localizer: Localizer) -> tuple[dict[str, Any], Arrays]:
    """The state as what JSON knows, and as arrays."""
    belief, update = localizer.belief, localizer.update
    packed, of_belief = localizer.filter.packed(belief)
    queue = localizer._queue
    held = [] if queue.guard.held is None else [queue.guard.held]
    wheels = queue.wheels.guard.held
    arrays: Arrays = {
        **{f"belief.{name}": array for name, array in of_belief.items()},
        "odometry": _odometry_rows(queue.wheels.events),
        "odometry_held": _odometry_rows([] if wheels is None else [wheels]),
    }
    values: dict[str, Any] = {
        "map": localizer.grid.checksum,
        "aids": [aid.checksum for aid in localizer.aids],
        "composition": asdict(localizer.composition),
        "policy": asdict(localizer.policy),
        "pace": _pace(localizer.pace),
        "seed": localizer.seed,
        "step": localizer.step,
        "ignored": dict(localizer.ignored),
        "evidence": {source: asdict(e) for source, e in belief.evidence.items()},
        "belief": packed,
        "odometry_guard": _guard(queue.wheels.guard),
        "scan_guard": _guard(queue.guard),
        "newest": {source: str(t) for source, t in queue.newest.items()},
        "record": {source: asdict(record) for source, record in localizer.record.items()},
        "beacons_alone": localizer._beacons_alone,
        "done": str(queue.done),
        "told_start": localizer.told_start,
        "used_at": {source: pose.tolist() for source, pose in localizer._used_at.items()},
        "stepped_at": None if localizer._stepped_at is None else localizer._stepped_at.tolist(),
        "forced": localizer._forced,
        "busy_until": str(localizer._busy_until),
        "waiting": [_measured(z, f"waiting{k}", arrays) for k, z in enumerate(queue.waiting)],
        "held": [_measured(z, "held", arrays) for z in held],
        "hypotheses": _listed(localizer.hypotheses),
        "update": None,
    }
    if update is not None:
        values["update"] = {
            "step": update.step,
            "info": asdict(update.info),
            "explained": str(update.explained),
            "duration": update.duration,
            "hypotheses": _listed(update.hypotheses),
        }
    return values, arrays


def unpacked(
    path: str, values: dict[str, Any], arrays: Arrays, grid: OccupancyGrid, aids: Sequence[Any] = ()
) -> Localizer:
    """The localizer that `packed` describes. path: for messages. Raises StateError."""
    try:
        if values["map"] != grid.checksum:
            raise StateError(f"{path}: was saved on another map than {grid.name}; give that one")
        if values["aids"] != [aid.checksum for aid in aids]:
            given = ", ".join(aid.name for aid in aids) or "none"
            raise StateError(
                f"{path}: was saved with other maps of landmarks, beacons or the ceiling than "
                f"{given}; give those"
            )
        return _unpacked(values, arrays, grid, aids)
    except (KeyError, TypeError, ValueError) as cause:
        raise StateError(f"{path}: damaged, or of another mcloc ({cause!r})") from cause


def _unpacked(
    values: dict[str, Any], arrays: Arrays, grid: OccupancyGrid, aids: Sequence[Any]
) -> Localizer:
    evidence = {source: Evidence(**e) for source, e in values["evidence"].items()}
    of_belief = {
        name.removeprefix("belief."): array
        for name, array in arrays.items()
        if name.startswith("belief.")
    }
    localizer = Localizer(
        grid,
        Composition(**values["composition"]),
        aids=aids,
        seed=values["seed"],
        policy=UpdatePolicy(**values["policy"]),
        pace=PACES.make(values["pace"]["name"], **values["pace"]["settings"]),
        belief=lambda of: of.unpacked(values["belief"], of_belief, evidence),
    )
    localizer.step = values["step"]
    localizer.ignored.update(Counter(values["ignored"]))
    queue = localizer._queue
    odometry = queue.wheels
    odometry.events.extend(Odometry(float(row[0]), row[1:]) for row in arrays["odometry"])
    for row in arrays["odometry_held"]:
        odometry.guard.held = Odometry(float(row[0]), row[1:])
    _set(odometry.guard, values["odometry_guard"])
    _set(queue.guard, values["scan_guard"])
    for z in values["held"]:
        queue.guard.held = _measurement(z, "held", arrays)
    queue.waiting = [
        _measurement(z, f"waiting{k}", arrays) for k, z in enumerate(values["waiting"])
    ]
    queue.newest.update({source: float(t) for source, t in values["newest"].items()})
    localizer.record.update({source: Record(**r) for source, r in values["record"].items()})
    localizer._beacons_alone = values["beacons_alone"]
    queue.done = float(values["done"])
    localizer.told_start = values["told_start"]
    localizer._used_at = {source: np.array(p) for source, p in values["used_at"].items()}
    if values["stepped_at"] is not None:
        localizer._stepped_at = np.array(values["stepped_at"])
    localizer._forced = values["forced"]
    localizer._busy_until = float(values["busy_until"])
    localizer.hypotheses = _hypotheses(values["hypotheses"])
    if values["update"] is not None:
        localizer.update = _update(values["update"], localizer.belief.particles)
    return localizer


def _update(values: dict[str, Any], particles: Particles) -> Update:
    info = {**values["info"], "sizes": tuple(values["info"]["sizes"])}
    info["evidence"] = Evidence(**info["evidence"])
    found = _hypotheses(values["hypotheses"])
    explained = float(values["explained"])
    duration = values["duration"]
    return Update(values["step"], StepInfo(**info), particles, found, explained, duration)


def _pace(pace: Pace) -> dict[str, Any]:
    for name, kind in PACES.parts.items():
        if type(pace) is kind:
            settings = {f.name: getattr(pace, f.name) for f in parameters(pace)}
            return {"name": name, "settings": settings}
    known = ", ".join(PACES)
    raise ConfigError(f"pace {type(pace).__name__} cannot be saved, only one of {known}")


def _listed(hypotheses: tuple[Hypothesis, ...]) -> list[Any]:
    return [(h.mean.tolist(), h.covariance.tolist(), h.share) for h in hypotheses]


def _hypotheses(listed: list[Any]) -> tuple[Hypothesis, ...]:
    return tuple(Hypothesis(np.array(m), np.array(c), share) for m, c, share in listed)


def _guard(guard: LeapGuard[Any]) -> list[Any]:
    return [str(guard.newest), guard.behind]


def _set(guard: LeapGuard[Any], values: list[Any]) -> None:
    guard.newest, guard.behind = float(values[0]), values[1]


def _odometry_rows(events: Any) -> Any:
    return np.array([(e.t, *e.pose) for e in events], dtype=np.float64).reshape(-1, 4)


_KINDS = {kind.__name__: kind for kind in MEASUREMENTS}


def _measured(z: Measurement, name: str, arrays: Arrays) -> dict[str, Any]:
    """The values of a measurement; its arrays go to `arrays`."""
    own = arrays_of(z)
    arrays.update({f"{name}.{key}": array for key, array in own.items()})
    values = {f.name: getattr(z, f.name) for f in fields(z) if f.name not in own}
    return {"kind": type(z).__name__, "values": values, "arrays": list(own)}


def _measurement(packed: dict[str, Any], name: str, arrays: Arrays) -> Measurement:
    own = {key: arrays[f"{name}.{key}"] for key in packed["arrays"]}
    return _KINDS[packed["kind"]](**{**packed["values"], **own})
