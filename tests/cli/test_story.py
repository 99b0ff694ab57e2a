"""A summary in words: also where numbers are unknown, and of this run only."""

import json
from pathlib import Path
from typing import Any

from mcloc.cli.story import told


def unknown(value: Any) -> Any:
    """`value` with null for each number with a fraction, as JSON has what is none."""
    if isinstance(value, dict):
        return {key: unknown(v) for key, v in value.items()}
    if isinstance(value, list):
        return [unknown(v) for v in value]
    return None if isinstance(value, float) else value


def test_unknown_numbers_are_question_marks(tracked: Path) -> None:
    summary = unknown(json.loads((tracked / "summary.json").read_text(encoding="utf-8")))
    summary["accuracy"]["recoveries"] = [
        {"t": None, "recovered": True, "after_s": None, "after_m": None}
    ]
    story = told(summary, tracked)
    assert "None" not in story
    assert "updates), ? s, ? m\n" in story
    assert "final pose x ? m, y ? m, θ ?°, share ? %\n" in story
    assert "median ? m, RMSE ? m, 95 % below ? m, max ? m\n" in story
    assert "heading    median ?°\n" in story
    assert "? % > 0.5 m" in story
    assert "found      no\n" in story


def test_a_robot_that_leaves_its_bounds_now_and_then_is_told_so(tracked: Path) -> None:
    """A reader must not take "converged after 821 s" for a search of 821 s."""
    summary = json.loads((tracked / "summary.json").read_text(encoding="utf-8"))
    summary["accuracy"].update(
        time_to_find_s=12.3, distance_to_find_m=3.1, localized_fraction=0.961,
        converged=True, time_to_converge_s=821.0, distance_to_converge_m=45.0,
    )  # fmt: skip
    told_lines = told(summary, tracked).splitlines()
    assert (
        "found      yes, after 12.3 s and 3.1 m; off by less than 0.5 m and 10° for 96.1 % of the "
        "time since" in told_lines
    )
    assert "converged  yes, after 821.0 s and 45.0 m; from then on never off by more" in told_lines
    summary["accuracy"].update(converged=False)
    assert "converged  no" in told(summary, tracked).splitlines()


def test_only_what_this_run_drew_is_listed(tracked: Path) -> None:
    summary = json.loads((tracked / "summary.json").read_text(encoding="utf-8"))
    assert str(tracked / "run.png") not in told(summary, tracked)  # though it is there
    made = [tracked / "run.png", tracked / "run.gif", tracked / "recording-2"]
    assert told(summary, tracked, made).splitlines()[-3:] == [
        f"picture    {made[0]}",
        f"film       {made[1]}",
        f"recording  {made[2]}",
    ]
