"""Errors against `evo`, which many in the field use, on random trajectories."""

import numpy as np
import pytest
from evo.core.metrics import APE, PoseRelation
from evo.core.trajectory import PoseTrajectory3D

from mcloc.evaluation import evaluate
from mcloc.geometry import wrap
from mcloc.trajectory import Trajectory


def random_pair(seed: int) -> tuple[Trajectory, Trajectory]:
    """A reference and an estimate of it with errors of every size, at the same stamps."""
    rng = np.random.default_rng(seed)
    t = np.cumsum(rng.uniform(0.05, 8.0, 200))
    reference = np.cumsum(rng.normal(0.0, [1.0, 1.0, 0.5], (200, 3)), axis=0)
    estimate = reference + rng.standard_cauchy((200, 3)) * [0.1, 0.1, 0.05]
    reference[:, 2], estimate[:, 2] = wrap(reference[:, 2]), wrap(estimate[:, 2])
    return Trajectory(t, estimate), Trajectory(t, reference)


def evo_statistics(
    estimate: Trajectory, reference: Trajectory, relation: PoseRelation
) -> dict[str, float]:
    def in_space(trajectory: Trajectory) -> PoseTrajectory3D:
        x, y, theta = trajectory.poses.T
        zero = np.zeros_like(x)
        return PoseTrajectory3D(
            positions_xyz=np.column_stack([x, y, zero]),
            orientations_quat_wxyz=np.column_stack(
                [np.cos(theta / 2.0), zero, zero, np.sin(theta / 2.0)]
            ),
            timestamps=trajectory.t,
        )

    metric = APE(relation)
    metric.process_data((in_space(reference), in_space(estimate)))
    return metric.get_all_statistics() | {"p95": float(np.percentile(metric.error, 95.0))}


@pytest.mark.parametrize("seed", range(5))
def test_position_and_heading_errors_are_those_of_evo(seed: int) -> None:
    estimate, reference = random_pair(seed)
    accuracy = evaluate(estimate, reference)

    position = evo_statistics(estimate, reference, PoseRelation.translation_part)
    assert accuracy.position_median_m == pytest.approx(position["median"], rel=1e-9)
    assert accuracy.position_rmse_m == pytest.approx(position["rmse"], rel=1e-9)
    assert accuracy.position_p95_m == pytest.approx(position["p95"], rel=1e-9)
    assert accuracy.position_max_m == pytest.approx(position["max"], rel=1e-9)

    # evo takes the angle from a rotation matrix, which loses digits where it is small.
    heading = evo_statistics(estimate, reference, PoseRelation.rotation_angle_deg)
    assert accuracy.heading_median_deg == pytest.approx(heading["median"], abs=1e-5)
    assert accuracy.heading_rmse_deg == pytest.approx(heading["rmse"], abs=1e-5)
    assert accuracy.heading_p95_deg == pytest.approx(heading["p95"], abs=1e-5)
