"""The nearest run to the parameters of an amcl, and what could not be taken over.

α = √α_amcl, deviations for variances; δ = 1 − Φ(pf_z), for which amcl wants the quantile.
"""

import difflib
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from scipy.special import ndtr

from mcloc.config.amcl import OF_BEAM_SKIPPING, OF_THE_NODE, OPTIONAL
from mcloc.config.amcl_file import AmclFile, Notes, Part, read_amcl
from mcloc.config.amcl_sensor import sensor
from mcloc.filters.catalog import REGISTRIES
from mcloc.localizer import UpdatePolicy
from mcloc.registry import parameters
from mcloc.sensors.beams import ScanModel

BIN_LENGTH, BIN_ANGLE = 0.5, math.radians(10.0)  # m, rad: amcl's bins, which no parameter changes


def read_nav2(path: str | Path) -> tuple[dict[str, Any], Notes]:
    """Arguments of RunConfig for a parameter file of amcl, of nav2 or of ROS 1; and for each thing
    that is not taken over, or only nearly, a line that says why and what is used instead.

    Raises ConfigError, with the file and the name, for a file without amcl and for values that
    cannot be right.
    """
    file = read_amcl(path)
    notes: Notes = []
    entries = _start(file, notes)
    settings: dict[str, dict[str, Any]] = {}
    for part, translate in _PARTS.items():
        name, values = translate(file, notes)
        if part == "update":
            kind: type[Any] = UpdatePolicy
        else:
            entries[part] = name
            kind = REGISTRIES[part].get(name)
        settings[part] = _within_limits(kind, part, values, notes)
    notes += _left_out(file)
    return {**entries, "settings": settings}, notes


def _start(file: AmclFile, notes: Notes) -> dict[str, Any]:
    """Where to start, and the seed."""
    p = file.values
    entries: dict[str, Any] = {}
    given = bool(file.given & {"initial_pose_x", "initial_pose_y", "initial_pose_yaw"})
    if given if file.ros1 else p.set_initial_pose:
        entries["initial"] = (p.initial_pose_x, p.initial_pose_y, p.initial_pose_yaw)
        variances = (p.initial_cov_xx, p.initial_cov_yy, p.initial_cov_aa)
        entries["initial_sigma"] = tuple(math.sqrt(v) for v in variances)
        if not file.ros1:
            notes.append(
                "initial_pose: nav2 takes it for exact; here it is believed to 0.5 m and 15°"
                " (--initial-sigma)"
            )
    elif file.ros1:
        notes.append("initial_pose_x: not in the file; amcl starts at 0, here the map is searched")
    else:
        notes.append(
            "set_initial_pose: false; amcl waits to be told where the robot is, here the whole map"
            " is searched: give --initial to say it"
        )
    if p.freespace_downsampling:
        notes.append("freespace_downsampling: random poses come from all free cells here")
    if p.random_seed >= 0:
        entries["seed"] = p.random_seed
    return entries


def _motion(file: AmclFile, notes: Notes) -> Part:
    """Variances as deviations. The uncorrected models of ROS 1 forget the root: their deviation is
    α m² for a move m, which is as large as here for the moves from update to update.
    """
    p = file.values
    model = p.robot_model_type
    variances = [p.alpha1, p.alpha2, p.alpha3, p.alpha4, p.alpha5]
    holonomic = "omni" in model.lower()
    if file.ros1 and model == "omni":
        # It also mistakes alpha1 and alpha4 for each other.
        variances[0], variances[3] = variances[3], variances[0]
    if file.ros1 and model in ("diff", "omni"):
        turn, drive = p.update_min_a, p.update_min_d
        alphas = [a * m for a, m in zip(variances, (turn, drive, drive, turn, drive), strict=True)]
        notes.append(
            f"{file.written('robot_model_type')}: '{model}' forgets a square root; the noise is the"
            f" same here for moves of {drive:g} m and {turn:g} rad, relatively smaller beyond"
        )
    else:
        alphas = [math.sqrt(a) for a in variances]
    if not holonomic and "diff" not in model.lower():
        notes.append(f"robot_model_type: '{model}' is not known here; odometry is used")
    used = alphas if holonomic else alphas[:4]
    settings = {f"alpha{i}": alpha for i, alpha in enumerate(used, start=1)}
    if not holonomic:
        notes.append(
            f"{file.written('alpha4')}: the two turns of a move add up here, in amcl their squares"
            " do; the driving noise of a curve is up to 1.4 times amcl's"
        )
    return ("omnidirectional" if holonomic else "odometry"), settings


