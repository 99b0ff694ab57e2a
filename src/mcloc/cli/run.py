"""`mcloc run`: a map and a log in, a folder of results out."""

from pathlib import Path
from typing import Annotated, Any

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
from mcloc.cli.values import pose, seconds, settings, topics
from mcloc.errors import ConfigError

_Option = typer.Option


def run(
    map: Annotated[
        str | None,
        _Option(
            metavar="FILE",
            help="The map: a ROS map's .yaml, or a wean.dat; gzip or not. The map of a bag is "
            "asked for by --topic map=/map.",
        ),
    ] = None,
    log: Annotated[
        str | None,
        _Option(
            metavar="FILE",
            help="The recorded log: a ROS 1 or ROS 2 bag (file or folder), or CARMEN or Wean Hall, "
            "gzip or not; or an MRCLAM folder, with --robot.",
        ),
    ] = None,
    topic: Annotated[
        list[str] | None,
        _Option(
            metavar="ROLE=NAME",
            help="A topic of a bag, for the roles scan (may be repeated: all lasers work "
            "together), odometry, image (of the ceiling), map and truth, such as scan=/base_scan. "
            "Scans and odometry are found by type where this names none.",
        ),
    ] = None,
    initial: Initial = None,
    initial_sigma: InitialSigma = None,
    search: Annotated[
        bool,
        _Option(
            "--global",
            help="Search on the whole map, also where the --config file has a start pose.",
        ),
    ] = False,
    start: Start = None,
    end: End = None,
    truth: Truth = None,
    filter: Filter = None,
    motion: Motion = None,
    sensor: Sensor = None,
    size: Size = None,
    particles: Particles = None,
    recovery: Recovery = None,
    resampler: Annotated[
        str | None,
        _Option(
            metavar="NAME",
            help="systematic, stratified, residual, multinomial, or selective: only where the "
            "effective sample size is low.",
        ),
    ] = None,
    sampler: Annotated[
        str | None,
        _Option(
            metavar="NAME",
            help="How poses are found from a scan, for filters that look: feature-tree or "
            "grid-match.",
        ),
    ] = None,
    people: Annotated[
        str | None,
        _Option(
            metavar="NAME",
            help="What is done about people in the scans: none, distance or entropy.",
        ),
    ] = None,
    pace: Annotated[
        str | None,
        _Option(
            metavar="NAME",
            help="How fast the robot's computer is: offline waits for the filter; measured takes "
            "the time of this one times pace.slowdown; modelled takes pace.particle_beam for each "
            "particle and beam. Scans that come while the filter is busy are lost, and counted.",
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
    robot: Annotated[
        int | None,
        _Option(
            metavar="N",
            help="Which robot of an MRCLAM folder. It is localized by the landmarks that it sees; "
            "the folder has the map and the truth.",
        ),
    ] = None,
    beacons: Annotated[
        str | None,
        _Option(
            metavar="FILE",
            help="Where radio beacons are: CSV with a header beacon_id,x,y,z (m, map frame). Needs "
            "--beacon-ranges.",
        ),
    ] = None,
    beacon_ranges: Annotated[
        str | None,
        _Option(
            metavar="FILE",
            help="The ranges to them: CSV with a header scan_index,beacon_id,range_m (the n-th "
            "scan of the log, from 0) or t,beacon_id,range_m (s); antenna_x,antenna_y,antenna_z "
            "say where on the robot they were measured (m).",
        ),
    ] = None,
    ceiling: Annotated[
        str | None,
        _Option(
            metavar="FILE",
            help="A mosaic of the ceiling, for a camera that looks up at it: .yaml with image, "
            "resolution and origin, as ROS maps have it. Needs --images, or --topic image=NAME.",
        ),
    ] = None,
    images: Annotated[
        str | None,
        _Option(
            metavar="FOLDER",
            help="The images of the ceiling: with an index.csv with a header t,file (s), or each "
            "named by its stamp (s). camera.pixel says how much of the ceiling a pixel covers.",
        ),
    ] = None,
    camera: Annotated[
        str | None,
        _Option(
            metavar="NAME",
            help="The model of a ceiling camera: ceiling-patch (normalized correlation) or "
            "ceiling-brightness (right above the robot alone).",
        ),
    ] = None,
    scans: Annotated[
        bool | None,
        _Option(
            "--scans/--no-scans",
            help="Whether the scans of the log are used. Without them: odometry, and what "
            "--beacon-ranges or --images tell.",
            show_default=False,
        ),
    ] = None,
    derive_sonar: Annotated[
        int | None,
        _Option(
            metavar="N",
            help="Use what a ring of N sonars (7 to 24) would have measured in the place of each "
            "scan: the nearest return in each cone of sensor.cone, up to 5 m. For --sensor sonar.",
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
    config: Config = None,
    nav2_params: Annotated[
        Path | None,
        _Option(
            metavar="FILE",
            help="Take what can be taken from the parameters of amcl (nav2 or ROS 1) in a YAML "
            "file, and say what cannot; options given beside it win.",
        ),
    ] = None,
    seed: Seed = None,
    threads: Threads = None,
    out: Out = Path("mcloc-out"),
    plot: Plot = True,
    gif: Annotated[bool, _Option("--gif", help="Draw run.gif: the run as a short film.")] = False,
    record: Annotated[
        bool,
        _Option(
            "--record",
            help="Record map, poses, particles, scans and path as a ROS 2 bag (MCAP) in the folder "
            "recording, for Foxglove, Lichtblick or ROS 2.",
        ),
    ] = False,
    checkpoint_every: Annotated[
        str | None,
        _Option(
            metavar="TIME",
            help="Save the run so often, such as 60s or 5m, so that --resume can go on after a "
            "crash.",
        ),
    ] = None,
    resume: Annotated[
        bool,
        _Option(
            "--resume",
            help="Go on with the run that was saved in the folder of --out; the results are those "
            "of an uninterrupted run.",
        ),
    ] = False,
    json: Json = False,
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

    Localize robot 3 of an MRCLAM folder by landmarks:

    \b
      mcloc run --log mrclam6 --robot 3

    Add radio beacons, some of which may be bad:

    \b
      mcloc run --map floor.yaml --log drive.log.gz --beacons beacons.csv
        --beacon-ranges ranges.csv

    Localize by a camera that looks at the ceiling, and by nothing else:

    \b
      mcloc run --map floor.yaml --log drive.log.gz --no-scans
        --ceiling mosaic.yaml --images ceiling/ --set camera.pixel=0.05

    Use a bag with its own map, by both of its lasers, and survive a crash:

    \b
      mcloc run --log drive.mcap --topic map=/map --topic scan=/front
        --topic scan=/rear --checkpoint-every 60s --out result
      mcloc run --resume --out result

    The folder of --out gets trajectory.tum, estimates.csv, timing.csv, summary.json, config.yaml
    and run.png. If the log is cut in the middle, or the run is interrupted, they hold the results
    so far. Exit codes: 0 done, 1 stdout cannot be written, 2 the input was wrong, 130
    interrupted, 143 terminated; then, too, the results so far are written.
    """
    if search and initial is not None:
        raise ConfigError("--global and --initial exclude each other: give one of them")
    given: dict[str, Any] = {
        "map": map,
        "log": log,
        "topics": topics(topic or []) or None,
        "truth": truth,
        "initial": pose("--initial", initial),
        "initial_sigma": pose("--initial-sigma", initial_sigma),
        "start": start,
        "end": end,
        "mount": pose("--mount", mount),
        "robot": robot,
        "beacons": beacons,
        "beacon_ranges": beacon_ranges,
        "ceiling": ceiling,
        "images": images,
        "camera": camera,
        "scans": scans,
        "derive_sonar": derive_sonar,
        "seed": seed,
        "threads": threads,
        "filter": filter,
        "motion": motion,
        "sensor": sensor,
        "size": size,
        "recovery": recovery,
        "resampler": resampler,
        "sampler": sampler,
        "people": people,
        "pace": pace,
    }
    flags = {key: value for key, value in given.items() if value is not None}
    if search:
        flags["initial"] = None
    execute(
        Job(
            config,
            nav2_params,
            flags,
            particles,
            settings(assignments or []),
            out,
            plot,
            gif,
            record,
            json,
            None if checkpoint_every is None else seconds("--checkpoint-every", checkpoint_every),
            resume,
        )
    )
