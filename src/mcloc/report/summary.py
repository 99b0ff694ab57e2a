"""A run in a few numbers: `summary.json`."""

import json
import math
from typing import Any

import numpy as np

from mcloc import __version__
from mcloc.evaluation import Accuracy, evaluate
from mcloc.geometry import Pose
from mcloc.report.beacons import found_out
from mcloc.report.history import History
from mcloc.report.run import Run
from mcloc.trajectory import Trajectory


def accuracy_of(run: Run) -> Accuracy | None:
    """Of the estimates so far; None without a truth. Raises TruthError where the two never meet."""
    return None if run.truth is None else accuracy_against(run.truth, run.history)


def accuracy_against(truth: Trajectory, history: History) -> Accuracy:
    """Of the estimates in a history. Raises TruthError where the two never meet."""
    wheels = history.wheels
    return evaluate(
        history.trajectory,
        truth,
        odometry=wheels,
        scans=(float(wheels.t[0]), float(wheels.t[-1])),
        sightings=history.sighted.table[:, 0],
    )


def summarize(run: Run, accuracy: Accuracy | None) -> dict[str, Any]:
    """What summary.json holds; None where unknown. The run has at least one estimate."""
    config, history = run.config, run.history
    _, seconds, particles = history.updates.table.T
    update_ms = 1e3 * seconds
    wheels = history.wheels
    duration = float(wheels.t[-1] - wheels.t[0])
    final = run.localizer.hypotheses
    found = [{**_pose(h.mean), "share": h.share} for h in final]
    nowhere = np.full(3, np.nan)  # of a filter that withholds its estimate at the end
    summary = {
        "version": __version__,
        "map": config.map or run.grid.name,
        "log": config.log,
        "seed": config.seed,
        "filter": config.filter,
        "sensor": config.sensor,
        "motion": config.motion,
        "scans": history.scans,
        "updates": len(history.updates),
        "duration_s": duration,
        "distance_m": _distance(wheels),
        "realtime_factor": duration / run.wall_time if run.wall_time > 0.0 else None,
        "update_ms": {
            "median": float(np.median(update_ms)),
            "p95": float(np.percentile(update_ms, 95.0)),
            "max": float(update_ms.max()),
        },
        "particles": {"median": float(np.median(particles)), "max": int(particles.max())},
        "ignored": dict(sorted(run.ignored.items())),
        "final": {**_pose(final[0].mean if final else nowhere), "hypotheses": found},
        "withheld": history.share_withheld,
        "accuracy": None if accuracy is None else accuracy.to_dict(),
        **run.more(),
    }
    beacons = found_out(run)
    if beacons is not None:
        summary["beacons"] = beacons
    return {key: known(value) for key, value in summary.items()}


def _pose(pose: Pose) -> dict[str, float]:
    return dict(zip(("x", "y", "theta"), map(float, pose), strict=True))


def to_json(summary: dict[str, Any]) -> str:
    """As text; JSON knows no NaN."""
    return json.dumps(summary, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def _distance(wheels: Trajectory) -> float:
    """Metres that the wheels measured from the first to the last scan."""
    step = np.diff(wheels.poses[:, :2], axis=0)
    return float(np.hypot(step[:, 0], step[:, 1]).sum())


def known(value: Any) -> Any:
    """`value` with None in place of numbers that are none."""
    if isinstance(value, dict):
        return {key: known(v) for key, v in value.items()}
    if isinstance(value, list):
        return [known(v) for v in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
