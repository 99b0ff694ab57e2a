"""What the runtime learns about the robot's sensors, and tells the models of beacons."""

from dataclasses import replace

import numpy as np
import pytest

from mcloc.errors import StateError
from mcloc.estimate import Hypothesis
from mcloc.events import BeaconRanges, Odometry
from mcloc.filters.catalog import Composition
from mcloc.filters.filter import StepInfo
from mcloc.filters.recovery import Evidence
from mcloc.geometry import between
from mcloc.localizer import Localizer, Update
from mcloc.localizer.queue import LATENCY
from mcloc.localizer.record import Record, noted, told
from mcloc.localizer.state import restore, save
from mcloc.maps.beacons import Beacons
from mcloc.particles import Particles
from mcloc.sensors.beacons import BeaconModel

BEACONS = Beacons(["a", "b", "c"], np.array([[0.3, 0.3, 1.5], [4.0, 0.5, 1.5], [2.0, 2.6, 1.5]]))
TURN = np.array([0.3, 0.0, 0.25])


def update(pose, share=1.0, explained=1.0):
    info = StepInfo(2, 1.0, 0.0, Evidence(), 2)
    at = Hypothesis(np.array(pose), np.eye(3) * 0.01, share)
    return Update(1, info, Particles.equal(np.zeros((3, 2))), (at,), explained, 0.1)


def ranges_from(pose, t=0.0, off=(0.0, 0.0, 0.0), odometry=None):
    d = np.linalg.norm(BEACONS.places - [*pose[:2], 0.0], axis=1)
    return BeaconRanges(t, np.arange(3), d + np.array(off), odometry=odometry)


def test_each_beacon_is_judged_by_itself_and_by_its_news():
    records, sensor = {}, BeaconModel(BEACONS)
    pose = [1.0, 1.0, 0.0]
    noted(records, ranges_from(pose, off=(0.0, 5.0, np.nan)), 0.4, update(pose), sensor)
    assert records == {
        "beacon 0": Record(0.4, 0.0, False),
        "beacon 1": Record(0.4, 0.4, False),
        "beacon 2": Record(conclusive=False),
    }
    z = told(ranges_from(pose), {**records, "laser": Record(10.0, 1.0)})
    assert z.heard.tolist() == [0.4, 0.4, 0.0]
    assert z.failed.tolist() == [0.0, 0.4, 0.0]
    assert z.usual == 0.1  # the laser's
    assert told(z, {**records, "beacon 2": Record(1.0, 0.25, False)}).usual == 0.25  # beacons alone
    assert z.alone
    assert told(z, {}, alone=False).usual == 0.0
    assert not told(z, {}, alone=False).alone


def test_beacons_that_all_fail_do_not_excuse_each_other():
    """They were surveyed in another frame, say; a laser that fits tells so."""
    bad = {f"beacon {k}": Record(40.0, 36.0, False) for k in range(3)}
    sensor, z = BeaconModel(BEACONS), ranges_from([1.0, 1.0, 0.0])
    beside = told(z, {**bad, "laser": Record(40.0, 4.0)}, alone=False)
    assert sensor.trust(beside) == pytest.approx(np.full(3, 5.0 / 38.0))
    assert sensor.trust(told(z, bad)) == pytest.approx(np.ones(3))  # nobody knows better


def test_a_robot_that_stands_still_hears_each_beacon_once(world):
    """The first ranges are taken together; the same again are no news of any of them."""
    pose = np.array([1.0, 1.0, 0.0])
    at = np.zeros(3)
    localizer = Localizer(world.grid, aids=[BEACONS], seed=1, initial=pose)
    for t in (1.0, 2.0, 3.0):
        localizer.process(ranges_from(pose, t, odometry=at))
    localizer.finish()
    assert {name: record.heard for name, record in localizer.record.items()} == {
        f"beacon {k}": 1.0 for k in range(3)
    }


