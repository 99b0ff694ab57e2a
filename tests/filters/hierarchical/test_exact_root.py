"""The root of a hierarchy on 11 tiles against Bayes' rule by enumeration."""

from functools import cache

import numpy as np
import pytest
from tests.filters.hierarchical.worlds import (
    grey,
    hierarchy,
    histogram,
    rows,
    seen_from_afar,
    transition,
)

from mcloc.draws import Draws
from mcloc.filters.hierarchical.region import ROOT
from mcloc.filters.hierarchical.techniques import Techniques
from mcloc.sensors.grey_tile import GreyTile

TILES = 11
MOVES = (1, 1, -1, 0)
SEEN = (3, 6, 2, 4)
SENSOR = GreyTile((TILES,))
UNIFORM = np.full(TILES, 1.0 / TILES)


def likelihood(z, virtual):
    """Of a virtual sensor: that of the best tile, which falls by 10 powers of e over the row."""
    p = grey(z, TILES)
    if not virtual:
        return p
    apart = np.abs(np.arange(TILES)[:, None] - np.arange(TILES))
    return (p * np.exp(-10.0 / TILES * apart)).max(axis=1)


@cache
def exact(share, virtual):
    """Bel by enumeration: dynamics (1 − share) p_d + share U."""
    bel = UNIFORM
    for u, z in zip(MOVES, SEEN, strict=True):
        moved = (1.0 - share) * bel @ transition(u, TILES) + share * UNIFORM
        joint = moved * likelihood(z, virtual)
        bel = joint / joint.sum()
    return bel


def beliefs(n, share, virtual, repeats, levels=1):
    """(repeats, TILES): of the root after the last step."""
    chosen = Techniques(virtual=1 if virtual else 0, random=share)
    tiles = hierarchy(SENSOR, levels, n, techniques=chosen)
    found = np.empty((repeats, TILES))
    for seed in range(repeats):
        bel = tiles.start(tiles.environment, Draws(seed))
        for step, (u, z) in enumerate(zip(MOVES, SEEN, strict=True), 1):
            bel, _ = tiles.step(bel, np.array([u]), np.array([z]), Draws(seed, step))
        found[seed] = histogram(bel.nodes[ROOT].particles, TILES)
    return found


CASES = {"precise": (0.0, False), "random": (0.1, False), "virtual": (0.1, True)}


@pytest.mark.parametrize(("share", "virtual"), CASES.values(), ids=CASES)
def test_errors_of_the_root_fall_as_root_n(falls_as_root_n, share, virtual):
    sizes, results = (64, 512, 4096), []
    for n in sizes:
        errors = beliefs(n, share, virtual, 150) - exact(share, virtual)
        results.append(np.sum(errors**2, axis=1))
    falls_as_root_n(sizes, results)


def test_the_root_is_exact_with_many_particles_whatever_is_below():
    """Mean of 60 runs of 3000 particles within 4.5 of its standard errors, and 1/3000 of bias."""
    found = beliefs(3000, 0.1, False, 60, levels=4)
    error = found.std(axis=0, ddof=1) / np.sqrt(len(found))
    assert (error < 2e-3).all()
    assert (np.abs(found.mean(axis=0) - exact(0.1, False)) < 4.5 * error + 1 / 3000).all()
    assert np.array_equal(found[:5], beliefs(3000, 0.1, False, 5))


def test_what_is_seen_from_afar_is_as_written_here():
    virtual = seen_from_afar(SENSOR, rows(TILES).whole)
    x = np.arange(TILES)[None] * 1.0
    for z in range(TILES):
        found = np.exp(virtual.log_likelihood(x, np.array([z])))
        assert found == pytest.approx(likelihood(z, virtual=True))
