"""Replay under real-time conditions: which scans are lost, and that nothing else changes."""

import numpy as np
import pytest
from tests.localizer.test_runtime import FRONT, SURE, two_lasers

from mcloc.filters.catalog import Composition
from mcloc.filters.filter import StepInfo
from mcloc.filters.recovery import Evidence
from mcloc.geometry import between, compose
from mcloc.localizer import Localizer, Measured, Modelled, Offline, Update, UpdatePolicy
from mcloc.particles import Particles

LOST = "scan while the filter was busy"
ALWAYS = UpdatePolicy(distance=0.0, angle=0.0)


class Takes:
    """Each update takes so many seconds; notes what it is told."""

    clocked = False

    def __init__(self, *seconds):
        self.rest, self.told = list(seconds), []

    def seconds(self, update, beams):
        self.told.append((update.step, beams))
        return self.rest.pop(0) if len(self.rest) > 1 else self.rest[0]


def scans(world, stamps, move=(0.02, 0.0, 0.0), **options):
    poses = world.path(list(move), len(stamps))
    return [
        world.scan(t, p, between([7.0, -2.0, 1.0], p), **options)
        for t, p in zip(stamps, poses, strict=True)
    ]


def used(estimates):
    return [e.t for e in estimates if e.updated]


def bytes_of(estimates):
    return [
        (e.t, e.updated, *((h.mean.tobytes(), h.covariance.tobytes(), h.share) for h in found))
        for e in estimates
        for found in [e.hypotheses]
    ]


# What an update takes


def update(sizes=(1000,), duration=0.03):
    info = StepInfo(sizes[-1], 1.0, 0.0, Evidence(), sum(sizes), sizes=sizes)
    return Update(1, info, Particles.equal(np.zeros((3, 2))), (), 1.0, duration)


def test_offline_takes_no_time():
    assert Offline().seconds(update(duration=9.0), 60) == 0.0


def test_measured_takes_the_time_that_it_took_here_times_the_slowdown():
    assert Measured().seconds(update(), 60) == 0.03
    assert Measured(slowdown=5.0).seconds(update(), 60) == pytest.approx(0.15)


def test_modelled_counts_every_particle_that_was_drawn_and_every_beam():
    pace = Modelled(particle_beam=1e-5)
    assert pace.seconds(update((1000,)), 60) == pytest.approx(0.6)
    assert pace.seconds(update((1000,)), 30) == pytest.approx(0.3)
    assert pace.seconds(update((1000, 700)), 60) == pytest.approx(1.02)
    assert pace.seconds(update((1000,), duration=9.0), 60) == pytest.approx(0.6)


# Which scans are lost


def test_a_scan_is_lost_until_the_filter_is_free(world):
    """0.5 s, then 0.25 s each. At the very moment that it is free again it takes a scan."""
    pace = Takes(0.5, 0.25)
    loc = world.localizer(policy=ALWAYS, pace=pace)
    stamps = [0.0, 0.125, 0.375, 0.5, 0.625, 0.75, 0.875, 1.0]
    found = list(loc.run(scans(world, stamps)))
    assert [e.t for e in found] == stamps
    assert used(found) == [0.0, 0.5, 0.75, 1.0]
    assert loc.ignored == {LOST: 4}
    assert pace.told == [(1, 60), (2, 60), (3, 60), (4, 60)]


def test_the_estimate_of_a_lost_scan_is_carried_along_by_odometry(world):
    move = np.array([0.3, 0.1, 0.2])
    loc = world.localizer(pace=Takes(10.0))
    first, second, third = loc.run(scans(world, [0.0, 1.0, 2.0], move))
    assert [second.updated, third.updated] == [False, False]
    assert third.update is first.update
    assert second.pose == pytest.approx(compose(first.pose, move))
    assert third.pose == pytest.approx(compose(compose(first.pose, move), move))


def test_scans_that_are_not_due_are_not_lost(world):
    """0.08 m from scan to scan, an update each 0.2 m: due are the scans at 0, 3, 4 and 5 s."""
    loc = world.localizer(pace=Takes(4.5, 0.0))
    found = list(loc.run(scans(world, [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0], (0.08, 0.0, 0.0))))
    assert used(found) == [0.0, 5.0]
    assert loc.ignored == {LOST: 2}


