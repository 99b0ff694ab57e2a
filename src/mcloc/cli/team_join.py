"""`mcloc team join`: a robot of a team, in a process of its own."""

from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mcloc.cli.job import Job, execute
from mcloc.cli.options import (
    Config,
    End,
    Filter,
    Initial,
    InitialSigma,
    Json,
    Motion,
    Out,
    Particles,
    Plot,
    Recovery,
    Seed,
    Sensor,
    Size,
    Start,
    Threads,
    Truth,
)
from mcloc.cli.values import pose, settings
from mcloc.errors import ConfigError, MessageError

if TYPE_CHECKING:
    from mcloc.config import RunConfig
    from mcloc.report import Run
    from mcloc.team.peers import Peers

_Option = typer.Option


def join(
    name: Annotated[
        str | None,
        _Option(
            metavar="NAME",
            help="What the others call this robot when they see it. Of an MRCLAM folder: its "
            "number, which need not be given.",
        ),
    ] = None,
    map: Annotated[
        str | None, _Option(metavar="FILE", help="The map: a ROS map's .yaml, or a wean.dat.")
    ] = None,
    log: Annotated[
        str | None,
        _Option(
            metavar="FILE",
            help="Its recorded log: a ROS 1 or ROS 2 bag, CARMEN or Wean Hall, gzip or not.",
        ),
    ] = None,
    detections: Annotated[
        str | None,
        _Option(
            metavar="FILE",
            help="The robots that it saw: CSV with a header t,seen,range,bearing,heading (s, "
            "name, m, rad, rad); the last two may be left out, or empty.",
        ),
    ] = None,
    data: Annotated[
        str | None,
        _Option(
            metavar="FOLDER",
            help="Instead of map, log and detections: an MRCLAM folder, with --robot.",
        ),
    ] = None,
    robot: Annotated[
        int | None, _Option(metavar="N", help="Which robot of the MRCLAM folder.")
    ] = None,
    landmarks: Annotated[
        bool,
        _Option(
            "--landmarks/--no-landmarks",
            help="Whether the landmarks that it sees are used. Without them it has its wheels, and "
            "what it is told.",
            show_default=False,
        ),
    ] = True,
    told_start: Annotated[
        bool,
        _Option("--told-start", help="Start where the truth of the MRCLAM folder says."),
    ] = False,
    team: Annotated[
        str, _Option(metavar="NAME", help="Which team; others are not heard.")
    ] = "team",
    listen: Annotated[
        list[str] | None,
        _Option(
            metavar="ENDPOINT",
            help="Where others can connect, such as tcp/192.168.1.5:7447; may be repeated. Without "
            "it: at a free port of this computer alone, which is printed.",
        ),
    ] = None,
    connect: Annotated[
        list[str] | None,
        _Option(
            metavar="ENDPOINT",
            help="Where one of the others listens; may be repeated. It need not be there yet. "
            "Through it the rest is found.",
        ),
    ] = None,
    search: Annotated[
        bool,
        _Option("--search", help="Look for others in the local network, too, by multicast."),
    ] = False,
    peers: Annotated[
        int | None,
        _Option(
            metavar="N",
            min=0,
            help="Begin once N others are there, or peers.patience is over. Without it 1 where "
            "--connect or --search is given, else 0.",
        ),
    ] = None,
    initial: Initial = None,
    initial_sigma: InitialSigma = None,
    truth: Truth = None,
    start: Start = None,
    end: End = None,
    filter: Filter = None,
    motion: Motion = None,
    sensor: Sensor = None,
    size: Size = None,
    particles: Particles = None,
    recovery: Recovery = None,
    assignments: Annotated[
        list[str] | None,
        _Option(
            "--set",
            metavar="PART.NAME=VALUE",
            help="Set a parameter, such as peers.clock_bound=0.2, detection.p_false=0.1 or "
            "team.window=5; may be repeated. `mcloc models` lists all with their units. All robots "
            "of a team need the same detection.",
        ),
    ] = None,
    config: Config = None,
    seed: Seed = None,
    threads: Threads = None,
    out: Out = Path("mcloc-out"),
    plot: Plot = True,
    json: Json = False,
) -> None:
    """Localize a robot of a team in a process of its own: where it sees another one, or is seen,
    the two processes tell each other where they are. No server is needed, and nobody waits for a
    robot that is gone.

    Two robots on one computer; the first prints where it listens:

    \b
      mcloc team join --name r1 --map floor.yaml --log r1.mcap
        --detections r1.csv --listen tcp/127.0.0.1:7447 --peers 1
      mcloc team join --name r2 --map floor.yaml --log r2.mcap
        --detections r2.csv --connect tcp/127.0.0.1:7447 --out r2

    Robots of an MRCLAM folder, of which the second uses no landmarks:

    \b
      mcloc team join --data mrclam6 --robot 1 --peers 1
        --listen tcp/127.0.0.1:7447 --out r1
      mcloc team join --data mrclam6 --robot 2 --no-landmarks
        --connect tcp/127.0.0.1:7447 --out r2

    The logs are replayed together: no robot is past the stamp of a sighting before the one that saw
    it has told. Messages that are malformed, come twice or too late, or are of a robot whose clock
    is more than peers.clock_bound off, are left out and counted, by reason. Without encryption
    anybody who can reach an endpoint can tell robots where they are: listen only where you trust
    the network.

    The folder of --out gets what `mcloc run` writes. Exit codes: as there.
    """
    if data is not None and (map, log, detections) != (None, None, None):
        raise ConfigError("--data is in the place of --map, --log and --detections: give one")
    if data is not None and robot is not None and (name or str(robot)) != str(robot):
        raise ConfigError(f"--name {name}: in an MRCLAM folder robot {robot} is called {robot}")
    name = name or (str(robot) if robot is not None else None)
    if name is None:
        raise ConfigError("what is the robot called by those that see it? Give --name NAME")
    given: dict[str, Any] = {
        "map": map,
        "log": data or log,
        "truth": truth,
        "initial": pose("--initial", initial),
        "initial_sigma": pose("--initial-sigma", initial_sigma),
        "start": start,
        "end": end,
        "robot": robot,
        "seed": seed,
        "threads": threads,
        "filter": filter,
        "motion": motion,
        "sensor": sensor,
        "size": size,
        "recovery": recovery,
    }
    flags = {key: value for key, value in given.items() if value is not None}
    assigned = settings(assignments or [])
    awaited = int(bool(connect) or search) if peers is None else peers

    with ExitStack() as stack:

        def joined(run: "RunConfig") -> "Run":
            from mcloc.report.joined import OF_MEMBER, Joined, JoinedRun

            of_member = {part: of for part, of in assigned.items() if part in OF_MEMBER}
            as_told = Joined(name, awaited, detections, landmarks, told_start, of_member)
            carrier = _connected(name, team, listen or [], connect or [], search)
            stack.callback(carrier.close)
            return JoinedRun(run, as_told, carrier, lambda said: typer.echo(said, err=True))

        of_run = {part: of for part, of in assigned.items() if part not in _of_member()}
        execute(
            Job(
                config,
                None,
                flags,
                particles,
                of_run,
                out,
                plot,
                gif=False,
                record=False,
                json=json,
                every=None,
                resume=False,
                make=joined,
            )
        )


def _of_member() -> Any:
    from mcloc.report.joined import OF_MEMBER

    return OF_MEMBER


def _connected(
    name: str, team: str, listen: list[str], connect: list[str], search: bool
) -> "Peers":
    """The connection, which says where it listens."""
    from mcloc.team.peers import LOOPBACK, Peers

    try:
        peers = Peers(name, team, listen=listen or [LOOPBACK], connect=connect, search=search)
    except MessageError as why:
        raise ConfigError(f"--name {name!r}, --team {team!r}: {why}") from why
    typer.echo(f"{name} listens at {', '.join(peers.listening)}", err=True)
    return peers
