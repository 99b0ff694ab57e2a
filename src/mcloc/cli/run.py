"""`mcloc run`: a map and a log in, a folder of results out."""

from pathlib import Path
from typing import Annotated, Any

import typer

from mcloc.cli.values import pose, settings
from mcloc.errors import ConfigError, McLocError

_Option = typer.Option


def run(
    map: Annotated[
        str | None,
        _Option(metavar="FILE", help="The map: a ROS map's .yaml, or a wean.dat; gzip or not."),
    ] = None,
    log: Annotated[
        str | None,
        _Option(metavar="FILE", help="The recorded log: CARMEN or Wean Hall, gzip or not."),
    ] = None,
    initial: Annotated[
        str | None,
        _Option(
            metavar="X,Y,THETA_DEG",
            help="Where the robot starts, in the map frame (m, m, degrees), such as 12.5,-3,90. "
            "Without it the robot is searched for on the whole map.",
        ),
    ] = None,
    initial_sigma: Annotated[
        str | None,
        _Option(
            metavar="SX,SY,STHETA_DEG",
            help="Standard deviations of --initial (m, m, degrees), such as 0.5,0.5,15.",
        ),
    ] = None,
    search: Annotated[
        bool,
        _Option(
            "--global",
            help="Search on the whole map, also where the --config file has a start pose.",
        ),
    ] = False,
    start: Annotated[
        float | None,
        _Option(metavar="T", help="Begin at this stamp of the log (s)."),
    ] = None,
    end: Annotated[
        float | None,
        _Option(metavar="T", help="End at this stamp of the log (s)."),
    ] = None,
    truth: Annotated[
        str | None,
        _Option(
            metavar="FILE",
            help="The true path in the map frame, to tell the accuracy by: CSV with a header "
            "t,x,y,theta (s, m, m, rad), or TUM.",
        ),
    ] = None,
    filter: Annotated[
        str | None, _Option(metavar="NAME", help="The filter; `mcloc models` lists all names.")
    ] = None,
    motion: Annotated[str | None, _Option(metavar="NAME", help="The motion model.")] = None,
    sensor: Annotated[str | None, _Option(metavar="NAME", help="The sensor model.")] = None,
    size: Annotated[
        str | None,
        _Option(
            metavar="NAME",
            help="How many particles: kld (as many as the spread of the belief needs) or fixed.",
        ),
    ] = None,
    particles: Annotated[
        int | None,
        _Option(metavar="N", help="With --size fixed: how many. With kld: at most this many."),
    ] = None,
    recovery: Annotated[
        str | None,
        _Option(metavar="NAME", help="From kidnapping: none, random or augmented."),
    ] = None,
    resampler: Annotated[
        str | None,
        _Option(
            metavar="NAME",
            help="systematic, or selective: only where the effective sample size is low.",
        ),
    ] = None,
    mount: Annotated[
        str | None,
        _Option(
            metavar="X,Y,THETA_DEG",
            help="Where the laser sits on the robot (m ahead, m to the left, degrees), such as "
            "0.25,0,0. Without it: what the log says.",
        ),
    ] = None,
    assignments: Annotated[
        list[str] | None,
        _Option(
            "--set",
            metavar="PART.NAME=VALUE",
            help="Set a parameter, such as sensor.sigma_hit=0.1 or update.distance=0.5; may be "
            "repeated. `mcloc models` lists all with their units.",
        ),
    ] = None,
    config: Annotated[
        Path | None,
        _Option(
            metavar="FILE",
            help="Take everything from a YAML file, such as the config.yaml of an earlier run; "
            "options given beside it win.",
        ),
    ] = None,
    seed: Annotated[
        int | None,
        _Option(metavar="S", help="Of the random numbers: the same seed, the same estimates."),
    ] = None,
    threads: Annotated[
        int | None,
        _Option(metavar="T", help="Threads; without it one a core. No result depends on it."),
    ] = None,
    out: Annotated[
        Path,
        _Option(metavar="DIR", help="The folder for the results; its files are replaced."),
    ] = Path("mcloc-out"),
    plot: Annotated[bool, _Option("--plot/--no-plot", help="Draw run.png.")] = True,
    json: Annotated[
        bool, _Option("--json", help="Print summary.json to stdout, and nothing else.")
    ] = False,
) -> None:
    """Localize a robot: a map and a recorded log in, its path in the map out.

    Search for the robot on the whole map:

    \b
      mcloc run --map floor.yaml --log drive.log.gz

    Start near x = 1.5 m, y = -2 m, facing along y, and compare with the truth:

    \b
      mcloc run --map floor.yaml --log drive.log.gz --initial 1.5,-2,90
        --truth truth.csv

    Repeat a run with another parameter:

    \b
      mcloc run --config mcloc-out/config.yaml --out other
        --set sensor.sigma_hit=0.1

    The folder of --out gets trajectory.tum, estimates.csv, timing.csv, summary.json, config.yaml
    and run.png. If the log is cut in the middle, or the run is interrupted, they hold the results
    so far. Exit codes: 0 done, 2 the input was wrong, 130 interrupted.
    """
    if search and initial is not None:
        raise ConfigError("--global and --initial exclude each other: give one of them")
    given: dict[str, Any] = {
        "map": map,
        "log": log,
        "truth": truth,
        "initial": pose("--initial", initial),
        "initial_sigma": pose("--initial-sigma", initial_sigma),
        "start": start,
        "end": end,
        "mount": pose("--mount", mount),
        "seed": seed,
        "threads": threads,
        "filter": filter,
        "motion": motion,
        "sensor": sensor,
        "size": size,
        "recovery": recovery,
        "resampler": resampler,
    }
    flags = {key: value for key, value in given.items() if value is not None}
    if search:
        flags["initial"] = None
    _execute(config, flags, particles, settings(assignments or []), out, plot, json)


def _execute(
    file: Path | None,
    flags: dict[str, Any],
    particles: int | None,
    assigned: dict[str, dict[str, str]],
    out: Path,
    plot: bool,
    json: bool,
) -> None:
    """Make the run; write what it found, also where it breaks off."""
    from mcloc.cli.progress import shown
    from mcloc.cli.story import told
    from mcloc.config import RunConfig, limited, merged, read_entries
    from mcloc.report import Run, check_folder, write_run
    from mcloc.report.summary import to_json

    entries = merged({} if file is None else read_entries(file), flags)
    if particles is not None:
        entries = limited(entries, particles)
    entries = merged(entries, {"settings": assigned})
    for needed in ("map", "log"):
        if needed not in entries:
            raise ConfigError(f"which {needed}? Give --{needed} FILE, or --config with one in it")
    if "initial_sigma" in flags and entries.get("initial") is None:
        raise ConfigError("--initial-sigma is about --initial: give both, or neither")
    config = RunConfig(**entries)
    check_folder(out)
    failure: BaseException | None = None
    current: Run | None = None
    try:
        with shown() as show:
            current = Run(config)
            for estimate in current:
                show(estimate)
    except (McLocError, KeyboardInterrupt) as cause:
        failure = cause
    if current is not None and current.estimates:
        try:
            summary = write_run(current, out, plot)
            typer.echo(to_json(summary) if json else told(summary, out, plot), nl=False)
        except McLocError as cause:
            failure = failure or cause
        if failure is not None:
            typer.echo(f"results up to t = {current.estimates[-1].t:.3f} s are in {out}", err=True)
    if failure is not None:
        raise failure
