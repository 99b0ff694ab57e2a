"""Pose samplers: densities like p(z | x) / π(z), from a measurement and a map."""
