"""The nearest sensor model to that of an amcl: the same width, and for one reading the same ratios
between a place that explains it and one that does not  [nav2_amcl: likelihood_field_model.cpp,
likelihood_field_model_prob.cpp, beam_model.cpp].

likelihood field   z = (z_hit e^(−D²/2σ²) + z_rand/R) / (z_hit + z_rand/R): its floor over its peak,
                   D = laser_likelihood_max_dist, R = laser_max_range
beams              z_hit, z_max ← σ √(2π) z_hit, σ √(2π) z_max: amcl's hit is 1 at its peak, not
                   a density
"""

import math
from typing import Any

from mcloc.config.amcl import Amcl
from mcloc.config.amcl_file import AmclFile, Notes, Part

RANGE = 30.0  # m, of a laser of which nothing is known


def sensor(file: AmclFile, notes: Notes) -> Part:
    """The sensor model's name and settings; what they cannot say goes to the notes."""
    p = file.values
    if p.do_beamskip:
        notes.append("do_beamskip: beams that the map does not explain are kept here")
    for name in ("laser_max_range", "laser_min_range"):
        if name in file.given and 0.0 < getattr(p, name) < Amcl.laser_max_range:
            notes.append(f"{name}: not applied; the log says what is a return")
    each = "counts in full" if p.laser_model_type.endswith("prob") else "adds its p, cubed"
    notes.append(
        f"laser_model_type: in amcl each beam {each}; here their p multiply, all of a scan for"
        " sensor.effective_beams beams and the less, the shorter the move (update.decorrelation)"
    )
    if p.laser_model_type == "beam":
        return "beam-four-part", _beams(file, notes)
    return "likelihood-field", _likelihood_field(file, notes)


def _likelihood_field(file: AmclFile, notes: Notes) -> dict[str, Any]:
    """The same width, and the same ratio of the field's floor to its peak."""
    p = file.values
    far = p.z_hit * math.exp(-0.5 * (p.laser_likelihood_max_dist / p.sigma_hit) ** 2)

    def relative(reach: float) -> float:
        return (far + p.z_rand / reach) / (p.z_hit + p.z_rand / reach)

    reach = p.laser_max_range if p.laser_max_range > 0.0 else RANGE
    z = relative(reach)
    notes.append(
        f"{file.written('z_rand')}: as sensor.z_rand = {z:.3g}, relative to a perfect reading of a"
        f" laser that reaches {reach:g} m; one of 10 m would have {relative(10.0):.3g}"
    )
    return {"sigma_hit": p.sigma_hit, "z_rand": z, "z_unknown": z, "max_beams": p.max_beams}


def _beams(file: AmclFile, notes: Notes) -> dict[str, Any]:
    """amcl's hit is 1 at its peak where the book has a density; readings of either kind, returns
    and none, keep their ratios if z_hit and z_max are multiplied by σ √(2π).
    """
    p = file.values
    peak = p.sigma_hit * math.sqrt(2.0 * math.pi)
    weights = {
        "z_hit": p.z_hit * peak,
        "z_short": p.z_short,
        "z_max": p.z_max * peak,
        "z_rand": p.z_rand,
    }
    total = sum(weights.values())
    names = ", ".join(file.written(name) for name in weights)
    notes.append(f"{names}: as weights of densities, which amcl's hits are not")
    return {
        "sigma_hit": p.sigma_hit,
        "lambda_short": p.lambda_short,
        "max_beams": p.max_beams,
        **{name: weight / total for name, weight in weights.items()},
    }
