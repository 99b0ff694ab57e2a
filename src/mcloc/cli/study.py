"""`mcloc study`: the studies of the papers, listed and run."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mcloc.cli.fleet import Cluster, Jobs, Resume, check_jobs, check_some, conducted
from mcloc.errors import ConfigError

if TYPE_CHECKING:
    from mcloc.experiments.plan import Plan

studies = typer.Typer(rich_markup_mode=None)


@studies.callback(invoke_without_command=True)
def about(context: typer.Context) -> None:
    """Reproduce the studies of the papers: what they claim, and what comes out here.

    \b
      mcloc study list
      mcloc study run E5
    """
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


@studies.command("list")
def list_studies(
    json: Annotated[
        bool, typer.Option("--json", help="Print the list as JSON, and nothing else.")
    ] = False,
) -> None:
    """List the studies, how many runs each takes in full, and what is missing here for it."""
    import json as as_json

    from mcloc.experiments.catalog import STUDIES

    told = [_told(number) for number in STUDIES]
    if json:
        typer.echo(as_json.dumps(told, indent=2, ensure_ascii=False))
        return
    for study in told:
        runs = f"{study['settings']} settings × {study['seeds']} seeds"
        typer.echo(f"{study['study']:4} {study['title']}")
        typer.echo(f"     {study['source']}; {runs}, {study['claims']} claims")
        for why, n in study["left_out"].items():
            typer.echo(f"     {n} settings cannot be run here: {why}")


def _told(number: str) -> dict[str, Any]:
    from mcloc.experiments.catalog import STUDIES

    study = STUDIES[number]
    missing = [why for why in map(study.missing, study.settings()) if why is not None]
    return {
        "study": number,
        "title": study.title,
        "source": study.source,
        "settings": len(study.settings()),
        "seeds": study.seeds,
        "claims": len(study.claims),
        "left_out": {why: missing.count(why) for why in dict.fromkeys(missing)},
    }


@studies.command("run")
def run_studies(
    numbers: Annotated[
        list[str],
        typer.Argument(metavar="E5 ...", help="Which studies; `mcloc study list` names them."),
    ],
    runs: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            help="Seeds for each setting; without it as many as the full study has. A few show "
            "that it works, not what is true.",
        ),
    ] = None,
    jobs: Jobs = -1,
    cluster: Cluster = None,
    out: Annotated[
        Path,
        typer.Option(metavar="DIR", help="Each study gets a folder of its own in this one."),
    ] = Path("mcloc-studies"),
    resume: Resume = False,
    json: Annotated[
        bool, typer.Option("--json", help="Print the verdicts as JSON, and nothing else.")
    ] = False,
) -> None:
    """Run studies; say which claims of the papers hold here.

    A quick look, and the full study on two processes:

    \b
      mcloc study run E5 --runs 1 --out quick
      mcloc study run E5 --jobs 2

    On a cluster of machines that all have mcloc (pip install 'mcloc[cluster]'):

    \b
      dask scheduler
      dask worker tcp://127.0.0.1:8786 --nthreads 1
      mcloc study run E5 --cluster tcp://127.0.0.1:8786

    Each finished run goes into journal.jsonl at once; after an interruption or a crash --resume
    goes on from there. At the end the study's folder holds table.csv, verdict.json, figure.png and
    study.md. Studies on recorded logs look for them in the folder that MCLOC_DATA names; what is
    not there is left out, and told. Exit codes: 0 done, whatever the verdicts; 1 every run of a
    study raised; 2 the input was wrong; 130 interrupted.
    """
    import json as as_json

    from mcloc.experiments.catalog import study_named
    from mcloc.experiments.plan import Plan
    from mcloc.experiments.runner import opened
    from mcloc.report import check_folder

    check_jobs(jobs)
    plans = [Plan.of(study, runs) for study in map(study_named, numbers)]
    if len({plan.study.number for plan in plans}) < len(plans):
        raise ConfigError(f"a study is named twice: {' '.join(numbers)}")
    for plan in plans:  # all of them, before hours go into the first
        check_folder(out / plan.study.folder)
        opened(plan, out / plan.study.folder, resume).close()
    tables, verdicts = [], []
    for plan in plans:
        folder = out / plan.study.folder
        tables.append(conducted(plan, folder, jobs=jobs, cluster=cluster, resume=resume))
        verdicts.append(_verdict(folder))
        if not json:
            _print(plan, verdicts[-1], folder)
    if json:
        typer.echo(as_json.dumps(verdicts, indent=2, ensure_ascii=False))
    for table in tables:
        check_some(table)


def _verdict(folder: Path) -> dict[str, Any]:
    import json

    found: dict[str, Any] = json.loads((folder / "verdict.json").read_text(encoding="utf-8"))
    return found


def _print(plan: "Plan", verdict: dict[str, Any], folder: Path) -> None:
    study = plan.study
    raised = f", {verdict['raised']} of which raised" if verdict["raised"] else ""
    typer.echo(f"{study.number}: {study.title} ({verdict['runs']} runs{raised})")
    for claim in verdict["claims"]:
        typer.echo(f"  {claim['verdict']}: {claim['claim']}")
        typer.echo(f"    {claim['figure']}: {claim['told']}")
    if verdict["seeds"] < verdict["seeds_in_full"]:
        typer.echo(f"  {verdict['seeds']} of {verdict['seeds_in_full']} seeds: too few to rely on")
    for why, n in verdict["left_out"].items():
        typer.echo(f"  {n} settings left out: {why}")
    typer.echo(f"  results: {folder / 'study.md'}, picture: {folder / 'figure.png'}")