def test_news_is_measured_from_the_last_scan_that_was_used(world, monkeypatch):
    loc, told = world.localizer(pace=Takes(2.5)), []
    step = type(loc.filter).step

    def spy(self, bel, u, z, draws):
        told.append((z.novelty, *u))
        return step(self, bel, u, z, draws)

    monkeypatch.setattr(type(loc.filter), "step", spy)
    list(loc.run(scans(world, [0.0, 1.0, 2.0, 3.0], (0.1, 0.0, 0.0))))
    assert np.array(told) == pytest.approx(np.array([[1.0, 0, 0, 0], [0.6, 0.3, 0, 0]]))


@pytest.mark.parametrize(("particles", "every"), [(1000, 1), (2000, 2), (5000, 5)])
def test_a_machine_of_1999_keeps_up_with_1000_particles(world, particles, every):
    """At 5 Hz and with 60 beams; 5,000 take 1.0 s [Fox01 §19.2.5; Fox99]."""
    composition = Composition(
        size="fixed",
        recovery="none",
        settings={"size": {"particles": particles}, "recovery": {"doubt_below": 0.0}},
    )
    loc = Localizer(
        world.grid, composition, seed=1, initial=world.start, policy=ALWAYS, pace=Modelled()
    )
    assert loc.filter.sensor.max_beams == 60
    stamps = [0.2 * k for k in range(21)]
    found = list(loc.run(scans(world, stamps)))
    assert used(found) == stamps[::every]
    assert loc.ignored[LOST] == 21 - len(stamps[::every])


def test_a_step_that_is_drawn_twice_costs_twice(world):
    """Both see another place than the belief: the wheels are doubted."""
    events = [world.scan(t, (4.0, 2.5, 1.0), np.zeros(3)) for t in (1.0, 1.3, 1.5)]
    start = world.scan(0.0, world.start, np.zeros(3))
    cost = 300 * 60 * 1e-5  # 0.18 s
    loc = world.localizer(policy=ALWAYS, pace=Modelled(particle_beam=1e-5))
    found = list(loc.run([start, *events]))
    assert found[1].update.info.sizes == (300, 300)
    assert 0.3 < 2.0 * cost < 0.5
    assert used(found) == [0.0, 1.0, 1.5]


# What it does not change


def test_the_default_loses_nothing(world):
    events = scans(world, [1e-6 * k for k in range(9)], (0.1, 0.0, 0.05))
    expected = bytes_of(world.localizer().run(events))
    for pace in (Offline(), Takes(0.0), Measured(slowdown=1e-6), Modelled(particle_beam=1e-15)):
        loc = world.localizer(pace=pace)
        assert bytes_of(loc.run(events)) == expected
        assert not loc.ignored


def test_modelled_gives_the_same_bytes_on_any_number_of_threads(world, set_threads):
    """20,000 particles, so that threads do have work to share; 1.2 s an update."""
    events = scans(world, [float(t) for t in range(8)], (0.15, 0.0, 0.1))
    results = []
    for threads in (1, 2, 3):
        set_threads(threads)
        loc = world.localizer(20_000, policy=ALWAYS, pace=Modelled(particle_beam=1e-6))
        results.append(bytes_of(loc.run(events)))
        assert loc.ignored[LOST] == 4
    assert results[0] == results[1] == results[2]


# Measured


@pytest.fixture
def ticking(monkeypatch):
    """A clock that is 0.05 s later whenever it is read: that is what an update takes."""
    now = [0.0]

    def clock():
        now[0] += 0.05
        return now[0]

    monkeypatch.setattr("mcloc.localizer.localizer.time.perf_counter", clock)


@pytest.mark.usefixtures("ticking")
@pytest.mark.parametrize(("slowdown", "every"), [(1.0, 1), (5.0, 2), (11.0, 3)])
def test_a_slower_computer_loses_more(world, slowdown, every):
    loc = world.localizer(policy=ALWAYS, pace=Measured(slowdown=slowdown))
    stamps = [0.2 * k for k in range(13)]
    assert used(loc.run(scans(world, stamps))) == stamps[::every]


