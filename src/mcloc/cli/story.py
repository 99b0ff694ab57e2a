"""A summary in words, for people."""

import math
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

_PICTURES = {".png": "picture", ".gif": "film"}  # a recording is a folder


def told(summary: dict[str, Any], out: Path, pictures: Iterable[Path] = ()) -> str:
    """What a run found, and where to look at it. pictures: what it drew and recorded."""
    return "".join(f"{line}\n" for line in _lines(summary, out, pictures))


def told_accuracy(accuracy: dict[str, Any]) -> str:
    """How good a trajectory is."""
    return "".join(f"{line}\n" for line in _accuracy(accuracy))


def _lines(summary: dict[str, Any], out: Path, pictures: Iterable[Path]) -> Iterator[str]:
    duration, speed = _number(summary["duration_s"], ".1f"), summary["realtime_factor"]
    quick = "" if speed is None else f", {speed:.3g} × real time"
    yield (
        f"scans      {summary['scans']} ({summary['updates']} updates), "
        f"{duration} s, {_number(summary['distance_m'], '.1f')} m{quick}"
    )
    for reason, count in summary["ignored"].items():
        yield f"ignored    {count} × {reason}"
    for k, h in enumerate(summary["final"]["hypotheses"]):
        yield f"{'' if k else 'final pose':10} {_pose(h)}, share {_percent(h['share'])} %"
    if not summary["final"]["hypotheses"]:
        yield "final pose none: the filter withholds its estimate"
    if summary["withheld"]:
        share = _percent(summary["withheld"])
        yield f"withheld   the estimate at {share} % of the scans; errors are those of the others"
    for name, beacon in summary.get("beacons", {}).items():
        fits, trust = _percent(beacon["explained"]), _number(beacon["trust"], ".2f")
        yield f"beacon     {name}: {fits} % of its ranges fit, each counts {trust}"
    if "team" in summary:
        yield from _team(summary["team"])
    if summary["accuracy"] is not None:
        yield from _accuracy(summary["accuracy"])
    yield f"results    {out}"
    for path in pictures:
        yield f"{_PICTURES.get(path.suffix, 'recording'):10} {path}"


def _team(team: dict[str, Any]) -> Iterator[str]:
    detections, sizes = team["detections"], team["message_bytes"]
    yield f"team       {detections['used']} detections used, by and of {team['name']}"
    for reason, count in detections["ignored"].items():
        yield f"ignored    {count} × {reason}"
    for reason, count in team["messages"]["dropped"].items():
        yield f"dropped    {count} × message {reason}"
    if sizes["max"] is not None:
        yield f"messages   median {sizes['median']:.0f} bytes, at most {sizes['max']}"
    for name, peer in team["peers"].items():
        ahead = _number(peer["clock_ahead_s"], "+.3f")
        again = "" if peer["starts"] == 1 else f", started {peer['starts']} times"
        held = "" if not peer["not_awaited"] else ", did not go on and was not waited for"
        far = ", said to be beyond this log's end" if peer["beyond_the_log"] else ""
        other = "".join(f", with another {what}" for what in peer["differing"])
        yield f"peer       {name}: its clock is {ahead} s ahead{again}{held}{far}{other}"
    if team["events_before"]:
        yield (
            f"joined     the others' time: {team['events_before']} events before it are left out, "
            "and the place is searched for if the robot has moved"
        )


def _accuracy(accuracy: dict[str, Any]) -> Iterator[str]:
    a = accuracy
    median, rmse, p95, most = (
        _number(a[f"position_{name}_m"], ".3f") for name in ("median", "rmse", "p95", "max")
    )
    yield f"position   median {median} m, RMSE {rmse} m, 95 % below {p95} m, max {most} m"
    if "sighted" in a:
        near = _number(a["position_median_sighted_m"], ".3f")
        yield f"           median {near} m within 5 s of a landmark seen"
    yield f"heading    median {_number(a['heading_median_deg'], '.2f')}°"
    if a["nees_median"] is not None:
        yield f"NEES       median {a['nees_median']:.1f}; 2.4 for a filter as sure as it should be"
    lost = (f"{_percent(share)} % > {limit} m" for limit, share in a["lost_fraction"].items())
    yield f"lost       {', '.join(lost)} of the time"
    found = _when(a["time_to_find_s"] is not None, a["time_to_find_s"], a["distance_to_find_m"])
    if found != "no":
        kept = _number(a["localized_fraction"], ".1f", 100.0)
        found += f"; off by less than 0.5 m and 10° for {kept} % of the time since"
    yield f"found      {found}"
    stays = _when(a["converged"], a["time_to_converge_s"], a["distance_to_converge_m"])
    yield f"converged  {stays}{'' if stays == 'no' else '; from then on never off by more'}"
    for r in a["recoveries"]:
        found = _when(r["recovered"], r["after_s"], r["after_m"])
        yield f"kidnapped  at t = {_number(r['t'], '.1f')} s; recovered: {found}"


def _pose(pose: dict[str, float | None]) -> str:
    x, y = (_number(pose[name], ".2f") for name in "xy")
    return f"x {x} m, y {y} m, θ {_number(pose['theta'], '.1f', math.degrees(1.0))}°"


def _percent(share: float | None) -> str:
    return _number(share, ".0f", 100.0)


def _number(value: float | None, form: str, unit: float = 1.0) -> str:
    """As text, "?" where it is not known."""
    return "?" if value is None else f"{unit * value:{form}}"


def _when(happened: bool, after_s: float | None, after_m: float | None) -> str:
    if not happened or after_s is None or after_m is None:
        return "no"
    return f"yes, after {after_s:.1f} s and {after_m:.1f} m"
