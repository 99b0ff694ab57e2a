"""Each density against its integral and against samples of the very thing that it describes."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm

from mcloc.maps.occupancy import FREE, OCCUPIED, OccupancyGrid
from mcloc.sensors import SENSORS
from mcloc.sensors.beam_densities import exponential, hit, miss, no_return, short, uniform

REACH = 8.0
EXPECTED = [1e-3, 0.1, 0.25, 2.0, 5.0, 7.95, 8.0, 8.1, 30.0, np.inf]
CAUSES = {
    "hit": lambda z, e: hit(z, e, REACH, 0.2),
    "precise hit": lambda z, e: hit(z, e, REACH, 0.01),
    "short": lambda z, e: short(z, e, REACH, 0.1),
    "very short": lambda z, e: short(z, e, REACH, 5.0),
    "miss": lambda z, e: miss(z, e, REACH, 0.1),
    "slight miss": lambda z, e: miss(z, e, REACH, 5.0),
    "no return": lambda z, e: no_return(z, REACH),
    "uniform": lambda z, e: uniform(z, REACH),
    "exponential": lambda z, e: exponential(z, REACH, 0.3),
}
BEAMS = [name for name in SENSORS if name.startswith("beam-")]


def by_quadrature(density, e, edges):
    """(K,): ∫ p dz between each two edges."""
    return np.array(
        [
            quad(lambda z: float(density(np.array(z), np.array(e))), low, high, limit=200)[0]
            for low, high in zip(edges[:-1], np.nextafter(edges[1:], 0.0), strict=True)
        ]
    )


def integral(density, e):
    """∫ over [0, range_max) and the atom, in pieces between the places where something happens."""
    around = min(e, REACH) + np.array([-1.0, -0.1, -0.03, 0.0, 0.03, 0.1, 1.0])
    edges = np.unique(np.clip([0.0, *around, 0.2, 1.0, REACH], 0.0, REACH))
    within = by_quadrature(density, e, edges).sum()
    return within + float(density(np.array(REACH), np.array(e)))


@pytest.mark.parametrize("e", EXPECTED)
@pytest.mark.parametrize("cause", CAUSES)
def test_a_cause_has_integral_1_whatever_is_expected(cause, e):
    assert integral(CAUSES[cause], e) == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("e", [0.0, *EXPECTED, np.nan])
@pytest.mark.parametrize("name", BEAMS)
def test_a_beam_model_has_integral_1_whatever_is_expected(name, e):
    grid = OccupancyGrid(np.full((3, 3), FREE, dtype=np.int8), 0.1, np.zeros(3))
    model = SENSORS.make(name, grid)
    assert integral(lambda z, e: model.density(z, e, REACH), e) == pytest.approx(1.0, abs=1e-6)


N = 200_000


def measured_hit(rng, e):
    """Gaussian noise; what would be ≤ 0 is measured again."""
    z = norm.rvs(e, 0.4, size=N, random_state=rng)
    while (wrong := z <= 0.0).any():
        z[wrong] = norm.rvs(e, 0.4, size=wrong.sum(), random_state=rng)
    return z


def measured_short(rng, e):
    """Things stand at a constant rate; the beam meets one before the wall, or is cast again."""
    z = rng.exponential(1.0 / 0.3, N)
    while (behind := z >= e).any():
        z[behind] = rng.exponential(1.0 / 0.3, behind.sum())
    return z


def measured_miss(rng, e):
    """Beyond the wall, things stand at a constant rate."""
    return e + rng.exponential(1.0 / 0.3, N)


@pytest.mark.parametrize("e", [0.3, 4.1, 7.8])
@pytest.mark.parametrize(
    ("process", "density"),
    [
        (measured_hit, lambda z, e: hit(z, e, REACH, 0.4)),
        (measured_short, lambda z, e: short(z, e, REACH, 0.3)),
        (measured_miss, lambda z, e: miss(z, e, REACH, 0.3)),
    ],
)
def test_readings_come_as_often_as_the_density_says(process, density, e):
    """The share of readings in each bin, and of no returns, within 4.5 binomial deviations."""
    edges = np.unique([*np.arange(0.0, REACH + 0.1, 0.5), e])
    p = np.append(by_quadrature(density, e, edges), density(np.array(REACH), np.array(e)))
    readings = process(np.random.default_rng(1), e)
    counts = np.histogram(readings[readings < REACH], edges)[0]
    found = np.append(counts, np.sum(readings >= REACH)) / N
    assert p.sum() == pytest.approx(1.0)
    assert (np.abs(found - p) <= 4.5 * np.sqrt(np.clip(p * (1.0 - p), 0.0, None) / N) + 1e-9).all()


def test_a_wall_out_of_reach_gives_no_return():
    """What four models say of no return where none is expected, and where one is."""
    walls = np.full((3, 3), OCCUPIED, dtype=np.int8)
    for name in BEAMS:
        model = SENSORS.make(name, OccupancyGrid(walls, 0.1, np.zeros(3)))
        beyond, within = model.density(np.array(np.inf), np.array([np.inf, 2.0]), REACH)
        assert beyond > 0.5
        assert within < 0.2
        assert model.density(np.array(REACH), np.array(np.inf), REACH) == beyond
