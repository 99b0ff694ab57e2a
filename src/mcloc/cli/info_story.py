"""What `mcloc info` found, in words, for people."""

import math
import textwrap
from collections.abc import Iterator
from typing import Any

WIDTH = 100
_TITLE = 12  # characters


def told_info(info: dict[str, Any]) -> str:
    """What is there, then what looks wrong."""
    return "".join(f"{line}\n" for line in _lines(info))


def _lines(info: dict[str, Any]) -> Iterator[str]:
    if info["map"] is not None:
        yield from _map(info["map"])
    if info["log"] is not None:
        yield from _log(info["log"])
    if info["fit"] is not None:
        yield from _row("together", _fit(info["fit"], bool(info["log"]["lasers"])))
    if not info["findings"]:
        yield from _row("findings", "none")
    for finding in info["findings"]:
        yield ""
        yield from _row("looks wrong", f"{finding['about']}: {finding['what']}")
        yield from _row("  because", finding["evidence"])
        yield from _row("  try", finding["remedy"])


def _map(m: dict[str, Any]) -> Iterator[str]:
    yield from _row("map", m["name"])
    yield from _row(
        "  size",
        f"{m['width_m']:g} m × {m['height_m']:g} m, {m['columns']} × {m['rows']} cells of "
        f"{m['resolution_m']:g} m",
    )
    shares = (f"{_percent(m[kind])} {kind}" for kind in ("free", "occupied", "unknown"))
    yield from _row("  cells", ", ".join(shares))
    yield from _row(
        "  limits", f"occupied from {m['occupied_thresh']:g} on, free up to {m['free_thresh']:g}"
    )
    yield from _row("  origin", _pose(m["origin"]))


def _log(log: dict[str, Any]) -> Iterator[str]:
    yield from _row("log", log["name"])
    yield from _row(
        "  time",
        f"{_number(log['duration_s'])} s, from t = {log['start_s']:.3f} s to {log['end_s']:.3f} s",
    )
    distance, back = _number(log["distance_m"]), _number(log["backward_m"])
    yield from _row("  driven", f"{distance} m, {back} m of it backwards")
    if log["odometry"] is not None:
        yield from _row("  odometry", _stream(log["odometry"], "events"))
    for name, laser in log["lasers"].items():
        yield from _laser(name, laser)
    if log["sightings"] is not None:
        yield from _sightings(log["sightings"])
    if log["truth"] is not None:
        share = log["truth"]["share"]
        during = "" if share is None else f", during {_percent(share)} of the log"
        yield from _row("  truth", _stream(log["truth"], "poses") + during)
    for reason, count in log["skipped"].items():
        yield from _row("  skipped", f"{count} × {reason}")
    for topic, kind in (log["topics"] or {}).items():
        yield from _row("  topic", f"{topic} ({kind})")


def _laser(name: str, laser: dict[str, Any]) -> Iterator[str]:
    own = ", each with its odometry" if laser["own_odometry"] else ""
    yield from _row(f"  {name}", f"{_stream(laser, 'scans')}{own}")
    right, left = (math.degrees(angle) for angle in laser["angles_rad"])
    yield from _row("", f"{laser['beams']} beams from {right:.4g}° to {left:.4g}°")
    most = "any range" if laser["range_max_m"] is None else f"{laser['range_max_m']:g} m"
    middle = laser["range_median_m"]
    yield from _row(
        "",
        f"{laser['range_min_m']:g} m to {most}"
        + ("" if middle is None else f", half of the returns within {middle:.3g} m"),
    )
    kinds = (f"{_percent(n)} {kind}" for kind, n in laser["missing_by_kind"].items())
    listed = f" ({', '.join(kinds)})" if laser["missing_by_kind"] else ""
    yield from _row("", f"{_percent(laser['missing'])} of the readings are no return{listed}")
    yield from _row("", f"mounted at {_pose(laser['mount'])}")


def _sightings(seen: dict[str, Any]) -> Iterator[str]:
    of, middle = seen["of_landmark"], seen["range_median_m"]
    yield from _row(
        "  landmarks", f"{len(of)} known, {sum(n > 0 for n in of.values())} of them seen"
    )
    near = "" if middle is None else f", half of them within {middle:.3g} m"
    yield from _row(
        "  sightings", f"{seen['sightings']} of landmarks{near}; {_stream(seen, 'events')}"
    )
    yield from _row("", "of each: " + ", ".join(f"{name}: {n}" for name, n in of.items()))


def _stream(stream: dict[str, Any], unit: str) -> str:
    rate, gap = stream["rate_hz"], stream["longest_gap_s"]
    often = "" if rate is None else f", {rate:.3g} Hz"
    return f"{stream['events']} {unit}{often}" + (
        "" if gap is None else f", gaps up to {gap:.3g} s"
    )


def _fit(fit: dict[str, Any], scanned: bool) -> str:
    if not scanned:
        return "not compared: the log has no scans, and nothing else in it tells of walls"
    if fit["verdict"] == "not compared":
        return "not compared: first mend what looks wrong, or give a longer log"
    if fit["explained"] is None:
        return str(fit["verdict"])
    return (
        f"{fit['verdict']}: searched for on the whole map, with up to {fit['windows']} parts of the"
        f" log, the robot sees at best {_percent(fit['explained'])} of its returns end at walls"
    )


def _number(value: float | None) -> str:
    return "?" if value is None else f"{value:.1f}"


def _percent(share: float) -> str:
    return f"{100 * share:.1f} %"


def _pose(pose: dict[str, float]) -> str:
    x, y = (round(pose[axis], 3) + 0.0 for axis in ("x", "y"))  # no −0
    return f"x {x:g} m, y {y:g} m, θ {round(math.degrees(pose['theta']), 1) + 0.0:g}°"


def _row(title: str, text: str) -> list[str]:
    """A title and what there is to say, broken into lines."""
    lines = textwrap.wrap(text, WIDTH - _TITLE, break_long_words=False, break_on_hyphens=False)
    return [f"{title if k == 0 else '':{_TITLE}} {line}" for k, line in enumerate(lines or [""])]
