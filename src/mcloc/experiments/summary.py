"""A table summed up: each metric over the seeds of a setting, with its interval."""

import math
from typing import Any

from mcloc.evaluation.intervals import Interval, mean, number, proportion
from mcloc.experiments.study import Study
from mcloc.experiments.table import Setting, Table, Value


def by_setting(study: Study, table: Table) -> list[tuple[Setting, Table]]:
    """Each setting, but for what tables sum up over, with its rows."""
    names = [name for name in study.factors if name not in study.over]
    settings = dict.fromkeys(
        tuple((name, row.setting[name]) for name in names) for row in table.rows
    )
    return [(dict(setting), table.where(**dict(setting))) for setting in settings]


def summary(study: Study, table: Table) -> tuple[list[str], list[list[str]]]:
    """The heads of columns, and a row of cells for each setting."""
    names = [name for name in study.factors if name not in study.over]
    lines = [
        [
            *(_factor(value) for value in setting.values()),
            str(len(rows) - len(rows.failed)),
            *(summarized(rows, metric) for metric in study.metrics),
            *(text(rows) for text in study.pooled.values()),
        ]
        for setting, rows in by_setting(study, table)
    ]
    return [*names, "runs", *study.metrics.values(), *study.pooled], lines


def figures(study: Study, table: Table) -> list[dict[str, Any]]:
    """The same in numbers: of each setting its metrics with their intervals, for JSON."""
    return [
        {
            "setting": dict(setting),
            "runs": len(rows) - len(rows.failed),
            "raised": len(rows.failed),
            **{metric: _figure(rows, metric) for metric in study.metrics},
            **{name: text(rows) for name, text in study.pooled.items()},
        }
        for setting, rows in by_setting(study, table)
    ]


def _figure(rows: Table, metric: str) -> dict[str, Any] | None:
    interval, n = estimated(rows, metric)
    if interval is None:
        return None
    limits = {name: known(getattr(interval, name)) for name in ("value", "low", "high")}
    return {**limits, "known_of": n}


def estimated(rows: Table, metric: str) -> tuple[Interval | None, int]:
    """A metric over rows, None where it is known of none, and of how many it is known. What is true
    or false is a share, with its exact interval; else it is a mean.
    """
    values = [record[metric] for record in rows.records() if record[metric] is not None]
    if not values:
        return None, 0
    if all(isinstance(value, bool) for value in values):
        return proportion(sum(values), len(values)), len(values)
    return mean(values), len(values)


def _factor(value: Value) -> str:
    whole = isinstance(value, int) and not isinstance(value, bool)
    return f"{value:,}" if whole else str(value)


def summarized(rows: Table, metric: str) -> str:
    """A metric with its interval, and of how many runs if it is not known of all."""
    interval, n = estimated(rows, metric)
    if interval is None:
        return "–"
    values = [record[metric] for record in rows.records() if record[metric] is not None]
    if isinstance(values[0], bool):
        text = f"{sum(values)} of {n}, {interval}"
    else:
        text = str(interval) if n > 1 else number(interval.value)
    return text if n == len(rows) else f"{text}, {n} of {len(rows)} runs"


def known(value: float) -> float | None:
    """A number as JSON knows it, None for one that is not finite."""
    return float(value) if math.isfinite(value) else None
