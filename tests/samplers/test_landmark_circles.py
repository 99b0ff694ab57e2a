"""Poses from sightings of landmarks: a density that integrates to 1, a sampler that agrees with it,
and, of one sighting, p(z | x) / π(z) itself.
"""

import math

import numpy as np
import pytest
from scipy.stats import chisquare, kstest

from mcloc.draws import Draws
from mcloc.environment import FreeSpace
from mcloc.events import UNKNOWN, Sightings
from mcloc.geometry import compose
from mcloc.maps.landmarks import Landmarks, open_floor
from mcloc.samplers.landmark_circles import LandmarkCircles
from mcloc.sensors.landmarks import LandmarkModel

NAN = math.nan
PLACES = np.array([[0.0, 0.0], [2.0, 0.5], [1.0, 2.5]])
MARKS = Landmarks.numbered(PLACES)
FLOOR = FreeSpace(open_floor(PLACES, 8.0, "floor"))
WIDE = LandmarkModel(
    MARKS, sigma_range=0.3, sigma_relative=0.1, sigma_bearing=0.3, range_max=3.0, p_outlier=0.1
)
SHARP = LandmarkModel(MARKS, sigma_range=0.02, sigma_relative=0.0, sigma_bearing=0.01)
MOUNT = np.array([0.4, -0.3, 1.2])
LOOKS = {
    "range and bearing": Sightings(0.0, [0], [1.5], [0.4]),
    "from a mount": Sightings(0.0, [0], [1.5], [0.4], mount=MOUNT),
    "range": Sightings(0.0, [1], [2.0], [NAN]),
    "bearing": Sightings(0.0, [1], [NAN], [-2.5]),
    "too far": Sightings(0.0, [1], [30.0], [-2.5]),
    "unknown": Sightings(0.0, [UNKNOWN], [1.0], [1.0]),
    "several": Sightings(0.0, [2, 0, UNKNOWN, 1], [1.0, 2.5, NAN, NAN], [1.0, NAN, 0.3, NAN]),
    "nothing": Sightings(0.0, [0], [NAN], [NAN]),
}
every_look = pytest.mark.parametrize("z", LOOKS.values(), ids=LOOKS)
N = 20_000


def given(sensor, z, floor=0.1):
    return LandmarkCircles(sensor, FLOOR, floor).given(z, Draws(0))


def lattice(n, headings):
    """(3, n): midpoints of cells over the floor and the circle, and the volume of one."""
    x0, y0, _ = FLOOR.grid.origin
    height, width = np.array(FLOOR.grid.cells.shape) * FLOOR.grid.resolution
    axes = [
        low + side * (np.arange(k) + 0.5) / k
        for low, side, k in ((x0, width, n), (y0, height, n), (-np.pi, 2.0 * np.pi, headings))
    ]
    x = np.stack([v.ravel() for v in np.meshgrid(*axes, indexing="ij")])
    return x, width * height * 2.0 * np.pi / (n * n * headings)


@every_look
def test_it_integrates_to_1(z):
    x, volume = lattice(160, 48)
    assert np.exp(given(WIDE, z).log_density(x)).sum() * volume == pytest.approx(1.0, abs=2e-3)


@pytest.mark.parametrize("name", ["range and bearing", "from a mount", "range", "bearing"])
def test_of_one_sighting_it_is_p_over_pi(name):
    """Where a landmark can be seen from, and but for the share from anywhere."""
    z, (x, _) = LOOKS[name], lattice(60, 24)
    at = compose(x.T, z.mount).T
    x = x[:, np.hypot(*(PLACES[z.landmark[0]][:, None] - at[:2])) < WIDE.range_max]
    floor = 0.1 * np.exp(FLOOR.log_density(x))
    apart = np.log(np.exp(given(WIDE, z).log_density(x)) - floor) - WIDE.log_likelihood(x, z)
    assert np.ptp(apart) < 2e-3  # straight lines between knots


@every_look
@pytest.mark.parametrize("sensor", [WIDE, SHARP], ids=["wide", "sharp"])
def test_samples_have_this_density(sensor, z):
    """The share of samples in each cell of x, y and θ is the integral of the density over it, by
    importance sampling from the same with more from anywhere.
    """
    q, wide = given(sensor, z), given(sensor, z, 0.5)
    x, y = q.sample(Draws(5, 1), 0, N), wide.sample(Draws(9, 2), 0, 10 * N)
    assert np.isfinite(q.log_density(x)).all()
    assert (np.abs(x[2]) <= np.pi).all()
    w = np.exp(q.log_density(y) - wide.log_density(y))
    assert w.max() <= 2.0
    edges = [np.quantile(x[k], np.linspace(0.0, 1.0, 8)[1:-1]) for k in range(3)]

    def cell(v):
        at = [np.searchsorted(edge, row) for edge, row in zip(edges, v, strict=True)]
        return np.ravel_multi_index(at, (7, 7, 7))

    found = np.bincount(cell(x), minlength=343) / N
    wanted = np.bincount(cell(y), w, 343) / (10 * N)
    squares = np.bincount(cell(y), w**2, 343) / (10 * N)
    deviation = np.sqrt(wanted / N + squares / (10 * N))
    off = (found - wanted)[wanted > 10.0 / N] / deviation[wanted > 10.0 / N]
    assert np.abs(off).max() < 4.8  # 343 cells: 1 in 2000 runs


