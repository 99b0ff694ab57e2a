"""The parameters of amcl: of the node of nav2 (ROS 2), and of its forebear in ROS 1.

Names, defaults and limits are those of the nodes [nav2_amcl; amcl of the ROS 1 navigation stack].
"""

import math
from dataclasses import dataclass, fields

from mcloc.registry import Configurable, param

_DIFFERENTIAL = "nav2_amcl::DifferentialMotionModel"
_LASERS = ("beam", "likelihood_field", "likelihood_field_prob")
_MOST = 1e9  # of any number: beyond it is a slip of the hand


@dataclass(frozen=True)
class Amcl(Configurable):
    """The parameters of amcl that say how it localizes, by nav2's names and with its defaults."""

    alpha1: float = param(0.2, "", "turning noise from turning, a variance", low=0, high=_MOST)
    alpha2: float = param(0.2, "", "turning noise from driving", low=0, high=_MOST)
    alpha3: float = param(0.2, "", "driving noise from driving", low=0, high=_MOST)
    alpha4: float = param(0.2, "", "driving noise from turning", low=0, high=_MOST)
    alpha5: float = param(0.2, "", "noise to the side from driving", low=0, high=_MOST)
    robot_model_type: str = param(_DIFFERENTIAL, "", "motion model")
    laser_model_type: str = param("likelihood_field", "", "sensor model", choices=_LASERS)
    max_beams: int = param(60, "", "beams used of a scan", low=2, high=_MOST)
    sigma_hit: float = param(0.2, "m", "deviation of a hit", above=0, high=_MOST)
    z_hit: float = param(0.5, "", "weight of hits", above=0, high=_MOST)
    z_rand: float = param(0.5, "", "weight of random readings", low=0, high=_MOST)
    z_short: float = param(0.05, "", "weight of short readings", low=0, high=_MOST)
    z_max: float = param(0.05, "", "weight of missing returns", low=0, high=_MOST)
    lambda_short: float = param(0.1, "1/m", "rate of short readings", above=0, high=_MOST)
    laser_likelihood_max_dist: float = param(2.0, "m", "far from walls", above=0, high=_MOST)
    laser_max_range: float = param(100.0, "m", "longest range used; -1: all", low=-1, high=_MOST)
    laser_min_range: float = param(-1.0, "m", "shortest range used; -1: all", low=-1, high=_MOST)
    do_beamskip: bool = param(False, "", "leave out beams that most particles doubt")
    min_particles: int = param(500, "", "fewest particles", low=1, high=1e7)
    max_particles: int = param(2000, "", "most particles", low=1, high=1e7)
    pf_err: float = param(0.05, "", "bound on the Kullback-Leibler distance", above=0, high=1)
    pf_z: float = param(0.99, "", "normal quantile of 1 - the chance to miss it", low=0, high=7)
    recovery_alpha_slow: float = param(0.0, "", "rate of the long average", low=0, high=1)
    recovery_alpha_fast: float = param(0.0, "", "rate of the short average", low=0, high=1)
    resample_interval: int = param(1, "", "updates from resampling to resampling", low=1)
    selective_resampling: bool = param(False, "", "resample only where the ESS is below N / 2")
    update_min_d: float = param(0.25, "m", "update after driving this far", low=0, high=_MOST)
    update_min_a: float = param(0.2, "rad", "update after turning this far", low=0, high=_MOST)
    set_initial_pose: bool = param(False, "", "start at initial_pose")
    initial_pose_x: float = param(0.0, "m", "start pose", low=-_MOST, high=_MOST)
    initial_pose_y: float = param(0.0, "m", "start pose", low=-_MOST, high=_MOST)
    initial_pose_z: float = param(0.0, "m", "start pose", low=-_MOST, high=_MOST)
    initial_pose_yaw: float = param(0.0, "rad", "start pose", low=-_MOST, high=_MOST)
    initial_cov_xx: float = param(0.25, "m²", "variance of the start", above=0, high=_MOST)
    initial_cov_yy: float = param(0.25, "m²", "variance of the start", above=0, high=_MOST)
    initial_cov_aa: float = param(
        (math.pi / 12.0) ** 2, "rad²", "variance of the start", above=0, high=_MOST
    )
    random_seed: int = param(-1, "", "of the random numbers; negative: a fresh one")
    freespace_downsampling: bool = param(False, "", "random poses on every other cell only")


ROS1_DEFAULTS = Amcl(
    robot_model_type="diff",
    max_beams=30,
    z_hit=0.95,
    z_rand=0.05,
    z_short=0.1,
    laser_max_range=-1.0,
    min_particles=100,
    max_particles=5000,
    pf_err=0.01,
    recovery_alpha_slow=0.001,
    recovery_alpha_fast=0.1,
    resample_interval=2,
    update_min_d=0.2,
    update_min_a=math.pi / 6.0,
)

_KNOWN = frozenset(f.name for f in fields(Amcl))
_ROS1_ALONE = {"selective_resampling", "initial_cov_xx", "initial_cov_yy", "initial_cov_aa"}
_ROS2_ALONE = {"set_initial_pose", "random_seed", "freespace_downsampling", "initial_pose_z"}
_IN_ROS1 = {
    **{f"alpha{i}": f"odom_alpha{i}" for i in range(1, 6)},
    **{name: f"laser_{name}" for name in ("max_beams", "sigma_hit", "lambda_short")},
    **{name: f"laser_{name}" for name in ("z_hit", "z_rand", "z_short", "z_max")},
    "robot_model_type": "odom_model_type",
    "pf_err": "kld_err",
    "pf_z": "kld_z",
    "initial_pose_yaw": "initial_pose_a",
}
ROS1_NAMES = {_IN_ROS1.get(name, name): name for name in _KNOWN - _ROS2_ALONE}
ROS2_NAMES = {name.replace("pose_", "pose."): name for name in _KNOWN - _ROS1_ALONE}

OF_THE_NODE = {
    *("base_frame_id", "global_frame_id", "odom_frame_id", "scan_topic", "map_topic"),
    *("first_map_only", "always_reset_initial_pose", "save_pose_rate", "tf_broadcast"),
    *("transform_tolerance", "use_sim_time", "use_map_topic", "gui_publish_rate"),
    *("restore_defaults", "bag_scan_period", "introspection_mode", "service_introspection_mode"),
    *("bond_heartbeat_period", "allow_parameter_qos_overrides"),
}
"""Parameters about a ROS node at work, not about how it localizes."""

OPTIONAL = {
    *("set_initial_pose", "initial_pose_x", "initial_pose_y", "initial_pose_z", "initial_pose_yaw"),
    *("initial_cov_xx", "initial_cov_yy", "initial_cov_aa", "random_seed", "do_beamskip"),
    *("selective_resampling", "freespace_downsampling", "laser_min_range"),
}
"""Parameters that a file need not have: they ask for something that does not go without saying."""

OF_BEAM_SKIPPING = {"beam_skip_distance", "beam_skip_threshold", "beam_skip_error_threshold"}
