"""Many runs from the command line: the options that say where, and their progress."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mcloc.errors import ConfigError

if TYPE_CHECKING:
    from mcloc.experiments.runner import Plan
    from mcloc.experiments.table import Row, Table

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
    from mcloc.report import check_folder

    if jobs == 0 or jobs < -1:
        raise ConfigError(f"--jobs is a number of processes >= 1, or -1 for one a core, got {jobs}")
    check_folder(folder)
    total = len(plan.tasks())
    finished = 0
    with counted(f"runs of {plan.study.number}", total) as advance:

        def done(row: "Row | None") -> None:
            nonlocal finished
            finished += 1
            advance(before=row is None)

        try:
            return conduct(plan, folder, jobs=jobs, cluster=cluster, resume=resume, done=done)
        except KeyboardInterrupt:
            typer.echo(f"{finished} of {total} runs are in {folder}; --resume goes on", err=True)
            raise