def test_distances_are_exact_to_the_digit():
    """Of one sighting without the share from anywhere: distance and heading become uniform by their
    cumulative densities, each by quadrature of the equation.
    """
    z = Sightings(0.0, [0], [1.5], [0.4])
    x = given(WIDE, z, 1e-9).sample(Draws(3, 1), 0, N)
    d = np.hypot(x[0], x[1])
    top = WIDE.range_max + 3.0 * np.hypot(0.3, 0.1 * WIDE.range_max)
    grid = np.linspace(0.0, top, 20_001)
    density = grid * WIDE.range_density(1.5, grid)
    cumulative = np.append(0.0, np.cumsum(0.5 * (density[1:] + density[:-1])))
    assert kstest(np.interp(d, grid, cumulative / cumulative[-1]), "uniform").pvalue > 1e-4
    around = np.arctan2(x[1], x[0])
    assert kstest((around + np.pi) / (2.0 * np.pi), "uniform").pvalue > 1e-4
    off = np.angle(np.exp(1j * (0.4 - (around + np.pi - x[2]))))
    bins = np.linspace(-np.pi, np.pi, 41)
    middles = (bins[:-1, None] + (bins[1] - bins[0]) * (np.arange(50) + 0.5) / 50).ravel()
    mass = WIDE.bearing_density(middles).reshape(40, 50).mean(axis=1) * (bins[1] - bins[0])
    assert chisquare(np.histogram(off, bins)[0], N * mass / mass.sum()).pvalue > 1e-4


@every_look
def test_it_is_positive_wherever_a_robot_can_be_and_chunks_do_not_matter(z):
    q = given(SHARP, z)
    x = FLOOR.sample(Draws(8), 0, 1000)
    least = np.log(0.1 - 1e-12) + FLOOR.log_density(x)
    assert (q.log_density(x) >= least).all()
    whole = q.sample(Draws(5, 1), 0, 300)
    parts = [q.sample(Draws(5, 1), a, b - a) for a, b in ((0, 1), (1, 77), (77, 300))]
    assert np.array_equal(whole, np.concatenate(parts, axis=1))


@pytest.mark.parametrize("name", ["range and bearing", "unknown", "several"])
def test_pi_is_the_integral_of_the_likelihood(name):
    """Against a lattice, within 4.5 standard errors of the 2000 looks it takes."""
    z, (x, volume) = LOOKS[name], lattice(120, 36)
    q = given(WIDE, z)
    p = np.exp(WIDE.log_likelihood(x, z) + FLOOR.log_prior(x))
    wanted = p.sum() * volume
    variance = (p**2 / np.exp(q.log_density(x))).sum() * volume - wanted**2
    assert math.exp(q.log_pi) == pytest.approx(wanted, abs=4.5 * math.sqrt(variance / 2000))


def test_where_two_circles_meet_it_finds_the_robot():
    """A robot that sees two landmarks well: weighed by the filter's own likelihood, its poses are
    those of a lattice.
    """
    pose = np.array([-1.0, 1.2, 0.3])
    dx, dy = (PLACES[[1, 2]] - pose[:2]).T
    z = Sightings(0.0, [1, 2], np.hypot(dx, dy), np.arctan2(dy, dx) - pose[2])
    sensor = LandmarkModel(MARKS)
    q = given(sensor, z)
    x = q.sample(Draws(4, 1), 0, N)
    log_w = sensor.log_likelihood(x, z) + FLOOR.log_prior(x) - q.log_density(x)
    w = np.exp(log_w - log_w.max())
    w /= w.sum()
    assert 1.0 / (w**2).sum() > 0.005 * N
    around = [np.linspace(-reach, reach, 61) for reach in (1.5, 1.5, 0.5)]
    lattice = pose[:, None] + np.stack(np.meshgrid(*around)).reshape(3, -1)
    p = np.exp(sensor.log_likelihood(lattice, z) + FLOOR.log_prior(lattice))
    wanted = lattice @ p / p.sum()
    off = x - wanted[:, None]
    off[2] = np.angle(np.exp(1j * off[2]))
    error = np.sqrt((w**2 * off**2).sum(axis=1))
    assert (np.abs(off @ w) < 4.5 * error + 0.01).all()
    assert error.max() < 0.05  # or the comparison says nothing