def _size(file: AmclFile, notes: Notes) -> Part:
    p = file.values
    if p.min_particles > p.max_particles:
        notes.append(f"max_particles: below min_particles; {p.min_particles} as in amcl")
    return "kld", {
        "epsilon": p.pf_err,
        "delta": float(ndtr(-p.pf_z)),
        "bin_length": BIN_LENGTH,
        "bin_angle": BIN_ANGLE,
        "minimum": p.min_particles,
        "maximum": max(p.min_particles, p.max_particles),
    }


def _resampler(file: AmclFile, notes: Notes) -> Part:
    p = file.values
    if p.resample_interval > 1:
        notes.append(
            f"resample_interval: {p.resample_interval} is not known here; resampled at each update,"
            " or where the weights ask for it with --resampler selective"
        )
    return ("selective", {"ess_below": 0.5}) if p.selective_resampling else ("systematic", {})


def _recovery(file: AmclFile, notes: Notes) -> Part:
    """w_fast / w_slow; in amcl a rate of 0 leaves an average at its first value."""
    p = file.values
    slow, fast = p.recovery_alpha_slow, p.recovery_alpha_fast
    if slow > 0.0 and fast > 0.0:
        notes.append(
            "recovery_alpha_slow, recovery_alpha_fast: the averages are of one beam's likelihood"
            " here, of the scan's weight in amcl: random particles come more cautiously; the rates"
            f" are per reading here, the same for an update after {p.update_min_d:g} m"
        )
        moved = np.array([p.update_min_d, 0.0, 0.0])
        readings = ScanModel.effective_beams * UpdatePolicy().novelty(moved)
        rates = {"rate_slow": slow, "rate_fast": fast}
        per_reading = {name: 1.0 - (1.0 - rate) ** (1.0 / readings) for name, rate in rates.items()}
        return "augmented", {**per_reading, "below": 1.0}
    if slow > 0.0 or fast > 0.0:
        notes.append("recovery_alpha_slow, recovery_alpha_fast: only one is > 0; no recovery")
    return "none", {}


def _update(file: AmclFile, notes: Notes) -> Part:
    p = file.values
    notes.append(
        "update_min_d: amcl looks at x and y apart and waits up to 1.4 times as far in between"
    )
    return "update", {"distance": p.update_min_d, "angle": p.update_min_a}


_PARTS: Mapping[str, Callable[[AmclFile, Notes], Part]] = {
    "motion": _motion,
    "sensor": sensor,
    "size": _size,
    "resampler": _resampler,
    "recovery": _recovery,
    "update": _update,
}


def _within_limits(
    kind: type[Any], part: str, values: Mapping[str, Any], notes: Notes
) -> dict[str, Any]:
    """The values, those that mcloc cannot express moved to the nearest that it can."""
    limits = {f.name: f.metadata for f in parameters(kind)}
    near = {}
    for name, value in values.items():
        of = limits[name]
        near[name] = min(max(value, of["low"], math.nextafter(of["above"], math.inf)), of["high"])
        if near[name] != value:
            notes.append(f"{part}.{name}: {value:g} is out of range here; {near[name]:g} is used")
    return near


def _left_out(file: AmclFile) -> Notes:
    """What of the file has no place in a run, and what a run takes from elsewhere."""
    notes = []
    node = sorted(OF_THE_NODE & file.others.keys())
    if node:
        notes.append(
            f"{', '.join(node)}: about a ROS node at work; a log has its own topics and frames"
        )
    for name in sorted(file.others.keys() - OF_THE_NODE - OF_BEAM_SKIPPING):
        near = difflib.get_close_matches(name, file.names, n=1)
        hint = f"; did you mean {near[0]!r}?" if near else ""
        notes.append(f"{name}: no parameter of this amcl, not used{hint}")
    absent = [name for name in file.names if file.names[name] not in file.given | OPTIONAL]
    if absent:
        notes.append(f"not in the file, so as amcl has them: {', '.join(sorted(absent))}")
    notes.append(
        "doubt in the wheels (recovery.doubt_below) and where a robot stands (environment): amcl"
        " knows neither, mcloc's own are used"
    )
    return notes
