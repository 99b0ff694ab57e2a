"""What a study leaves behind: table.csv, verdict.json, figure.png, study.md."""

import json
import math
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from mcloc.evaluation.intervals import Interval
from mcloc.experiments.plan import Plan
from mcloc.experiments.study import Claim, Finding, Study, Verdict
from mcloc.experiments.summary import known, summary
from mcloc.experiments.table import Row, Table
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
                "value": known(finding.figure.value),
                "interval": [known(finding.figure.low), known(finding.figure.high)],
                "told": str(finding.figure),
                "note": finding.note,
            }
            for claim, finding in found
        ],
    }


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
