"""Pose samplers: densities like p(z | x) / π(z), from a measurement and a map."""

from mcloc.protocols import PoseSampler
from mcloc.registry import Registry
from mcloc.samplers.feature_tree import FeatureTree

SAMPLERS: Registry[PoseSampler] = Registry("sampler", {"feature-tree": FeatureTree})
