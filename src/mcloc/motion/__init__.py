"""Motion models p(x_t | u_t, x_{t−1})."""

from mcloc.motion.odometry import OdometryMotion
from mcloc.motion.omnidirectional import OmnidirectionalMotion
from mcloc.motion.velocity import VelocityMotion
from mcloc.protocols import MotionModel
from mcloc.registry import Registry

MOTIONS: Registry[MotionModel] = Registry(
    "motion",
    {
        "odometry": OdometryMotion,
        "omnidirectional": OmnidirectionalMotion,
        "velocity": VelocityMotion,
    },
)
