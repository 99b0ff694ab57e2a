"""`mcloc eval`: how good a trajectory is."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mcloc.cli.values import topics
from mcloc.errors import ConfigError, TruthError

if TYPE_CHECKING:
    from mcloc.trajectory import Trajectory


def evaluate_files(
    estimate: Annotated[
        Path,
        typer.Argument(
            metavar="EST",
            help="The estimate: the folder of a run, its estimates.csv, or a trajectory in TUM.",
        ),
    ],
    reference: Annotated[
        Path,
        typer.Argument(
            metavar="REF",
            help="The true path in the map frame: CSV t,x,y,theta (s, m, m, rad), TUM, or an "
            "MRCLAM folder, with --robot; it is the log, too, if no other one is given.",
        ),
    ],
    log: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="The recorded log. Where the truth jumps and its odometry does not, the robot was "
            "kidnapped; how soon it recovers is then told.",
        ),
    ] = None,
    topic: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ROLE=TOPIC", help="Which topic of a bag is the odometry: odometry=/odom."
        ),
    ] = None,
    robot: Annotated[
        int | None,
        typer.Option(metavar="N", help="Which robot of an MRCLAM folder, as --log or REF."),
    ] = None,
    kidnapped: Annotated[
        list[float] | None,
        typer.Option(metavar="T", help="A kidnapping at this stamp (s); may be repeated."),
    ] = None,
    json: Annotated[
        bool, typer.Option("--json", help="Print the accuracy as JSON, and nothing else.")
    ] = False,
) -> None:
    """Compare an estimated path with the true one, in the map frame, without alignment.

      mcloc eval mcloc-out truth.csv --log drive.log.gz

      mcloc eval mcloc-out mrclam6 --robot 3

    Errors are taken at each stamp of REF within EST. Converged means: off by less than 0.5 m and
    10° from some moment on, to the end or to the next kidnapping. Where the log holds sightings of
    landmarks, the errors within 5 s of one are told, too.
    """
    import numpy as np

    from mcloc.cli.story import told_accuracy
    from mcloc.evaluation import evaluate
    from mcloc.events import Sightings
    from mcloc.io.log import read_odometry
    from mcloc.io.mrclam import is_mrclam
    from mcloc.io.tum import read_trajectory
    from mcloc.report.summary import to_json
    from mcloc.report.wheels import Wheels

    folder = is_mrclam(reference)
    if log is None and folder:
        log = reference
    if (topic or robot is not None) and log is None:
        raise ConfigError("--topic and --robot are about a log: give one with --log")
    path = estimate / "estimates.csv" if estimate.is_dir() else estimate
    wheels, sightings = Wheels(), list[float]()
    estimated = read_trajectory(path)
    truth = _recorded(reference, robot) if folder else read_trajectory(reference)
    if log is not None:
        for event in wheels.watch(read_odometry(log, topics(topic or []), robot)):
            if isinstance(event, Sightings) and event.useful:
                sightings.append(event.t)
    accuracy = evaluate(
        estimated,
        truth,
        odometry=wheels.trajectory,
        kidnappings=kidnapped or (),
        sightings=np.sort(sightings),
    ).to_dict()
    typer.echo(to_json(accuracy) if json else told_accuracy(accuracy), nl=False)


def _recorded(folder: Path, robot: int | None) -> "Trajectory":
    """The truth in an MRCLAM folder."""
    from mcloc.io.mrclam import Mrclam

    truth = Mrclam(str(folder), robot).truth
    if truth is None:
        raise TruthError(f"{folder}: has no truth about robot {robot}; give another REF")
    return truth
