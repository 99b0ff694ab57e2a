"""`mcloc sweep`: settings compared on a user's own map and log."""

import shlex
import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from mcloc.cli.fleet import Cluster, Jobs, Resume, check_jobs, check_some, conducted
from mcloc.cli.values import pose, settings, topics, varied
from mcloc.errors import ConfigError


def sweep(
    log: Annotated[
        str | None, typer.Option(metavar="FILE", help="The recorded log, as for `mcloc run`.")
    ] = None,
    map: Annotated[
        str | None, typer.Option(metavar="FILE", help="The map, as for `mcloc run`.")
    ] = None,
    truth: Annotated[
        str | None,
        typer.Option(
            metavar="FILE", help="The true path in the map frame: CSV t,x,y,theta or TUM."
        ),
    ] = None,
    topic: Annotated[
        list[str] | None,
        typer.Option(metavar="ROLE=NAME", help="A topic of a bag, as for `mcloc run`."),
    ] = None,
    mount: Annotated[
        str | None,
        typer.Option(
            metavar="X,Y,THETA_DEG", help="Where the laser sits on the robot (m, m, degrees)."
        ),
    ] = None,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=V1,V2,...",
            help="What to vary: a parameter (sensor.sigma_hit=0.05,0.1,0.2), a part "
            "(sensor=likelihood-field,beam-four-part) or particles=1000,5000; may be repeated: "
            "every combination is run.",
        ),
    ] = None,
    assignments: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="PART.NAME=VALUE",
            help="A parameter that is the same in all runs, also where parts are varied.",
        ),
    ] = None,
    config: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Take all else from a YAML file, as for `mcloc run`."),
    ] = None,
    seeds: Annotated[
        int, typer.Option(metavar="N", min=1, help="Runs of each combination (and start).")
    ] = 5,
    starts: Annotated[
        int,
        typer.Option(
            metavar="K",
            min=0,
            help="Search for the robot on the whole map, from K moments of the log on that leave "
            "15 m to drive. Without it: track it from its true start.",
        ),
    ] = 0,
    teleports: Annotated[
        float,
        typer.Option(
            metavar="P",
            help="Carry the robot off with this chance for each metre, such as 0.01: to another "
            "moment of the log at least 5 m away, while odometry goes on.",
        ),
    ] = 0.0,
    jobs: Jobs = -1,
    cluster: Cluster = None,
    out: Annotated[Path, typer.Option(metavar="DIR", help="The folder for the results.")] = Path(
        "mcloc-sweep"
    ),
    resume: Resume = False,
    json: Annotated[
        bool, typer.Option("--json", help="Print the table as JSON, and nothing else.")
    ] = False,
) -> None:
    """Compare settings on your own map and log: accuracy, success and speed.

    How noisy is the sensor best taken for, while tracking?

    \b
      mcloc sweep --map floor.yaml --log drive.log.gz --truth truth.csv
        --vary sensor.sigma_hit=0.05,0.1,0.2 --seeds 5

    How many particles does it take to find the robot from nothing, from 10 moments of the log?

    \b
      mcloc sweep --map floor.yaml --log drive.log.gz --truth truth.csv
        --vary particles=1000,5000,20000 --vary size=fixed --starts 10

    Would a computer that is 10 times slower keep up? One process, so that they do not slow each
    other down:

    \b
      mcloc sweep --map floor.yaml --log drive.log.gz --truth truth.csv
        --vary pace=measured --vary pace.slowdown=1,3,10 --jobs 1

    Where the robot starts follows from the truth, whatever a --config says; its start and end say
    which part of the log is used. The folder of --out gets table.csv (a row for each run),
    figure.png and study.md (intervals included); journal.jsonl takes each run as it is finished,
    for --resume, which also makes those again that raised. Exit codes: 0 done, 1 every run raised,
    2 the input was wrong, 130 interrupted.
    """
    import json as as_json

    from mcloc.config import merged, read_entries
    from mcloc.experiments.plan import Plan
    from mcloc.experiments.summary import figures, summary
    from mcloc.experiments.sweep import Sweep, checked
    from mcloc.experiments.sweep_study import study
    from mcloc.report import check_folder

    entries: dict[str, Any] = {} if config is None else read_entries(config)
    given = {
        "map": map,
        "log": log,
        "truth": truth,
        "topics": topics(topic or []) or None,
        "mount": pose("--mount", mount),
    }
    entries = merged(entries, {key: value for key, value in given.items() if value is not None})
    if "log" not in entries:
        raise ConfigError("which log? Give --log FILE, or --config with one in it")
    wanted = Sweep(entries, settings(assignments or []), varied(vary or []), starts, teleports)
    check_jobs(jobs)
    checked(wanted)
    check_folder(out)
    plan = Plan.of(study(wanted, seeds, shlex.join(["mcloc", *sys.argv[1:]])))
    table = conducted(plan, out, jobs=jobs, cluster=cluster, resume=resume)
    if json:
        told = figures(plan.study, table)
        typer.echo(as_json.dumps(told, indent=2, ensure_ascii=False))
    else:
        _print(*summary(plan.study, table))
        typer.echo(f"results: {out / 'study.md'}, picture: {out / 'figure.png'}")
    check_some(table)


def _print(head: list[str], rows: list[list[str]]) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table(box=None, padding=(0, 2, 0, 0))
    for name in head:
        table.add_column(name)
    for cells in rows:
        table.add_row(*cells)
    console = Console()
    if not console.is_terminal:  # a file is as wide as it has to be
        console.width = 40 + 26 * len(head)
    console.print(table)
