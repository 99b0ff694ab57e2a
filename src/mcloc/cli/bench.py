"""`mcloc bench`: how fast the kernels are on this machine, and against plain NumPy."""

from typing import TYPE_CHECKING, Annotated, Any

import typer

from mcloc.errors import ConfigError, MapError

if TYPE_CHECKING:
    from mcloc.benchmarks.bench import Plan, Result

LISTS = ("--beams", "--particles", "--threads", "--cloud", "--operation")
MOST_PARTICLES, MOST_BEAMS = 10_000_000, 10_000


class WithLists(typer.core.TyperCommand):
    """Options that take several values: `--beams 60 180` as well as `--beams 60 --beams 180`."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        return super().parse_args(ctx, spelt_out(args))


def spelt_out(args: list[str]) -> list[str]:
    """Each value of a list behind a name of its own."""
    found: list[str] = []
    option, filled = "", False
    for word in args:
        if word.startswith("--"):
            option, filled = (word if word in LISTS else ""), False
            found.append(word)
        elif option and filled:
            found += [option, word]
        else:
            found.append(word)
            filled = True
    return found


def bench(
    map: Annotated[
        str | None,
        typer.Option(metavar="FILE", help="The map; without it the museum of the demo."),
    ] = None,
    beams: Annotated[
        list[str] | None,
        typer.Option(
            metavar="B ...",
            help="Beams of the scan, such as 60 180 (which is what is measured without it).",
        ),
    ] = None,
    particles: Annotated[
        list[str] | None,
        typer.Option(
            metavar="N ...", help="How many particles, such as 1e3 1e4 1e5 1e6 (the same)."
        ),
    ] = None,
    cloud: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME ...",
            help="tracking (Gaussian, 0.15 m and 0.05 rad), uniform (all over the map), or both.",
        ),
    ] = None,
    operation: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME ...", help="Measure these operations only."),
    ] = None,
    threads: Annotated[
        list[str] | None,
        typer.Option(metavar="T ...", help="Threads, such as 1 2; without it one."),
    ] = None,
    json: Annotated[
        bool, typer.Option("--json", help="Print the results as JSON, and nothing else.")
    ] = False,
) -> None:
    """Measure how fast this machine runs mcloc, and how much faster that is than plain NumPy.

    Each operation is run in turn with a reference: the same work in vectorised NumPy, float64
    (SciPy for the distance transform). The table gives medians, the time for one unit (a particle
    and beam, a particle or a cell), and how many times as long the reference takes.

    \b
      mcloc bench --particles 1e4 --beams 60
      mcloc bench --map floor.yaml --operation step_adaptive --threads 1 4
      mcloc bench --json > speed.json

    Everything takes some minutes; beams that are cast take longest. If it is interrupted, it prints
    what it has measured so far.
    """
    import json as as_json

    from mcloc.benchmarks.bench import described

    results: list[Result] = []
    try:
        _measure(map, _plan(beams, particles, cloud, operation, threads), results)
    finally:  # also what was measured before it was interrupted
        if json and results:
            typer.echo(as_json.dumps(described(results), indent=2))
        elif results:
            _print(results)


def _plan(
    beams: list[str] | None,
    particles: list[str] | None,
    clouds: list[str] | None,
    operations: list[str] | None,
    threads: list[str] | None,
) -> "Plan":
    from mcloc.benchmarks.bench import Plan
    from mcloc.benchmarks.operations import OPERATIONS
    from mcloc.benchmarks.scene import CLOUDS

    given: dict[str, Any] = {
        "operations": operations and _names("--operation", operations, OPERATIONS),
        "clouds": clouds and _names("--cloud", clouds, CLOUDS),
        "particles": particles and _numbers("--particles", particles, MOST_PARTICLES),
        "beams": beams and _numbers("--beams", beams, MOST_BEAMS),
        "threads": threads and _numbers("--threads", threads, 1024),
    }
    return Plan(**{key: value for key, value in given.items() if value})


def _numbers(option: str, words: list[str], most: int) -> list[int]:
    """Whole numbers from 1 to `most`, 1e4 and 60,180 among them. Raises ConfigError."""
    found = []
    for word in ",".join(words).split(","):
        try:
            number = float(word)
        except ValueError:
            number = 0.0
        if not (1 <= number <= most and number == int(number)):
            raise ConfigError(f"{option} takes whole numbers from 1 to {most:g}, got {word!r}")
        found.append(int(number))
    return found


def _names(option: str, words: list[str], known: Any) -> list[str]:
    """Known names. Raises ConfigError."""
    from mcloc.registry import suggest

    names = ",".join(words).split(",")
    for name in names:
        if name not in known:
            raise ConfigError(f"{option}: unknown {name!r}; {suggest(name, known)}")
    return names


def _measure(path: str | None, plan: "Plan", results: list["Result"]) -> None:
    """Add what is measured to the results, one after the other."""
    from mcloc.benchmarks.bench import measured
    from mcloc.benchmarks.scene import Scene, demo_map
    from mcloc.cli.progress import counted
    from mcloc.maps.occupancy import OccupancyGrid

    grid = demo_map() if path is None else OccupancyGrid.load(path)
    cases = plan.cases(Scene.on(grid))
    with counted("measurements", len(cases)) as advance:
        for name, case in cases:
            try:
                results += measured(name, case, plan.threads)
            except MapError as cause:  # the other operations can do without
                typer.echo(f"{name} is left out: {cause}", err=True)
            advance()


def _print(results: list["Result"]) -> None:
    from rich.console import Console
    from rich.table import Table

    from mcloc.benchmarks.bench import cpu

    table = Table(title=cpu(), title_justify="left", box=None, padding=(0, 2, 0, 0))
    table.add_column("operation", no_wrap=True)
    table.add_column("cloud", no_wrap=True)
    for name in ("particles", "beams", "threads", "ms", "ns / unit", "NumPy, ms", "ratio"):
        table.add_column(name, justify="right")
    for r in results:
        table.add_row(
            r.operation,
            r.cloud or "",
            "" if r.particles is None else f"{r.particles:,}",
            "" if r.beams is None else str(r.beams),
            str(r.threads),
            f"{r.ms:.3g}",
            f"{r.ns_per_unit:.3g}",
            "" if r.reference_ms is None else f"{r.reference_ms:.3g}",
            "" if r.ratio is None else f"{r.ratio:.1f} ×",
        )
    console = Console()
    if not console.is_terminal:  # a file is as wide as it has to be
        console.width = 100
    console.print(table)
