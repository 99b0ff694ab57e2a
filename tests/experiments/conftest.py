"""A study that takes no time, and a real one that takes a few seconds."""

from pathlib import Path

import pytest

from mcloc.evaluation.intervals import mean
from mcloc.experiments import e05_sample_size
from mcloc.experiments.study import Claim, Finding, Study, Verdict
from mcloc.experiments.table import Record, Setting, Table


def toy_run(setting: Setting, seed: int) -> Record:
    """A record that tells which run it is of."""
    return {"y": float(setting["x"]) * 10.0 + seed, "found": seed % 2 == 0, "path": [seed, 1]}


def toy_claim(table: Table) -> Finding:
    """Holds: y is above 0."""
    figure = mean(table.column("y"))
    verdict = Verdict.REPRODUCED if figure.low > 0.0 else Verdict.NOT
    return Finding(verdict, "mean of y, m", figure)


def toy_draw(table: Table, figure) -> None:  # type: ignore[no-untyped-def]
    figure.subplots().plot(table.column("y"))


def toy_study(**changes: object) -> Study:
    """Two settings, three seeds."""
    parts = {
        "number": "E99",
        "title": "A toy",
        "source": "nowhere",
        "about": "Nothing happens.",
        "factors": {"x": (1, 2)},
        "run": toy_run,
        "metrics": {"y": "y, m", "found": "found"},
        "claims": (Claim("y is large", "1 m", "holds", toy_claim),),
        "draw": toy_draw,
        "seeds": 3,
    }
    return Study(**{**parts, **changes})  # type: ignore[arg-type]


@pytest.fixture
def out(tmp_path: Path) -> Path:
    folder = tmp_path / "out"
    folder.mkdir()
    return folder


REAL = e05_sample_size.run
REAL_TASKS = [
    (
        {
            "place": "generated office",
            "pace": "1999",
            "scans": "all",
            "samples": samples,
        },
        seed,
    )
    for seed in (0, 1)
    for samples in (10, 100, 2000, 5000)
]
"""Runs that another process can make."""
