"""`mcloc simulate`: a world, and a robot that drives through it, as files to localize on."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mcloc.cli.simulated import LOGS, told, written
from mcloc.errors import ConfigError

if TYPE_CHECKING:
    from mcloc.maps.occupancy import OccupancyGrid
    from mcloc.simulation import Laser


def simulate_drive(
    world: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="office (the default), symmetric-office (the same after half a turn, so that "
            "there are two places for all that a robot sees) or museum (wide halls).",
        ),
    ] = None,
    map: Annotated[
        str | None,
        typer.Option(metavar="FILE", help="Drive on this map instead: .yaml of a ROS map, ..."),
    ] = None,
    seed: Annotated[
        int,
        typer.Option(
            metavar="S", min=0, help="Of world, route and noise: the same seed, the same."
        ),
    ] = 0,
    length: Annotated[float, typer.Option(metavar="M", help="Length of the drive (m).")] = 80.0,
    people: Annotated[
        int,
        typer.Option(
            metavar="N", help="People who walk about, half of them visitors around the robot."
        ),
    ] = 0,
    glass: Annotated[
        float, typer.Option(metavar="SHARE", help="Share of the walls that beams may pass, 0 … 1.")
    ] = 0.0,
    unmapped_glass: Annotated[
        bool, typer.Option("--unmapped-glass", help="Leave glass out of the map that is written.")
    ] = False,
    slip: Annotated[
        float,
        typer.Option(metavar="SHARE", help="Share of the way on which the wheels slip, 0 … 1."),
    ] = 0.0,
    missing: Annotated[
        float, typer.Option(metavar="SHARE", help="Share of the beams that do not return, 0 … 1.")
    ] = 0.02,
    kidnap: Annotated[
        int,
        typer.Option(
            metavar="N",
            min=0,
            help="Carry the robot elsewhere N times, while its odometry goes on as if nothing "
            "had happened.",
        ),
    ] = 0,
    kidnap_at: Annotated[
        list[float] | None,
        typer.Option(metavar="T", help="Do so at this time of the drive (s); may be repeated."),
    ] = None,
    lasers: Annotated[
        int,
        typer.Option(metavar="1|2", help="One laser that looks ahead, or front and rear."),
    ] = 1,
    range_max: Annotated[
        float, typer.Option(metavar="M", help="How far the lasers see (m).")
    ] = 10.0,
    beacons: Annotated[
        int | None,
        typer.Option(metavar="N", help="Hang N radio beacons on the walls, and measure ranges."),
    ] = None,
    ceiling: Annotated[
        bool,
        typer.Option("--ceiling", help="Make a ceiling, and images of a camera that looks at it."),
    ] = False,
    landmarks: Annotated[
        int | None,
        typer.Option(metavar="N", help="Put N landmarks on the walls, and say when they are seen."),
    ] = None,
    format: Annotated[
        str,
        typer.Option(metavar="NAME", help="Of the log: mcap (a ROS 2 bag) or carmen."),
    ] = "mcap",
    out: Annotated[
        Path,
        typer.Option(metavar="DIR", help="The folder for the files; those in it are replaced."),
    ] = Path("mcloc-sim"),
    json: Annotated[
        bool, typer.Option("--json", help="Print what was written as JSON, and nothing else.")
    ] = False,
) -> None:
    """Simulate a drive whose truth is known: a map, a log and the true path, to try mcloc on.

    A museum full of people, and a kidnapping after 90 s; then find the robot in it:

    \b
      mcloc simulate --world museum --people 20 --kidnap-at 90 --out drive
      mcloc run --map drive/map.yaml --log drive/log --truth drive/truth.csv

    How would your robot do on your own map, with slipping wheels and glass walls?

    \b
      mcloc simulate --map floor.yaml --slip 0.05 --glass 0.2 --out drive

    Localize it without a laser, by six radio beacons and a camera that looks at the ceiling, or by
    landmarks, with the commands that this prints:

    \b
      mcloc simulate --length 20 --beacons 6 --ceiling --landmarks 30 --out drive

    The folder of --out gets map.yaml with its image, the log (log/ or log.gz), and truth.csv with
    the true pose at each scan; with --beacons, beacons.csv and ranges.csv; with --ceiling,
    ceiling.yaml with its image, and images/; with --landmarks, the MRCLAM folder mrclam/. One seed
    gives the same files, byte by byte.
    """
    from rich.console import Console

    from mcloc.registry import suggest
    from mcloc.report import check_folder
    from mcloc.report.summary import to_json
    from mcloc.simulation import (
        Lookout,
        Radio,
        Scenario,
        Wheels,
        evenly,
        simulate,
        write_beacons_heard,
        write_ceiling_seen,
        write_drive,
        write_landmarks_seen,
    )

    if format not in LOGS:
        raise ConfigError(f"unknown --format {format!r}; {suggest(format, LOGS)}")
    if kidnap and kidnap_at:
        raise ConfigError("--kidnap and --kidnap-at exclude each other: give one of them")
    with _options():
        radio = None if beacons is None else Radio(beacons=beacons)
        lookout = None if landmarks is None else Lookout(landmarks=landmarks)
        scenario = Scenario(
            length=length,
            people=people,
            glass=glass,
            glass_mapped=not unmapped_glass,
            kidnap_at=tuple(kidnap_at) if kidnap_at else evenly(kidnap, length),
            wheels=Wheels(slip=slip),
            lasers=_lasers(lasers, missing, range_max),
        )
    grid = _grid(world, map, seed, out)
    check_folder(out)
    with Console(stderr=True).status(f"driving {length:g} m ..."):  # on a terminal only
        drive = simulate(grid, seed, scenario)
        write_drive(drive, out, format)
        aids = {} if radio is None else write_beacons_heard(drive, seed, out, radio)
        aids |= write_ceiling_seen(drive, seed, out) if ceiling else {}
        seen = None if lookout is None else write_landmarks_seen(drive, seed, out, lookout)
    done = written(drive, out, format, aids, seen)
    typer.echo(to_json(done) if json else told(done), nl=False)


@contextmanager
def _options() -> Iterator[None]:
    """Errors about parameters name them as the options that they come from."""
    from mcloc.registry import ParameterError

    try:
        yield
    except ParameterError as error:
        name, rest = error.fault.split(" ", 1)
        raise ConfigError(f"--{name.replace('_', '-')} {rest}") from None


def _lasers(n: int, missing: float, range_max: float) -> tuple["Laser", ...]:
    """One laser, or two that look half around each, back to back."""
    from math import pi

    from mcloc.simulation import Laser

    if n == 1:
        return (Laser(missing=missing, range_max=range_max),)
    if n == 2:
        mounts = {"front": (0.15, 0.05, 0.0), "rear": (-0.15, -0.05, pi)}
        return tuple(
            Laser(missing=missing, range_max=range_max, mount=mount, source=source)
            for source, mount in mounts.items()
        )
    raise ConfigError(f"--lasers is 1 or 2, got {n}")


def _grid(world: str | None, map: str | None, seed: int, out: Path) -> "OccupancyGrid":
    """The world that was asked for."""
    from mcloc.maps.occupancy import OccupancyGrid
    from mcloc.registry import suggest
    from mcloc.simulation import WORLDS

    if map is None:
        name = world or "office"
        if name not in WORLDS:
            raise ConfigError(f"unknown --world {name!r}; {suggest(name, WORLDS)}")
        return WORLDS[name](seed)
    if world is not None:
        raise ConfigError("--world and --map exclude each other: give one of them")
    beside = (os.path.realpath(Path(map).parent), os.path.dirname(os.path.realpath(map)))
    if os.path.realpath(out) in beside:
        raise ConfigError(f"--out {out}: {map} or its image would be replaced; give another folder")
    return OccupancyGrid.load(map)
