"""Teams in the simulator: who sees whom, against walls that are looked through point by point."""

import math
from itertools import pairwise

import numpy as np
import pytest

from mcloc.errors import ConfigError
from mcloc.events import Detection, Odometry, Scan
from mcloc.filters.catalog import Composition
from mcloc.geometry import compose, wrap
from mcloc.localizer import Localizer
from mcloc.maps.occupancy import FREE, OCCUPIED, OccupancyGrid
from mcloc.maps.teammates import Teammates
from mcloc.simulation import Scenario, Spotter, TeamDrive, office_world, simulate_team
from mcloc.simulation.team_drive import in_sight
from mcloc.team.team import Team

SHARP = Spotter(
    sigma_range=0.0, sigma_bearing=0.0, sigma_heading=0.0, headings=True, p_seen=1.0, p_false=0.0
)


@pytest.fixture(scope="module")
def world() -> OccupancyGrid:
    return office_world(3)


@pytest.fixture(scope="module")
def team(world: OccupancyGrid) -> TeamDrive:
    return simulate_team(world, 5, 3, Scenario(length=25.0), SHARP)


def detections(team: TeamDrive) -> list[tuple[str, Detection]]:
    return [(name, event) for name, event in team.merged() if isinstance(event, Detection)]


def seen_through(grid: OccupancyGrid, a: np.ndarray, b: np.ndarray) -> bool:
    """Whether points 5 mm apart between a and b are all outside of walls."""
    n = max(int(np.hypot(*(b - a)[:2]) / 0.005), 2)
    points = a + np.linspace(0.0, 1.0, n)[:, None] * (b - a)
    row, column = grid.cell_of(points)
    return not grid.occupied[row, column].any()


def test_detections_are_of_where_the_robots_are(team: TeamDrive) -> None:
    found = detections(team)
    assert len(found) > 10
    for name, z in found:
        a, b = (team.truth[who].at(np.array([z.t]))[0] for who in (name, z.seen))
        d, direction = np.hypot(*(b - a)[:2]), np.arctan2(*(b - a)[1::-1])
        assert z.range == pytest.approx(d)
        assert abs(wrap(z.bearing - (direction - a[2]))) < 1e-9
        assert abs(wrap(z.heading - (b[2] - a[2]))) < 1e-9
        assert abs(z.bearing) <= math.pi / 2 + 1e-9
        assert d <= 8.0


def test_all_that_is_in_sight_is_seen_and_nothing_through_walls(
    team: TeamDrive, world: OccupancyGrid
) -> None:
    seen = {(name, z.seen, z.t) for name, z in detections(team)}
    looks, walls = 0, 0
    for t in np.arange(1.0, team.truth["1"].t[-1], 1.0):
        poses = {name: path.at(np.array([t]))[0] for name, path in team.truth.items()}
        for a in poses:
            for b in poses.keys() - {a}:
                off = poses[b] - poses[a]
                near = np.hypot(*off[:2]) <= 8.0
                ahead = abs(wrap(np.arctan2(off[1], off[0]) - poses[a][2])) <= math.pi / 2
                clear = seen_through(world, poses[a], poses[b])
                looks += 1
                walls += near and ahead and not clear
                assert ((a, b, float(t)) in seen) == (near and ahead and clear)
    assert looks > 100
    assert walls > 10


def test_a_wall_hides_and_a_door_does_not() -> None:
    cells = np.full((40, 60), FREE, dtype=np.int8)
    cells[:30, 30] = OCCUPIED
    grid = OccupancyGrid(cells, 0.1, np.array([2.0, -1.0, 0.5]))
    here = compose(grid.origin, np.array([[1.0, 1.0, 0.0]] * 3))
    there = compose(grid.origin, np.array([[5.0, 1.0, 0.0], [2.8, 1.0, 0.0], [5.0, 9.0, 0.0]]))
    assert in_sight(grid, here, there).tolist() == [False, True, True]


