"""The sonar model: a density over ranges and no echo, by the nearest wall in a cone."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import expon, kstest, norm

from mcloc.errors import ConfigError
from mcloc.events import Scan
from mcloc.maps.occupancy import FREE, OCCUPIED, OccupancyGrid
from mcloc.sensors import SENSORS
from mcloc.simulation import SonarRing

REACH = 4.0


def room():
    """6 m × 3 m with walls around, and a pillar."""
    cells = np.full((60, 120), FREE, dtype=np.int8)
    cells[[0, -1]] = OCCUPIED
    cells[:, [0, -1]] = OCCUPIED
    cells[24:30, 40:44] = OCCUPIED
    return OccupancyGrid(cells, 0.05, np.zeros(3))


def sonar(**settings):
    return SENSORS.make("sonar", room(), **settings)


@pytest.mark.parametrize("e", [0.05, 1.0, 3.9, 6.0, np.inf, np.nan])
@pytest.mark.parametrize("settings", [{}, {"specular": 0.5, "crosstalk": 0.3, "lambda_miss": 2.0}])
def test_echoes_and_none_sum_to_one(e, settings):
    model = sonar(**settings)
    points = [e] if e < REACH else None
    measured = quad(
        lambda z: float(model.density(np.array(z), np.array(e), REACH)),
        *(0.0, REACH),
        points=points,
        limit=500,
    )[0]
    none = float(model.density(np.array(REACH), np.array(e), REACH))
    assert measured + none == pytest.approx(1.0, abs=1e-6)


def test_what_happens_to_sonars_has_its_density():
    """Echoes of one wall by the story of the model, from SciPy's distributions."""
    model, e, n = sonar(), 1.5, 20_000
    rng = np.random.default_rng(2)
    why = rng.random(n)
    sigma = np.hypot(model.sigma_hit, model.sigma_relative * e)
    z = norm.rvs(e, sigma, n, random_state=rng)
    behind = e + expon.rvs(scale=1.0 / model.lambda_miss, size=n, random_state=rng)
    z = np.where(why < model.specular + model.crosstalk, rng.uniform(0.0, REACH, n), z)
    z = np.where(why < model.specular, behind, z)
    none = float(model.density(np.array(REACH), np.array(e), REACH))
    assert abs(np.sum(z >= REACH) - n * none) <= 4.5 * np.sqrt(n * none * (1.0 - none))
    fine = np.linspace(0.0, REACH, 200_001)[:-1]
    mass = np.cumsum(model.density(fine, np.array(e), REACH))
    found = kstest(z[z < REACH], lambda x: np.interp(x, fine, mass / mass[-1]))
    assert found.pvalue > 1e-3


@pytest.mark.parametrize("beams", [7, 16, 24])
def test_a_ring_finds_its_pose_among_others(beams):
    """The likelihood of simulated echoes is highest near the pose, for most of 30 scans."""
    grid, model = room(), sonar(cone=np.radians(20.0))
    ring, rng = SonarRing(beams=beams, range_max=REACH), np.random.default_rng(beams)
    near = 0
    for _ in range(30):
        pose = rng.uniform([0.5, 0.4, -3.0], [1.6, 2.6, 3.0])
        echoes = ring.measure(grid, pose[None], rng)[0]
        z = Scan(0.0, echoes, ring.angles, REACH, source=ring.source)
        others = np.stack([rng.uniform(0.2, 5.8, 400), rng.uniform(0.2, 2.8, 400)])
        others = np.stack([*others, rng.uniform(-3.1, 3.1, 400)])
        log_p = model.log_likelihood(np.concatenate([pose[:, None], others], axis=1), z)
        near += log_p[0] >= np.quantile(log_p, 0.98)
    assert near >= 24


def test_a_ring_is_worth_its_sonars_and_no_more():
    few = Scan(0.0, np.ones(7), np.zeros(7), REACH, novelty=0.5)
    many = Scan(0.0, np.ones(24), np.zeros(24), REACH, novelty=0.5)
    assert sonar().readings(few) == 3.5
    assert sonar().readings(many) == 6.0
    assert sonar().tempering(few) == 0.5


def test_shares_have_to_leave_something():
    with pytest.raises(ConfigError, match="specular \\+ crosstalk must be below 1"):
        sonar(specular=0.6, crosstalk=0.4)
