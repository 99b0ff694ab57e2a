"""Poses from ranges: a density over free cells, drawn exactly, near p(z | x) / π(z)."""

import numpy as np
import pytest
from scipy.stats import chisquare, kstest

from mcloc.draws import Draws
from mcloc.environment import FreeSpace
from mcloc.errors import ConfigError
from mcloc.events import BeaconRanges
from mcloc.geometry import compose
from mcloc.maps.beacons import Beacons
from mcloc.maps.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from mcloc.samplers.beacon_circles import BeaconCircles, Squares
from mcloc.sensors.beacons import BeaconModel

BEACONS = Beacons(["a", "b"], np.array([[1.0, 1.0, 1.5], [3.0, 2.0, 1.5]]))


def cluttered():
    cells = np.random.default_rng(0).choice([FREE, FREE, FREE, OCCUPIED, UNKNOWN], (63, 81))
    return OccupancyGrid(cells.astype(np.int8), 0.05, np.array([-1.0, 0.5, 0.4]))


def open_floor():
    return OccupancyGrid(np.full((400, 400), FREE, np.int8), 0.05, np.array([-9.0, -9.0, 0.0]))


def sampler(grid, **settings):
    return BeaconCircles(BeaconModel(BEACONS, **settings), FreeSpace(grid))


def reading(*ranges, **more):
    return BeaconRanges(0.0, np.arange(len(ranges)), np.array(ranges), **more)


def centres(grid):
    """(3, cells): the middle of every free cell, heading 0."""
    row, column = np.nonzero(grid.free)
    local = np.stack([column + 0.5, row + 0.5, np.zeros(len(row))], axis=1)
    local[:, :2] *= grid.resolution
    return np.ascontiguousarray(compose(grid.origin, local).T)


ASIDE = np.array([0.3, 0.1, 0.5])
"""An antenna beside the robot's centre."""


@pytest.mark.parametrize("antenna", [np.zeros(3), ASIDE], ids=["middle", "aside"])
@pytest.mark.parametrize("ranges", [(1.5,), (1.8, 2.2), (np.nan,)])
def test_integrates_to_one(ranges, antenna):
    grid, x = cluttered(), centres(cluttered())
    q = sampler(grid).given(reading(*ranges, antenna=antenna), Draws(1))
    part = grid.resolution**2 * 2.0 * np.pi / 16
    total = 0.0
    for heading in np.linspace(-np.pi, np.pi, 16, endpoint=False) + 0.01:
        x[2] = heading
        total += np.exp(q.log_density(x)).sum() * part
    assert total == pytest.approx(1.0)


