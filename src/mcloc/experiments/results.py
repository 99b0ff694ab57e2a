"""What a study leaves behind: table.csv, verdict.json, figure.png, study.md."""

import json
import math
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from mcloc.evaluation.intervals import Interval, mean, number, proportion
from mcloc.experiments.plan import Plan
from mcloc.experiments.study import Claim, Finding, Study, Verdict
from mcloc.experiments.table import Row, Setting, Table, Value
from mcloc.storage import replacing

MOST_ERRORS = 5  # that are told one by one


def write_table(table: Table, folder: Path) -> None:
    """table.csv, and table.parquet where pyarrow is installed. Raises ConfigError."""
    with replacing(folder / "table.csv") as path:
        path.write_text(table.to_csv(), encoding="utf-8")
    with suppress(ImportError):
        _write_parquet(table, folder)


def write_results(plan: Plan, table: Table, folder: Path, made_by: str) -> None:
    """All of them. Raises ConfigError where a file cannot be written."""
    write_table(table, folder)
    found = [(claim, decided(claim, plan, table)) for claim in plan.study.claims]
    with replacing(folder / "verdict.json") as path:
        verdicts = _verdicts(plan, table, found, made_by)
        path.write_text(json.dumps(verdicts, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
    with replacing(folder / "study.md") as path:
        lines = _page(plan, table, found, made_by)
        path.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")
    if not complete(table):
        (folder / "figure.png").unlink(missing_ok=True)
        return
    with replacing(folder / "figure.png") as path:
        draw(plan.study, table, path)


def complete(table: Table) -> bool:
    """Whether some run of every setting did not raise."""
    settings = {tuple(row.setting.items()) for row in table.rows}
    told = {tuple(row.setting.items()) for row in table.rows if row.record is not None}
    return told == settings


def decided(claim: Claim, plan: Plan, table: Table) -> Finding:
    """A claim's finding.

    Of runs that raised, and of settings that are missing here, nobody knows what they would have
    shown: then a claim is reproduced in part at best, and not at all where no run of some setting
    told anything.
    """
    if not complete(table):
        nothing = Interval(math.nan, math.nan, math.nan)
        return Finding(Verdict.NOT, "nothing: all runs of some setting raised", nothing)
    finding = claim.decide(table)
    notes = [finding.note] if finding.note else []
    if table.failed:
        notes.append(f"{len(table.failed)} of {len(table)} runs raised.")
    if plan.missing:
        notes.append(f"{sum(plan.missing.values())} settings were left out.")
    verdict = finding.verdict
    if (table.failed or plan.missing) and verdict is Verdict.REPRODUCED:
        verdict = Verdict.IN_PART
    return replace(finding, verdict=verdict, note=" ".join(notes))


def draw(study: Study, table: Table, path: Path) -> None:
    """The study's picture as a PNG; the same table, the same bytes."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 6.0), layout="constrained")
    study.draw(table, figure)
    figure.savefig(path, format="png", dpi=110, metadata={"Software": None})


def _verdicts(
    plan: Plan, table: Table, found: list[tuple[Claim, Finding]], made_by: str
) -> dict[str, Any]:
    study = plan.study
    return {
        "study": study.number,
        "title": study.title,
        "runs": len(table),
        "seeds": plan.seeds,
        "seeds_in_full": study.seeds,
        "raised": len(table.failed),
        "left_out": plan.missing,
        "made_by": made_by,
        "claims": [
            {
                "claim": claim.text,
                "paper": claim.paper,
                "prediction": claim.prediction,
                "verdict": str(finding.verdict),
                "figure": finding.what,
                "value": _known(finding.figure.value),
                "interval": [_known(finding.figure.low), _known(finding.figure.high)],
                "told": str(finding.figure),
                "note": finding.note,
            }
            for claim, finding in found
        ],
    }


def _known(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _page(
    plan: Plan, table: Table, found: list[tuple[Claim, Finding]], made_by: str
) -> Iterator[str]:
    study, seeds = plan.study, plan.seeds
    yield f"# {study.number}: {study.title}\n"
    yield f"{study.source}. Made by {made_by}, with\n"
    fewer = "" if seeds == study.seeds else f" --runs {seeds}"
    yield f"    {study.command or f'mcloc study run {study.number}{fewer}'}\n"
    if seeds < study.seeds:
        yield f"**{seeds} of {study.seeds} runs for each setting: too few to rely on.**\n"
    yield study.about.strip() + "\n"
    for why, n in plan.missing.items():
        yield f"Left out, {n} settings: {why}.\n"
    yield from _failures(table)
    if found:
        yield "## Claims\n"
    for claim, finding in found:
        yield f"**{claim.text}** (the paper: {claim.paper})\n"
        yield f"- Predicted: {claim.prediction}"
        yield f"- Found: {finding.what}: {finding.figure}."
        yield f"- **{finding.verdict}**{f'. {finding.note}' if finding.note else ''}\n"
    if complete(table):
        yield "![What was found](figure.png)\n"
    yield "## Results\n"
    yield "Mean over the seeds, with its 95 % interval; all runs are in table.csv.\n"
    yield from _summary(study, table)


def _failures(table: Table) -> Iterator[str]:
    if not table.failed:
        return
    yield f"**{len(table.failed)} of {len(table)} runs raised:**\n"
    for row in table.failed[:MOST_ERRORS]:
        yield f"- {_told_setting(row)}: {row.error}"
    if len(table.failed) > MOST_ERRORS:
        yield f"- and {len(table.failed) - MOST_ERRORS} more"
    yield ""


def _told_setting(row: Row) -> str:
    return ", ".join([*(f"{k} = {v}" for k, v in row.setting.items()), f"seed {row.seed}"])


def _summary(study: Study, table: Table) -> Iterator[str]:
    """A line for each setting."""
    head, rows = summary(study, table)
    yield f"| {' | '.join(head)} |"
    yield "|" + "---|" * len(head)
    for cells in rows:
        yield f"| {' | '.join(cells)} |"


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
    interval, known = estimated(rows, metric)
    if interval is None:
        return None
    limits = {name: _known(getattr(interval, name)) for name in ("value", "low", "high")}
    return {**limits, "known_of": known}


def estimated(rows: Table, metric: str) -> tuple[Interval | None, int]:
    """A metric over rows, None where it is known of none, and of how many it is known. What is true
    or false is a share, with its exact interval; else it is a mean.
    """
    known = [record[metric] for record in rows.records() if record[metric] is not None]
    if not known:
        return None, 0
    if all(isinstance(value, bool) for value in known):
        return proportion(sum(known), len(known)), len(known)
    return mean(known), len(known)


def _factor(value: Value) -> str:
    whole = isinstance(value, int) and not isinstance(value, bool)
    return f"{value:,}" if whole else str(value)


def summarized(rows: Table, metric: str) -> str:
    """A metric with its interval, and of how many runs if it is not known of all."""
    interval, known = estimated(rows, metric)
    if interval is None:
        return "–"
    values = [record[metric] for record in rows.records() if record[metric] is not None]
    if isinstance(values[0], bool):
        text = f"{sum(values)} of {known}, {interval}"
    else:
        text = str(interval) if known > 1 else number(interval.value)
    return text if known == len(rows) else f"{text}, {known} of {len(rows)} runs"


def _write_parquet(table: Table, folder: Path) -> None:
    import pyarrow as pa
    from pyarrow import parquet

    rows = list(table.lines())
    columns = {name: [row[k] for row in rows] for k, name in enumerate(table.columns())}
    with replacing(folder / "table.parquet") as path:
        parquet.write_table(pa.table({name: _column(v) for name, v in columns.items()}), path)


def _column(values: list[Any]) -> list[Any]:
    """Of one kind: where kinds are mixed, as text."""
    kinds = {type(value) for value in values if value is not None}
    if kinds <= {int, float} or len(kinds) <= 1:
        return [float(v) if kinds == {int, float} and v is not None else v for v in values]
    return [None if value is None else str(value) for value in values]
