"""The options that several commands have, each with its help in one place."""

from pathlib import Path
from typing import Annotated

import typer

_Option = typer.Option

Initial = Annotated[
    str | None,
    _Option(
        metavar="X,Y,THETA_DEG",
        help="Where the robot starts, in the map frame (m, m, degrees), such as 12.5,-3,90. "
        "Without it the robot is searched for on the whole map.",
    ),
]
InitialSigma = Annotated[
    str | None,
    _Option(
        metavar="SX,SY,STHETA_DEG",
        help="Standard deviations of --initial (m, m, degrees), such as 0.5,0.5,15.",
    ),
]
Start = Annotated[float | None, _Option(metavar="T", help="Begin at this stamp of the log (s).")]
End = Annotated[float | None, _Option(metavar="T", help="End at this stamp of the log (s).")]
Truth = Annotated[
    str | None,
    _Option(
        metavar="FILE",
        help="The true path in the map frame, to tell the accuracy by: CSV with a header "
        "t,x,y,theta (s, m, m, rad), or TUM.",
    ),
]
Filter = Annotated[
    str | None,
    _Option(
        metavar="NAME",
        help="mixture (default), mcl, markov-grid, octree, grid-proposal, kalman, topological "
        "and others; `mcloc models` lists all names.",
    ),
]
Motion = Annotated[str | None, _Option(metavar="NAME", help="The motion model.")]
Sensor = Annotated[str | None, _Option(metavar="NAME", help="The sensor model.")]
Size = Annotated[
    str | None,
    _Option(
        metavar="NAME",
        help="How many particles: kld (as many as the spread of the belief needs), fixed, "
        "likelihood-sum or time-budget.",
    ),
]
Particles = Annotated[
    int | None, _Option(metavar="N", help="With --size fixed: how many. Else: at most this many.")
]
Recovery = Annotated[
    str | None, _Option(metavar="NAME", help="From kidnapping: none, random or augmented.")
]
Config = Annotated[
    Path | None,
    _Option(
        metavar="FILE",
        help="Take everything from a YAML file, such as the config.yaml of an earlier run; "
        "options given beside it win.",
    ),
]
Seed = Annotated[
    int | None,
    _Option(metavar="S", help="Of the random numbers: the same seed, the same estimates."),
]
Threads = Annotated[
    int | None,
    _Option(metavar="T", help="Threads; without it one a core. No result depends on it."),
]
Out = Annotated[
    Path, _Option(metavar="DIR", help="The folder for the results; its files are replaced.")
]
Plot = Annotated[bool, _Option("--plot/--no-plot", help="Draw run.png.")]
Json = Annotated[bool, _Option("--json", help="Print summary.json to stdout, and nothing else.")]