@pytest.mark.parametrize("antenna", [np.zeros(3), ASIDE], ids=["middle", "aside"])
@pytest.mark.parametrize("ranges", [(1.5,), (1.8, 2.2)])
def test_draws_what_its_density_says(ranges, antenna):
    """χ² over the squares of a floor with holes and sectors of headings."""
    grid, n = cluttered(), 100_000
    q = sampler(grid).given(reading(*ranges, antenna=antenna), Draws(1))
    x = q.sample(Draws(5), 0, n)
    assert np.isfinite(q.log_density(x)).all()
    row, column = grid.cell_of(x.T)
    assert grid.free[row, column].all()
    blocks = q.squares.of_block[row // q.squares.wide, column // q.squares.wide]
    sectors, squares = q.weights.shape
    sector = np.floor(x[2] / (2.0 * np.pi) * sectors + 0.5).astype(int) % sectors
    counts = np.bincount(sector * squares + blocks, minlength=q.weights.size)
    mass = n * q.weights.ravel()
    enough = mass >= 10.0
    found = np.append(counts[enough], counts[~enough].sum())
    assert chisquare(found, np.append(mass[enough], mass[~enough].sum())).pvalue > 1e-3
    within = (x[2] / (2.0 * np.pi) * sectors + 0.5) % 1.0
    assert kstest(within, "uniform").pvalue > 1e-3


def test_cells_of_a_square_are_drawn_alike():
    grid, n = cluttered(), 200_000
    q = sampler(grid).given(reading(1.5), Draws(1))
    x = q.sample(Draws(6), 0, n)
    row, column = grid.cell_of(x.T)
    cells = np.zeros(grid.cells.shape)
    np.add.at(cells, (row, column), 1)
    expected = n * np.exp(q.log_density(centres(grid))) * grid.resolution**2 * 2.0 * np.pi
    likely = expected >= 10.0
    found = cells[np.nonzero(grid.free)][likely]
    rest = n - found.sum(), n - expected[likely].sum()
    assert chisquare([*found, rest[0]], [*expected[likely], rest[1]]).pvalue > 1e-3


def test_distances_have_density_d_p():
    """On an open floor, by inversion: P(d) ∝ d p(r | d) in the plane, to the squares' width."""
    q = sampler(open_floor(), p_outlier=1e-6, p_late=0.0)
    model = q.sensor
    x = q.given(reading(4.0), Draws(1)).sample(Draws(2), 0, 20_000)
    planar = np.hypot(*(x[:2] - BEACONS.places[0, :2, None]))
    h = np.linspace(0.0, 8.0, 20_001)
    p = h * model.density(4.0, np.hypot(h, BEACONS.places[0, 2]))
    mass = np.cumsum(p) / p.sum()
    assert kstest(planar, lambda d: np.interp(d, h, mass)).statistic < 0.02


def test_is_near_the_likelihood_where_ranges_cross():
    """q̄ π ≈ p(z | x) within what log p differs by within a square and a sector: t falls by at most
    (ν + 1) / (2 √ν s) a metre, and late ranges begin with a jump of 0.04.
    """
    grid = open_floor()
    s, antenna = sampler(grid), np.array([0.2, 0.0, 0.3])
    z = reading(4.0, 3.0, antenna=antenna)
    q = s.given(z, Draws(1))
    x = centres(grid)[:, ::7]
    x[2] = np.random.default_rng(1).uniform(-np.pi, np.pi, x.shape[1])
    apart = q.log_density(x) + q.log_pi - s.sensor.log_likelihood(x, z)
    off = 0.2 * 2.0 * np.sin(np.pi / 16.0) + 0.05 * np.sqrt(2.0)
    assert np.abs(apart).max() <= 2.0 * (off * 5.0 / (4.0 * s.sensor.scale) + 0.04)


def test_pi_is_the_integral_of_the_likelihood():
    grid = cluttered()
    s = sampler(grid)
    z = reading(1.5, novelty=0.5)
    x = centres(grid)
    total = sum(
        np.exp(s.sensor.log_likelihood(np.stack([*x[:2], np.full(x.shape[1], a)]), z)).sum()
        for a in np.linspace(-np.pi, np.pi, 16, endpoint=False)
    )
    integral = total / 16 * 2.0 * np.pi * grid.resolution**2
    assert s.given(z, Draws(1)).log_pi == pytest.approx(np.log(integral), abs=0.02)


def test_does_not_depend_on_chunks():
    q = sampler(cluttered()).given(reading(1.8, 2.2), Draws(1))
    whole = q.sample(Draws(3), 0, 500)
    parts = [q.sample(Draws(3), 0, 7), q.sample(Draws(3), 7, 493)]
    assert np.array_equal(whole, np.concatenate(parts, axis=1))


def test_large_maps_have_wider_squares(monkeypatch):
    monkeypatch.setattr("mcloc.samplers.beacon_circles.MOST", 100)
    s = sampler(cluttered())
    assert len(s.squares.first) <= 100
    assert s.squares.number.sum() == cluttered().free.sum()
    assert Squares.of(cluttered(), 2).wide < s.squares.wide


def test_needs_free_cells():
    with pytest.raises(ConfigError, match="free-space"):
        BeaconCircles(BeaconModel(BEACONS), object())
