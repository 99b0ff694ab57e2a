"""What a study leaves behind: table.csv, verdict.json, figure.png, study.md."""

import json
import math
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from mcloc.evaluation.intervals import Interval, mean, number, proportion
from mcloc.experiments.study import Claim, Finding, Study, Verdict
from mcloc.experiments.table import Row, Table, Value
from mcloc.storage import replacing

MOST_ERRORS = 5  # that are told one by one


def write_table(table: Table, folder: Path) -> None:
    """table.csv, and table.parquet where pyarrow is installed. Raises ConfigError."""
    with replacing(folder / "table.csv") as path:
        path.write_text(table.to_csv(), encoding="utf-8")
    with suppress(ImportError):
        _write_parquet(table, folder)


def write_results(
    study: Study,
    seeds: int,
    missing: Mapping[str, int],
    table: Table,
    folder: Path,
    made_by: str,
) -> list[tuple[Claim, Finding]]:
    """All of them; what became of each claim. Raises ConfigError where a file cannot be written."""
    write_table(table, folder)
    found = [(claim, decided(claim, table)) for claim in study.claims]
    with replacing(folder / "verdict.json") as path:
        verdicts = _verdicts(study, seeds, missing, table, found, made_by)
        path.write_text(json.dumps(verdicts, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
    with replacing(folder / "figure.png") as path:
        draw(study, table, path)
    with replacing(folder / "study.md") as path:
        lines = _page(study, seeds, missing, table, found, made_by)
        path.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")
    return found


def decided(claim: Claim, table: Table) -> Finding:
    """A claim's finding. Where a run raised, nobody knows what it would have shown: then a claim is
    reproduced in part at best, and not at all where no run of some setting told anything.
    """
    settings = [tuple(row.setting.items()) for row in table.rows]
    told = {tuple(row.setting.items()) for row in table.rows if row.record is not None}
    if not told.issuperset(settings):
        nothing = Interval(math.nan, math.nan, math.nan)
        return Finding(Verdict.NOT, "nothing: all runs of some setting raised", nothing)
    finding = claim.decide(table)
    if not table.failed:
        return finding
    verdict = Verdict.IN_PART if finding.verdict is Verdict.REPRODUCED else finding.verdict
    note = f"{finding.note} {len(table.failed)} of {len(table)} runs raised.".strip()
    return replace(finding, verdict=verdict, note=note)


def draw(study: Study, table: Table, path: Path) -> None:
    """The study's picture as a PNG; the same table, the same bytes."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 6.0), layout="constrained")
    study.draw(table, figure)
    figure.savefig(path, format="png", dpi=110, metadata={"Software": None})


def _verdicts(
    study: Study,
    seeds: int,
    missing: Mapping[str, int],
    table: Table,
    found: list[tuple[Claim, Finding]],
    made_by: str,
) -> dict[str, Any]:
    return {
        "study": study.number,
        "title": study.title,
        "runs": len(table),
        "seeds": seeds,
        "seeds_in_full": study.seeds,
        "raised": len(table.failed),
        "left_out": dict(missing),
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
    study: Study,
    seeds: int,
    missing: Mapping[str, int],
    table: Table,
    found: list[tuple[Claim, Finding]],
    made_by: str,
) -> Iterator[str]:
    yield f"# {study.number}: {study.title}\n"
    yield f"{study.source}. Made by {made_by}, with\n"
    fewer = "" if seeds == study.seeds else f" --runs {seeds}"
    yield f"    {study.command or f'mcloc study run {study.number}{fewer}'}\n"
    if seeds < study.seeds:
        yield f"**{seeds} of {study.seeds} runs for each setting: too few to rely on.**\n"
    yield study.about.strip() + "\n"
    for why, n in missing.items():
        yield f"Left out, {n} settings: {why}.\n"
    yield from _failures(table)
    if found:
        yield "## Claims\n"
    for claim, finding in found:
        yield f"**{claim.text}** (the paper: {claim.paper})\n"
        yield f"- Predicted: {claim.prediction}"
        yield f"- Found: {finding.what}: {finding.figure}."
        yield f"- **{finding.verdict}**{f'. {finding.note}' if finding.note else ''}\n"
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


def summary(study: Study, table: Table) -> tuple[list[str], list[list[str]]]:
    """The heads of columns, and a row of cells for each setting."""
    names = [name for name in study.factors if name not in study.over]
    settings = dict.fromkeys(
        tuple((name, row.setting[name]) for name in names) for row in table.rows
    )
    lines = []
    for setting in settings:
        rows = table.where(**dict(setting))
        lines.append(
            [
                *(_factor(value) for _, value in setting),
                str(len(rows) - len(rows.failed)),
                *(summarized(rows, metric) for metric in study.metrics),
                *(text(rows) for text in study.pooled.values()),
            ]
        )
    return [*names, "runs", *study.metrics.values(), *study.pooled], lines


def _factor(value: Value) -> str:
    whole = isinstance(value, int) and not isinstance(value, bool)
    return f"{value:,}" if whole else str(value)


def summarized(rows: Table, metric: str) -> str:
    """The mean of a metric with its interval, and of how many runs if it is not known of all. What
    is true or false is a share, with its exact interval.
    """
    known = [record[metric] for record in rows.records() if record[metric] is not None]
    if not known:
        return "–"
    if all(isinstance(value, bool) for value in known):
        text = f"{sum(known)} of {len(known)}, {proportion(sum(known), len(known))}"
    elif len(known) > 1:
        text = str(mean(known))
    else:
        text = number(float(known[0]))
    return text if len(known) == len(rows) else f"{text}, {len(known)} of {len(rows)} runs"


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
