"""`mcloc`: its commands, and what becomes of their errors."""

import io
import os
import signal
import sys
from typing import Annotated, Any

import typer

from mcloc import __version__
from mcloc.cli.bench import WithLists, bench
from mcloc.cli.eval import evaluate_files
from mcloc.cli.info import show_info
from mcloc.cli.models import show_models
from mcloc.cli.run import run
from mcloc.cli.simulate import simulate_drive
from mcloc.cli.study import studies
from mcloc.cli.sweep import sweep
from mcloc.cli.team import teams
from mcloc.cli.team_join import join
from mcloc.errors import McLocError

# The class of "no such option" and its like; typer names none, and its home moved between versions.
_UsageError: type[Exception] = typer.BadParameter.__bases__[0]

FAILED = 1
INPUT_WRONG = 2
INTERRUPTED = 130  # 128 + SIGINT, as shells have it
TERMINATED = 143  # 128 + SIGTERM


class _Terminated(KeyboardInterrupt):
    """SIGTERM: what Ctrl-C saves is saved then, too."""


class _Commands(typer.core.TyperGroup):
    """Turns what a user can cause into a line on stderr and an exit code."""

    def invoke(self, ctx: Any) -> Any:
        try:
            return super().invoke(ctx)
        except McLocError as cause:
            typer.echo(f"error: {cause}", err=True)
        except _UsageError as cause:
            where = getattr(getattr(cause, "ctx", None), "command_path", "mcloc")
            typer.echo(f"error: {cause.format_message()}", err=True)  # type: ignore[attr-defined]
            typer.echo(f"`{where} --help` lists what it takes.", err=True)
        except KeyboardInterrupt as cause:
            typer.echo("interrupted", err=True)
            code = TERMINATED if isinstance(cause, _Terminated) else INTERRUPTED
            raise typer.Exit(code) from None
        raise typer.Exit(INPUT_WRONG)


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"mcloc {__version__}")
        raise typer.Exit


app = typer.Typer(
    cls=_Commands,
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)
app.command("run")(run)
app.command("eval")(evaluate_files)
app.command("info")(show_info)
app.command("simulate")(simulate_drive)
app.command("models")(show_models)
app.command("sweep")(sweep)
app.add_typer(studies, name="study")
teams.command("join")(join)
app.add_typer(teams, name="team")
app.command("bench", cls=WithLists)(bench)


@app.callback()
def main_options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Monte Carlo localization: a map and a log in, the robot's path in the map out."""


def main() -> None:
    """The program."""
    signal.signal(signal.SIGTERM, _terminate)
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")  # rather no θ than no result
    try:
        app()
    except OSError as cause:
        if sys.stdout is None or _takes_output():
            raise
        typer.echo(f"error: stdout cannot be written ({cause.strerror})", err=True)
        sys.exit(FAILED)


def _terminate(*_: object) -> None:
    raise _Terminated


def _takes_output() -> bool:
    """Whether stdout can be written, by trying; where not, what waits to be is given up."""
    try:
        print(flush=True)
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return False
    return True