def test_noise_and_false_detections_are_as_asked_for() -> None:
    """Two that stand 3 m apart, looked at 20,000 times; 4.5 standard errors."""
    grid = OccupancyGrid(np.full((100, 100), FREE, dtype=np.int8), 0.1, np.zeros(3))
    n, spotter = 20_000, Spotter(p_seen=0.8, mount=(0.2, 0.0, 0.1))
    seer, seen = (np.tile([x, 5.0, 0.0], (n, 1)) for x in (3.0, 6.2))
    t = np.arange(n, dtype=np.float64)
    found = list(spotter.look(grid, t, seer, seen, "2", np.random.default_rng(1)))
    assert abs(len(found) - 0.8 * n) < 4.5 * np.sqrt(n * 0.16)
    assert all(z.mount.tolist() == [0.2, 0.0, 0.1] and math.isnan(z.heading) for z in found)
    r, b = np.array([(z.range, z.bearing) for z in found]).T
    near = (np.abs(r - 3.0) < 6 * 0.605) & (np.abs(b + 0.1) < 6 * 0.048)
    false = 1.0 - np.mean(near)
    # A false one lies near by chance: 12 · 0.048 of π; and 7.26 m of 8 m.
    expected = 0.069 * (1.0 - 12 * 0.048 / np.pi * (3.0 + 6 * 0.605) / 8.0)
    assert abs(false - expected) < 4.5 * np.sqrt(expected / len(found))
    true = np.abs(b + 0.1) < 0.2
    assert np.std(b[true]) == pytest.approx(0.048, rel=0.05)
    assert np.median(np.abs(r - 3.0)[true]) == pytest.approx(0.6745 * 0.605, rel=0.06)


def test_a_larger_team_has_the_smaller_one_in_it(world: OccupancyGrid) -> None:
    short = Scenario(length=6.0)
    two, three = (simulate_team(world, 7, n, short) for n in (2, 3))
    again = simulate_team(world, 7, 2, short)
    other = simulate_team(world, 8, 2, short)
    end = min(two.truth["1"].t[-1], three.truth["1"].t[-1])
    for name in "12":
        a, b = (drive.truth[name] for drive in (two, three))
        assert np.array_equal(a.poses[a.t <= end], b.poses[b.t <= end])
        assert two.truth[name].poses.tobytes() == again.truth[name].poses.tobytes()
    assert two.truth["1"].poses[0].tolist() != other.truth["1"].poses[0].tolist()
    assert len({path.t[-1] for path in two.truth.values()}) == 1
    assert {type(event) for event in two.events["1"]} <= {Odometry, Scan, Detection}
    assert all(a.t <= b.t for a, b in pairwise(event for _, event in two.merged()))


@pytest.mark.parametrize(("seed", "robots", "what"), [(0, 1, "2 to 10"), (0, 11, "2 to 10")])
def test_no_team_is_refused(world: OccupancyGrid, seed: int, robots: int, what: str) -> None:
    with pytest.raises(ConfigError, match=what):
        simulate_team(world, seed, robots)
    with pytest.raises(ConfigError, match="seed"):
        simulate_team(world, -1)
    with pytest.raises(ConfigError, match="mount"):
        Spotter(mount=(0.0, 0.0, math.inf))


def test_one_robot_with_a_laser_leads_the_other(world: OccupancyGrid) -> None:
    """The other one has no laser, and starts anywhere: after they met it is where it was told."""
    drive = simulate_team(world, 5, 2, Scenario(length=25.0), Spotter(fov=2.0 * math.pi))
    start = drive.truth["1"].poses[0]
    few = Composition("mixture", settings={"filter": {"particles": 2000}})
    first = Localizer(world, few, aids=(Teammates(),), seed=1, initial=start)
    second = Localizer(world, few, aids=(Teammates(),), seed=2)
    team = Team({"1": first, "2": second})
    off = []
    for name, event in drive.merged():
        if name == "2" and isinstance(event, Scan):
            continue
        for who, estimate in team.process(name, event):
            true = drive.truth[who].at(np.array([estimate.t]))[0]
            off.append((who, np.hypot(*(estimate.pose - true)[:2])))
    assert team.used >= 2
    assert np.median([e for who, e in off if who == "1"]) < 0.15
    assert np.median([e for who, e in off if who == "2"]) < 1.5
