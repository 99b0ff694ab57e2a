"""`mcloc team`: robots that localize each other."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mcloc.cli.options import Filter, Json, Motion, Recovery, Seed, Size, Threads
from mcloc.cli.values import robots, settings
from mcloc.errors import ConfigError, LogError

if TYPE_CHECKING:
    from mcloc.report.team_run import TeamRun

_Option = typer.Option
WAITING = "-"  # in place of a number that is not known

teams = typer.Typer(rich_markup_mode=None)


@teams.callback(invoke_without_command=True)
def about(context: typer.Context) -> None:
    """Localize robots that see each other: one that knows its place tells the others theirs.

    \b
      mcloc team run --data mrclam6 --landmarks-for 1
    """
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


@teams.command("run")
def run_team(
    data: Annotated[
        str | None,
        _Option(
            metavar="FOLDER",
            help="The logs of the robots: an MRCLAM folder, with its landmarks and the truth.",
        ),
    ] = None,
    landmarks_for: Annotated[
        str | None,
        _Option(
            metavar="N,N,...",
            help="Which robots use the landmarks that they see, such as 1,3, or none. The others "
            "have their wheels, and what they are told. Without it: all.",
        ),
    ] = None,
    told_start: Annotated[
        bool,
        _Option(
            "--told-start",
            help="Tell each robot where it starts, by the truth. Without it they are searched for "
            "on the whole floor.",
        ),
    ] = False,
    detections: Annotated[
        bool,
        _Option(
            "--detections/--no-detections",
            help="Whether robots that see each other are told where they are; --no-detections "
            "shows what each does alone.",
            show_default=False,
        ),
    ] = True,
    filter: Filter = None,
    motion: Motion = None,
    size: Size = None,
    recovery: Recovery = None,
    assignments: Annotated[
        list[str] | None,
        _Option(
            "--set",
            metavar="PART.NAME=VALUE",
            help="Set a parameter, such as detection.p_false=0.1, how well robots see each other, "
            "or team.window=5, when that is used; may be repeated. `mcloc models` lists all with "
            "their units. What is not set of detections is as of landmarks: one camera sees both.",
        ),
    ] = None,
    seed: Seed = None,
    threads: Threads = None,
    out: Annotated[
        Path | None,
        _Option(
            metavar="DIR",
            help="A folder for the results: summary.json, team.png, and for each robot N "
            "robotN.csv (its estimates) and robotN.tum (its path).",
        ),
    ] = None,
    plot: Annotated[bool, _Option("--plot/--no-plot", help="Draw team.png, with --out.")] = True,
    json: Json = False,
) -> None:
    """Replay the robots of an MRCLAM folder in one process: each with a filter of its own, and each
    told where it is whenever one of them sees another.

    All robots use landmarks, and tell each other what they know:

    \b
      mcloc team run --data mrclam6

    Only robot 1 does; how do the others fare, with it and without it?

    \b
      mcloc team run --data mrclam6 --landmarks-for 1 --told-start
      mcloc team run --data mrclam6 --landmarks-for 1 --told-start
        --no-detections

    Believe what robots see of each other less, and use it more often:

    \b
      mcloc team run --data mrclam6 --set detection.p_false=0.2
        --set team.window=5

    The table has for each robot the position error against the truth: its median, what 95 % of the
    time lies below, and the share of the time above 0.5 m; the error in heading; and the NEES, 2.4
    for a filter as sure as it should be, more for one that is too sure. Below it: how many
    detections were used, why others were not, and how long a message would be between robots.

    Exit codes: 0 done, 2 the input was wrong, 130 interrupted; then, too, --out gets what was found
    so far.
    """
    if data is None:
        raise ConfigError("which logs? Give --data FOLDER, an MRCLAM folder")
    from mcloc.cli.progress import shown
    from mcloc.report import check_folder
    from mcloc.report.summary import to_json
    from mcloc.report.team import TeamConfig
    from mcloc.report.team_files import write_team
    from mcloc.report.team_run import TeamRun

    parts = {"filter": filter, "motion": motion, "size": size, "recovery": recovery}
    config = TeamConfig(
        data,
        robots("--landmarks-for", landmarks_for),
        told_start,
        detections,
        {kind: name for kind, name in parts.items() if name is not None},
        settings(assignments or []),
        seed,
        threads,
    )
    if out is not None:
        check_folder(out)
    run, failure = TeamRun(config), None
    try:
        with shown() as show:
            for estimate in run:
                show(estimate)
    except (LogError, KeyboardInterrupt) as cause:
        failure = cause
    if out is not None and (failure is None or run.placed):
        write_team(run, out, plot)
    if failure is not None:
        if out is not None and run.placed:
            typer.echo(f"results so far are in {out}", err=True)
        raise failure
    if json:
        typer.echo(to_json(run.summary()), nl=False)
    else:
        _print(run, run.summary(), out)


def _print(run: "TeamRun", summary: dict[str, Any], out: Path | None) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table(box=None)
    for title in ("robot", "landmarks", "median, m", "95 %, m", "> 0.5 m", "heading", "NEES"):
        table.add_column(title, justify="right", no_wrap=True)
    for name, member in run.members.items():
        sees = "yes" if member.sees_landmarks else "no"
        table.add_row(name, sees, *_cells(summary["robots"][name]))
    Console(width=100).print(table)
    detections, sizes = summary["detections"], summary["message_bytes"]
    typer.echo(f"detections {detections['used']} used")
    for reason, count in detections["ignored"].items():
        typer.echo(f"ignored    {count} × {reason}")
    if sizes["max"] is not None:
        typer.echo(f"messages   median {sizes['median']:.0f} bytes, at most {sizes['max']}")
    typer.echo(f"seed       {run.seed}")
    if out is not None:
        typer.echo(f"results    {out}")


def _cells(accuracy: dict[str, Any] | None) -> list[str]:
    if accuracy is None:
        return [WAITING] * 5
    nees = accuracy["nees_median"]
    return [
        f"{accuracy['position_median_m']:.3f}",
        f"{accuracy['position_p95_m']:.2f}",
        f"{100.0 * accuracy['lost_fraction']['0.5']:.0f} %",
        f"{accuracy['heading_median_deg']:.1f}°",
        WAITING if nees is None else f"{nees:.1f}",
    ]
