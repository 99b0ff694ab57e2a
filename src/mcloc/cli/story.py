"""A summary in words, for people."""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

_PICTURES = {"picture": "run.png", "film": "run.gif", "recording": "recording"}


def told(summary: dict[str, Any], out: Path) -> str:
    """What a run found, and where to look at it."""
    return "".join(f"{line}\n" for line in _lines(summary, out))


def told_accuracy(accuracy: dict[str, Any]) -> str:
    """How good a trajectory is."""
    return "".join(f"{line}\n" for line in _accuracy(accuracy))


def _lines(summary: dict[str, Any], out: Path) -> Iterator[str]:
    speed, distance = summary["realtime_factor"], summary["distance_m"]
    driven = "" if distance is None else f", {distance:.1f} m"
    quick = "" if speed is None else f", {speed:.3g} × real time"
    yield (
        f"scans      {summary['scans']} ({summary['updates']} updates), "
        f"{summary['duration_s']:.1f} s{driven}{quick}"
    )
    for reason, count in summary["ignored"].items():
        yield f"ignored    {count} × {reason}"
    for k, h in enumerate(summary["final"]["hypotheses"]):
        yield f"{'' if k else 'final pose':10} {_pose(h)}, share {100 * h['share']:.0f} %"
    if summary["accuracy"] is not None:
        yield from _accuracy(summary["accuracy"])
    yield f"results    {out}"
    for what, name in _PICTURES.items():
        if (out / name).exists():
            yield f"{what:10} {out / name}"


def _accuracy(accuracy: dict[str, Any]) -> Iterator[str]:
    a = accuracy
    yield (
        f"position   median {a['position_median_m']:.3f} m, RMSE {a['position_rmse_m']:.3f} m, "
        f"95 % below {a['position_p95_m']:.3f} m, max {a['position_max_m']:.3f} m"
    )
    yield f"heading    median {a['heading_median_deg']:.2f}°"
    if a["nees_median"] is not None:
        yield f"NEES       median {a['nees_median']:.1f}; 2.4 for a filter as sure as it should be"
    lost = (f"{100 * share:.0f} % > {limit} m" for limit, share in a["lost_fraction"].items())
    yield f"lost       {', '.join(lost)} of the time"
    found = _when(a["converged"], a["time_to_converge_s"], a["distance_to_converge_m"])
    yield f"converged  {found}"
    for r in a["recoveries"]:
        found = _when(r["recovered"], r["after_s"], r["after_m"])
        yield f"kidnapped  at t = {r['t']:.1f} s; recovered: {found}"


def _pose(pose: dict[str, float]) -> str:
    return f"x {pose['x']:.2f} m, y {pose['y']:.2f} m, θ {math.degrees(pose['theta']):.1f}°"


def _when(happened: bool, after_s: float | None, after_m: float | None) -> str:
    if not happened or after_s is None or after_m is None:
        return "no"
    return f"yes, after {after_s:.1f} s and {after_m:.1f} m"
