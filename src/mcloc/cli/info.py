"""`mcloc info`: what is in a map or a log, and what looks wrong."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mcloc.cli.values import Triple, pose, topics
from mcloc.errors import ConfigError, McLocError

if TYPE_CHECKING:
    from mcloc.events import Log
    from mcloc.inspection import LogInspection
    from mcloc.io.bag_log import Topics
    from mcloc.io.mrclam import Mrclam
    from mcloc.maps.occupancy import OccupancyGrid

_MAPS = (".yaml", ".yml", ".pgm", ".png", ".bmp")  # of an image the reader says what to give


def show_info(
    files: Annotated[
        list[Path],
        typer.Argument(
            metavar="FILE...",
            help="A map, a log, or both, in any order: a ROS map's .yaml or a wean.dat; a CARMEN "
            "or Wean Hall log, gzip or not, a ROS bag, or an MRCLAM folder.",
        ),
    ],
    topic: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ROLE=TOPIC",
            help="Which topic of a bag is what: scan=/scan (may be repeated), odometry=/odom, "
            "map=/map.",
        ),
    ] = None,
    mount: Annotated[
        str | None,
        typer.Option(
            metavar="X,Y,THETA_DEG",
            help="The laser's pose on the robot (m, m, degrees), instead of what the log says.",
        ),
    ] = None,
    robot: Annotated[
        int | None, typer.Option(metavar="N", help="Which robot of an MRCLAM folder.")
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="As JSON, and nothing else.")] = False,
) -> None:
    """Say what is in a map, a log, or both together, and what looks wrong.

      mcloc info map.yaml log.gz

    Findings are no failure: the exit code is 0 where all was read, 2 where the input was wrong. A
    log that is cut is told up to the cut.

    With both, the robot is searched for on the map, from some moments of the log on. If it is
    found, the two fit; if it is not, that may have other reasons.

    --json: {"map", "log", "fit", "findings"}, the first three null where there is nothing to say.
    Keys end in their units (_m, _s, _hz, _rad); x and y are in m, theta in rad, shares from 0 to 1.
    Each finding has "check" (a name that stays), "about", "what", "evidence" and "remedy".
    """
    from mcloc.cli.info_story import told_info
    from mcloc.config.run_config import check_mount
    from mcloc.report.summary import to_json

    maps = [path for path in files if _is_map(path)]
    logs = [path for path in files if path not in maps]
    if len(maps) > 1 or len(logs) > 1:
        raise ConfigError(
            f"one map and one log at a time, got {len(maps)} maps and {len(logs)} logs"
        )
    wanted = dict(topics(topic or []))
    on_topic = wanted.pop("map", None)
    if on_topic is not None and (maps or not logs):
        raise ConfigError("--topic map= is for a map in a bag: give the bag and no other map")
    if (wanted or mount is not None or robot is not None) and not logs:
        raise ConfigError("--topic, --mount and --robot are about a log: give one")
    grid = _map(maps, logs, on_topic)
    failures: list[McLocError] = []
    at = pose("--mount", mount)
    if at is not None:
        check_mount(at)
    info = _inspected(grid, logs, at, wanted, robot, failures)
    typer.echo(to_json(info) if json else told_info(info), nl=False)
    for failure in failures:
        raise failure


def _is_map(path: Path) -> bool:
    """Told by the name, and a wean.dat by its head."""
    from mcloc.errors import MapError
    from mcloc.io.bag_files import find_bag
    from mcloc.io.mrclam import is_mrclam
    from mcloc.maps.wean_map import START
    from mcloc.textfile import TextFile

    if path.suffix.lower() in _MAPS:
        return True
    if is_mrclam(path) or find_bag(path) is not None:
        return False
    try:
        return any(line.startswith(START) for line in TextFile(str(path), MapError).head())
    except MapError:
        return False  # what is wrong with it, the reader of logs says


def _map(maps: list[Path], logs: list[Path], topic: Any) -> "OccupancyGrid | None":
    from mcloc.io.bag_map import read_map
    from mcloc.maps.occupancy import OccupancyGrid

    if isinstance(topic, list):
        raise ConfigError(f"a map comes from one topic, got {', '.join(topic)}")
    if topic is not None:
        return read_map(logs[0], topic)
    return OccupancyGrid.load(maps[0]) if maps else None


def _inspected(
    grid: "OccupancyGrid | None",
    logs: list[Path],
    mount: Triple | None,
    wanted: "Topics",
    robot: int | None,
    failures: list[McLocError],
) -> dict[str, Any]:
    """What there is to say, as --json has it; to `failures` goes what breaks a log off."""
    from dataclasses import asdict

    from mcloc.cli.progress import counted
    from mcloc.inspection import LogInspection, describe_log, describe_map, inspect_fit, inspect_map
    from mcloc.io.log import read_log
    from mcloc.io.mrclam import Mrclam, is_mrclam

    info: dict[str, Any] = {"map": None, "log": None, "fit": None}
    findings = [] if grid is None else inspect_map(grid)
    if grid is not None:
        info["map"] = {"name": grid.name, **describe_map(grid)}
    with counted("events") as advance:
        if logs:
            log = LogInspection()
            source = read_log(logs[0], mount, wanted, robot)
            skipped = _read(log, logs[0], source, advance, failures)
            folder = Mrclam(str(logs[0]), robot) if is_mrclam(logs[0]) else None
            told = describe_log(log, () if folder is None else folder.landmarks.names)
            info["log"] = {"name": str(logs[0]), **told, "skipped": skipped}
            info["log"]["truth"] = None if folder is None else _truth(folder, told, failures)
            info["log"]["topics"] = _topics(logs[0])
            findings += log.findings()
        if logs and grid is not None:
            fit, found = inspect_fit(grid, log, findings)
            info["fit"] = asdict(fit)
            findings += found
    return {**info, "findings": [asdict(finding) for finding in findings]}


def _read(
    log: "LogInspection",
    path: Path,
    source: "Log",
    advance: Callable[[], None],
    failures: list[McLocError],
) -> dict[str, int]:
    """Read the log; how many of its messages were skipped, by reason. Raises where nothing could
    be read.
    """
    from mcloc.errors import LogError

    try:
        for _ in log.watch(source):
            advance()
    except LogError as cause:
        failures.append(cause)
    if not log.lasers and not log.odometry.count:
        raise failures[0] if failures else LogError(f"{path}: holds no events")
    return dict(source.skipped)


def _truth(
    folder: "Mrclam", log: dict[str, Any], failures: list[McLocError]
) -> dict[str, Any] | None:
    """The truth about the robot, if there is any, and the share of the log's time in which it is
    known but for gaps.
    """
    from mcloc.errors import TruthError
    from mcloc.inspection import describe_stream
    from mcloc.inspection.stamps import Stamps

    try:
        truth = folder.truth
    except TruthError as cause:
        failures.append(cause)
        return None
    if truth is None:
        return None
    stamps = Stamps()
    for t in truth.t.tolist():
        stamps.add(t)
    shared = min(stamps.last, log["end_s"]) - max(stamps.first, log["start_s"])
    share = max(shared, 0.0) / log["duration_s"] if log["duration_s"] else None
    return {**describe_stream(stamps), "share": share}


def _topics(path: Path) -> dict[str, str] | None:
    """The topics of a bag with their types; None for other logs."""
    from mcloc.io.bag import open_bag
    from mcloc.io.bag_files import find_bag
    from mcloc.io.mrclam import is_mrclam

    files = None if is_mrclam(path) else find_bag(path)
    if files is None:
        return None
    with open_bag(files) as bag:
        return dict(sorted(bag.topics.items()))
