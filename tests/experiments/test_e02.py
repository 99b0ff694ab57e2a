"""E2: how its claim is decided, and the posterior against a sum by hand on a small map."""

from pathlib import Path

import numpy as np
import pytest

from mcloc.events import Scan
from mcloc.experiments import e02_scan_likelihood as e02
from mcloc.experiments.places import VARIABLE
from mcloc.experiments.results import draw
from mcloc.experiments.study import Verdict
from mcloc.experiments.table import Row, Table
from mcloc.maps.occupancy import FREE, OCCUPIED, OccupancyGrid
from mcloc.sensors.beam_presets import Fox01Beams

OFFICE_12 = {"place": e02.OFFICE, "beams": 12.0}


def table_of(shares: dict[str, float]) -> Table:
    """Twenty seeds around a share for each place."""
    rng = np.random.default_rng(0)
    return Table(
        [
            Row(
                {"place": place, "beams": 12.0},
                seed,
                {"in_corridor": share + 0.01 * rng.standard_normal(), "near": 0.1, "floor": 0.2},
            )
            for place, share in shares.items()
            for seed in range(20)
        ]
    )


@pytest.mark.parametrize(
    ("shares", "verdict"),
    [
        ((0.9, 0.8), Verdict.REPRODUCED),
        ((0.9, 0.3), Verdict.IN_PART),
        ((0.5, 0.2), Verdict.NOT),
    ],
)
def test_verdicts_follow_the_shares(shares: tuple[float, ...], verdict: Verdict) -> None:
    finding = e02.corridor(table_of(dict(zip((e02.OFFICE, e02.WEAN), shares, strict=True))))
    assert finding.verdict is verdict
    assert finding.figure.value == pytest.approx(min(shares), abs=0.01)


def room() -> OccupancyGrid:
    """3 × 2 m with a pillar, cells of 0.1 m."""
    cells = np.full((20, 30), FREE, dtype=np.int8)
    cells[[0, -1]] = OCCUPIED
    cells[:, [0, -1]] = OCCUPIED
    cells[5:8, 20:24] = OCCUPIED
    return OccupancyGrid(cells, 0.1, np.array([-1.0, 2.0, 0.0]))


def test_the_posterior_is_the_sum_by_hand() -> None:
    """p(x | y) ∝ Σ_θ Π_k p(z_k | e_k)^β with the mixture written out."""
    grid, angles = room(), np.linspace(-1.5, 1.5, 7)
    scan = Scan(0.0, np.array([0.4, 0.5, 0.9, 1.2, np.inf, 0.6, 0.5]), angles, 3.0, np.zeros(3))
    given = e02.Case(grid, scan, np.zeros(3), e02.OFFICE_CORRIDOR)
    cells = e02.free_places(grid)
    points = e02.points_of(grid, cells)
    found = e02.posterior(e02.log_likelihood(given, points, headings=8))
    assert found.sum() == pytest.approx(1.0)

    sensor = Fox01Beams(grid)
    z, p = np.minimum(scan.ranges, 3.0), []
    for point in points:
        total = 0.0
        for heading in (np.arange(8) + 0.5) * np.pi / 4 - np.pi:
            x = np.array([[point[0]], [point[1]], [heading]])
            e = sensor.rays.ranges(x, scan.mount, angles, 3.0)[0]
            total += float(np.prod(sensor.density(z, e, 3.0) ** (e02.OWN / 7)))
        p.append(total)
    # The table of log p that the kernel looks up errs by 0.03 a beam at most.
    np.testing.assert_allclose(found, np.array(p) / sum(p), rtol=0.03 * e02.OWN)
    assert np.argmax(found) == np.argmax(p)


def test_the_places_lie_on_the_free_floor() -> None:
    grid = room()
    cells = e02.free_places(grid)
    assert grid.free[tuple(cells.T)].all()
    assert np.unique(np.diff(np.unique(cells[:, 0]))).tolist() == [2]  # each 0.2 m
    points = e02.points_of(grid, cells)
    row, column = grid.cell_of(np.insert(points, 2, 0.0, axis=1))
    np.testing.assert_array_equal(np.stack([row, column], axis=1), cells)


def test_a_strip_holds_what_lies_along_it() -> None:
    strip = e02.Strip((0.0, 0.0), (3.0, 4.0), 1.0)
    points = np.array([[1.5, 2.0], [0.8, 2.5], [0.6, 2.8], [-0.1, 0.0], [3.1, 4.1], [3.0, 4.0]])
    assert strip.holds(points).tolist() == [True, True, False, False, False, True]
    inner = 0.999 * (strip.outline() - [1.5, 2.0]) + [1.5, 2.0]
    outer = 1.001 * (strip.outline() - [1.5, 2.0]) + [1.5, 2.0]
    assert strip.holds(inner).all()
    assert not strip.holds(outer).any()


def test_scans_of_the_office_are_from_its_corridor() -> None:
    for seed in range(10):
        given = e02.case(e02.OFFICE, seed)
        assert given.corridor.holds(given.truth[None, :2]).all()
        assert given.grid.state_at(given.truth) == "free"


def test_wean_needs_the_recorded_logs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(VARIABLE, raising=False)
    assert VARIABLE in str(e02.missing({"place": e02.WEAN}))
    assert e02.missing({"place": e02.OFFICE}) is None


@pytest.mark.usefixtures("data_dir")
def test_scans_of_wean_are_from_its_corridor() -> None:
    cases = [e02.case(e02.WEAN, seed) for seed in range(5)]
    assert all(given.corridor.holds(given.truth[None, :2]).all() for given in cases)
    assert len({given.scan.t for given in cases}) == 5


def test_a_seed_gives_the_same_record_and_a_picture(tmp_path: Path) -> None:
    record = e02.run(OFFICE_12, 1)
    e02.computed.cache_clear()
    assert record == e02.run(OFFICE_12, 1)
    assert record["in_corridor"] >= record["near"] > 0.5
    smoother = e02.run({**OFFICE_12, "beams": 4.0}, 1)
    assert smoother["near"] < record["near"]
    draw(e02.STUDY, Table([Row(OFFICE_12, 1, record)]), tmp_path / "figure.png")
