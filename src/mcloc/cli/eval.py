"""`mcloc eval`: how good a trajectory is."""

from pathlib import Path
from typing import Annotated

import typer

from mcloc.cli.values import topics
from mcloc.errors import ConfigError


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
            help="The true path in the map frame: CSV t,x,y,theta (s, m, m, rad), or TUM.",
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
        int | None, typer.Option(metavar="N", help="Which robot of an MRCLAM folder, as --log.")
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

    Errors are taken at each stamp of REF within EST. Converged means: off by less than 0.5 m and
    10° from some moment on, to the end or to the next kidnapping.
    """
    from mcloc.cli.story import told_accuracy
    from mcloc.evaluation import evaluate
    from mcloc.io.log import read_odometry
    from mcloc.io.tum import read_trajectory
    from mcloc.report.summary import to_json
    from mcloc.report.wheels import Wheels

    if (topic or robot is not None) and log is None:
        raise ConfigError("--topic and --robot are about a log: give one with --log")
    path = estimate / "estimates.csv" if estimate.is_dir() else estimate
    wheels = Wheels()
    estimated, truth = read_trajectory(path), read_trajectory(reference)
    if log is not None:
        for _ in wheels.watch(read_odometry(log, topics(topic or []), robot)):
            pass
    accuracy = evaluate(
        estimated, truth, odometry=wheels.trajectory, kidnappings=kidnapped or ()
    ).to_dict()
    typer.echo(to_json(accuracy) if json else told_accuracy(accuracy), nl=False)
