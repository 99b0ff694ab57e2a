"""The studies by number."""

from collections.abc import Mapping

from mcloc.errors import ConfigError
from mcloc.experiments import (
    e01_motion_density,
    e02_scan_likelihood,
    e03_global_localization,
    e04_grid_resolution,
    e05_sample_size,
    e06_grid_cost,
    e07_ceiling_camera,
    e08_sensor_noise,
    e09_mixture_proposal,
    e10_few_samples,
    e11_kidnapped_museum,
    e12_ceiling_kidnapped,
    e13_two_robots,
    e14_adaptive_sizes,
    e15_reinitialisation,
    e16_kidnapped,
    e17_grid_spacing,
    e18_one_iteration,
    e19_global_localization_on_tiles,
    e20_kidnapped_on_tiles,
    e21_ablation,
    e22_team_size,
    e23_too_sure,
)
from mcloc.experiments.study import Study
from mcloc.registry import suggest

STUDIES: Mapping[str, Study] = {
    study.number: study
    for study in (
        e01_motion_density.STUDY,
        e02_scan_likelihood.STUDY,
        e03_global_localization.STUDY,
        e04_grid_resolution.STUDY,
        e05_sample_size.STUDY,
        e06_grid_cost.STUDY,
        e07_ceiling_camera.STUDY,
        e08_sensor_noise.STUDY,
        e09_mixture_proposal.STUDY,
        e10_few_samples.STUDY,
        e11_kidnapped_museum.STUDY,
        e12_ceiling_kidnapped.STUDY,
        e13_two_robots.STUDY,
        e14_adaptive_sizes.STUDY,
        e15_reinitialisation.STUDY,
        e16_kidnapped.STUDY,
        e17_grid_spacing.STUDY,
        e18_one_iteration.STUDY,
        e19_global_localization_on_tiles.STUDY,
        e20_kidnapped_on_tiles.STUDY,
        e21_ablation.STUDY,
        e22_team_size.STUDY,
        e23_too_sure.STUDY,
    )
}


def study_named(number: str) -> Study:
    """The study E5 by "E5", "e5", "e05" or "5". Raises ConfigError for one that is unknown."""
    digits = number.strip().lower().removeprefix("e").lstrip("0")
    if f"E{digits}" not in STUDIES:
        raise ConfigError(f"unknown study {number!r}; {suggest(number.upper(), STUDIES)}")
    return STUDIES[f"E{digits}"]
