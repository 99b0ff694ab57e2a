"""Density trees to send."""

import numpy as np
import pytest

from mcloc.density_tree import DensityTree
from mcloc.particles import Particles
from mcloc.statespace import PLANE, SE2


def place(n=1000, seed=1):
    """Where a robot is that was seen from a pose known well."""
    rng = np.random.default_rng(seed)
    r, bearing = rng.normal(3.0, 0.6, n), rng.normal(0.4, 0.05, n)
    return DensityTree.fit(
        Particles.equal(np.stack([r * np.cos(bearing), r * np.sin(bearing)])), PLANE
    )


def ring(n=1000, seed=1):
    """Where a robot is that sees another one, whose place is known well."""
    rng = np.random.default_rng(seed)
    r, around = rng.normal(3.0, 0.6, n), rng.uniform(-np.pi, np.pi, n)
    heading = np.angle(np.exp(1j * (around + np.pi - rng.normal(0.4, 0.05, n))))
    x = np.stack([5.0 + r * np.cos(around), r * np.sin(around) - 2.0, heading])
    return DensityTree.fit(Particles.normalized(x, np.log(np.abs(r))), SE2)


@pytest.fixture(params=[place, ring], ids=["place", "ring"])
def tree(request):
    return request.param()