def test_loading_the_kernels_is_part_of_no_update(world, monkeypatch):
    """The first step is made twice, and measured the second time."""
    now, steps = [0.0], []
    loc = world.localizer(policy=ALWAYS, pace=Measured())
    step = type(loc.filter).step

    def loading(self, bel, u, z, draws):
        now[0] += 0.1 if steps else 60.0
        steps.append(draws.step)
        return step(self, bel, u, z, draws)

    monkeypatch.setattr(type(loc.filter), "step", loading)
    monkeypatch.setattr("mcloc.localizer.localizer.time.perf_counter", lambda: now[0])
    found = list(loc.run(scans(world, [0.0, 0.2, 0.4])))
    assert steps == [1, 1, 2, 3]
    assert [e.update.duration for e in found] == pytest.approx([0.1, 0.1, 0.1])
    assert not loc.ignored


# Several lasers


def test_one_laser_keeps_the_filter_busy_for_the_other(world):
    """The rear one looks 0.01 s after the front one, an update takes 0.5 s; both see 0.12 m of way
    a second and are used each 0.2 m. The rear one's first scan is lost, its second is news.
    """
    loc = world.localizer(pace=Takes(0.5))
    found = list(loc.run(two_lasers(world, world.path([0.12, 0.0, 0.0], 6))))
    sources = [(e.t, e.measurement.source) for e in found if e.updated]
    assert sources == [
        *((0.0, "front"), (1.01, "rear"), (2.0, "front")),
        *((3.01, "rear"), (4.0, "front"), (5.01, "rear")),
    ]
    assert loc.ignored == {LOST: 1}


def test_a_laser_that_never_finds_the_filter_free_is_carried_along(world):
    loc = world.localizer(policy=ALWAYS, pace=Takes(0.5))
    found = list(loc.run(two_lasers(world, world.path([0.12, 0.0, 0.0], 4))))
    assert [e.measurement.source for e in found if e.updated] == ["front"] * 4
    assert len(found) == 8
    assert loc.ignored == {LOST: 4}


# Asked for while it is busy


def test_a_forced_update_waits_until_the_filter_is_free(world):
    loc = world.localizer(pace=Takes(2.5))
    events = scans(world, [0.0, 1.0, 2.0, 3.0, 4.0], (0.01, 0.0, 0.0))
    done = loc.process(events[0])
    loc.force_update()
    for event in events[1:]:
        done += loc.process(event)
    assert used(done) == [0.0, 3.0]
    assert loc.ignored == {LOST: 2}


@pytest.mark.parametrize("start", ["told", "globally"])
def test_a_new_start_does_not_wait(world, start):
    loc = world.localizer(pace=Takes(1e9))
    events = scans(world, [0.0, 1.0, 2.0, 3.0], (0.3, 0.0, 0.0), source="front", mount=FRONT)
    done = loc.process(events[0]) + loc.process(events[1])
    if start == "told":
        loc.set_pose(world.start, SURE)
    else:
        loc.start_globally()
    done += loc.process(events[2]) + loc.process(events[3])
    assert used(done) == [0.0, 2.0]


def test_another_map_does_not_make_the_filter_free(world):
    loc = world.localizer(pace=Takes(10.0))
    events = scans(world, [0.0, 1.0], (0.3, 0.0, 0.0))
    loc.process(events[0])
    loc.swap_map(world.grid)
    assert used(loc.process(events[1])) == []


def test_a_clock_that_is_set_back_does_not_leave_the_filter_busy(world):
    events = scans(world, [3600.0, 1.0, 2.0, 3.0, 4.0, 5.0], (0.25, 0.0, 0.0))
    loc = world.localizer(pace=Takes(1.5))
    found = list(loc.run(events))
    assert [(e.t, e.updated) for e in found] == [
        *((3600.0, True), (3.0, True), (4.0, False), (5.0, True))
    ]
    assert loc.ignored == {"late scan": 2, "clock of scans set back": 1, LOST: 1}
