"""Many runs from the command line: the options that say where, and their progress."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mcloc.errors import ConfigError

if TYPE_CHECKING:
    from mcloc.experiments.plan import Plan
    from mcloc.experiments.table import Table

Jobs = Annotated[
    int,
    typer.Option(metavar="J", help="Processes on this machine; -1: one a core."),
]
Cluster = Annotated[
    str | None,
    typer.Option(
        metavar="ADDRESS",
        help="Use the workers of a Dask scheduler instead, such as tcp://127.0.0.1:8786.",
    ),
]
Resume = Annotated[
    bool,
    typer.Option("--resume", help="Go on with what the journal in the folder of --out holds."),
]


def conducted(
    plan: "Plan", folder: Path, *, jobs: int, cluster: str | None, resume: bool
) -> "Table":
    """Make the runs of a plan, with a progress bar; their table. Raises McLocError."""
    from mcloc.cli.progress import counted
    from mcloc.experiments.runner import conduct

    total = len(plan.tasks())
    with counted(f"runs of {plan.study.number}", total) as advance:
        try:
            return conduct(
                plan,
                folder,
                jobs=jobs,
                cluster=cluster,
                resume=resume,
                done=lambda row: advance(before=row is None),
            )
        except KeyboardInterrupt:
            lines = (folder / "journal.jsonl").read_bytes().count(b"\n")
            typer.echo(f"{lines - 1} of {total} runs are in {folder}; --resume goes on", err=True)
            raise


def check_jobs(jobs: int) -> None:
    """Raises ConfigError for what is no number of processes."""
    if jobs == 0 or jobs < -1:
        raise ConfigError(f"--jobs is a number of processes >= 1, or -1 for one a core, got {jobs}")


def check_some(table: "Table") -> None:
    """Tell of runs that raised; exit code 1 where all did."""
    for row in table.failed[:1]:
        typer.echo(
            f"{len(table.failed)} of {len(table)} runs raised, the first: {row.error}", err=True
        )
        if len(table.failed) == len(table):
            raise typer.Exit(1)