def test_what_cannot_be_used_is_counted(world):
    pose = np.array([1.0, 1.0, 0.0])
    localizer = Localizer(world.grid, aids=[BEACONS], seed=1, initial=pose)
    localizer.process(ranges_from(pose, 1.0, odometry=np.zeros(3)))
    far = ranges_from(pose, 2.0, off=(-100.0, 3000.0, 0.0), odometry=np.array([1.0, 0.0, 0.0]))
    localizer.process(far)
    localizer.finish()
    assert localizer.ignored == {
        "beacon reading without a range": 1,
        "beacon reading that tells nothing": 1,
    }


def test_nothing_is_learnt_where_the_filter_is_not_sure(world):
    records = {}
    z = ranges_from([1.0, 1.0], off=(5.0, 5.0, 5.0))
    noted(records, z, 1.0, update([1.0, 1.0, 0.0], share=0.8), BeaconModel(BEACONS))
    noted(records, z, 1.0, replace(update([1.0, 1.0, 0.0]), hypotheses=()), BeaconModel(BEACONS))
    assert records == {}


def test_other_measurements_are_counted_as_a_whole_and_left_alone(world):
    records, scan = {}, world.scan(0.0, world.start)
    noted(records, scan, 0.5, update(world.start, explained=0.8), None)
    noted(records, scan, 0.5, update(world.start, explained=np.nan), None)
    assert records["laser"].heard == 0.5
    assert records["laser"].share_failed == pytest.approx(0.2)
    assert told(scan, records) is scan


def drive(world, n=40, bad=2):
    """Ranges along a circle, of which those to one beacon are 2 m short, always."""
    off = np.zeros(3)
    off[bad] = -2.0
    for t, pose in enumerate(world.path(np.array([0.25, 0.0, 0.25]), n)):
        wheels = between([7.0, -2.0, 1.0], pose)
        yield Odometry(float(t), wheels)
        noise = 0.05 * np.random.default_rng(t).normal(size=3)
        yield ranges_from(pose, float(t), off + noise, wheels)


def localizer(world, **options):
    few = Composition(size="fixed", settings={"size": {"particles": 1000}})
    return Localizer(world.grid, few, aids=[BEACONS], seed=1, initial=world.start, **options)


def test_a_bad_beacon_is_found_out_on_the_way(world):
    runtime = localizer(world)
    found = list(runtime.run(drive(world)))
    failed = [runtime.record[f"beacon {k}"].share_failed for k in range(3)]
    assert failed[2] > 0.8
    assert max(failed[:2]) < 0.1
    truth = world.path(np.array([0.25, 0.0, 0.25]), 40)
    errors = [np.hypot(*(e.pose - truth[int(e.t)])[:2]) for e in found if e.t > 10]
    assert np.median(errors) < 0.3
    assert runtime.told(ranges_from(world.start)).alone
    # Until the first beacons are heard there are only wheels, and now and then between them.
    assert {e.measurement.source for e in found} == {
        "wheels",
        "beacon 0",
        "beacon 1",
        "beacon 2",
    }


def test_what_was_found_is_saved_and_restored(world, tmp_path):
    events = list(drive(world))
    whole, first = localizer(world), localizer(world)
    expected = list(whole.run(events))
    found = []
    for event in events[:31]:
        found += first.process(event)
        if isinstance(event, Odometry):
            found += first.follow(event.t - LATENCY)
    save(first, tmp_path / "s.npz")
    second = restore(tmp_path / "s.npz", world.grid, [BEACONS])
    assert second.record == first.record
    found += list(second.run(events[31:]))
    assert [e.pose.tobytes() for e in found] == [e.pose.tobytes() for e in expected]
    assert second.record == whole.record
    with pytest.raises(StateError, match="other maps of landmarks, beacons"):
        restore(tmp_path / "s.npz", world.grid, [Beacons(["a"], np.zeros((1, 3)))])


def test_beside_a_laser_beacons_are_told_so_from_then_on(world, tmp_path):
    runtime = localizer(world)
    wheels = between([7.0, -2.0, 1.0], world.start)
    runtime.process(world.scan(0.0, world.start, wheels))
    assert not runtime.told(ranges_from(world.start)).alone
    save(runtime, tmp_path / "s.npz")
    again = restore(tmp_path / "s.npz", world.grid, [BEACONS])
    assert not again.told(ranges_from(world.start)).alone
