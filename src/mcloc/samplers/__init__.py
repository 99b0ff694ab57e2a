"""Pose samplers: densities like p(z | x) / π(z), from a measurement and a map."""

from mcloc.protocols import PoseSampler
from mcloc.registry import Registry
from mcloc.samplers.feature_tree import FeatureTree
from mcloc.samplers.grid_match import GridMatch

SAMPLERS: Registry[PoseSampler] = Registry(
    "sampler", {"feature-tree": FeatureTree, "grid-match": GridMatch}
)
