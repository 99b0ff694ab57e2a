"""A saved state is complete: what is restored goes on with the same bytes."""

import json
import math
from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mcloc.errors import ConfigError, McLocError, StateError
from mcloc.events import Odometry, Scan
from mcloc.filters.catalog import Composition
from mcloc.localizer import Localizer, Modelled, Offline, UpdatePolicy
from mcloc.localizer.state import VERSION, packed, restore, save
from mcloc.maps.occupancy import OccupancyGrid
from mcloc.storage import VALUES, read_state, write_state


def fingerprint(estimates):
    """Everything that an estimate says, but for the time that it took."""
    return [
        (
            e.t,
            e.updated,
            e.odometry.tobytes(),
            *((h.mean.tobytes(), h.covariance.tobytes(), h.share) for h in e.hypotheses),
            e.update.step,
            replace(e.update.info),
            e.update.particles.states.tobytes(),
            str(e.update.explained),
        )
        for e in estimates
    ]


@pytest.fixture(scope="module")
def events(world):
    """Scans of two lasers that wait for odometry, late ones, and stamps that leap."""
    poses = world.path([0.13, 0.0, 0.07], 14)
    found: list[Odometry | Scan] = []
    for t, pose in enumerate(poses):
        found.append(Odometry(t - 0.3, pose))
        found.append(world.scan(float(t), pose, source="front", mount=(0.1, 0.0, 0.0)))
        found.append(world.scan(t + 0.1, pose, source="rear", mount=(-0.1, 0.0, math.pi)))
    found.insert(20, Odometry(900.0, poses[0]))
    found.insert(28, world.scan(900.0, poses[0]))
    found.insert(35, Odometry(1.0, poses[0]))
    return found


@pytest.mark.parametrize("pace", [Offline(), Modelled(particle_beam=1e-4)])  # 1.8 s an update
def test_restored_after_any_event_it_goes_on_with_the_same_bytes(world, events, tmp_path, pace):
    whole = world.localizer(pace=pace)
    expected = fingerprint(whole.run(events))
    assert whole.ignored["scan stamp from the future"] == 1
    assert (whole.ignored["scan while the filter was busy"] > 5) == (pace != Offline())
    for stop in range(0, len(events), 3):
        first = world.localizer(pace=pace)
        found = fingerprint(e for event in events[:stop] for e in first.process(event))
        save(first, tmp_path / "state.npz")
        second = restore(tmp_path / "state.npz", world.grid)
        assert second.pace == pace
        assert second.hypotheses == () or second.hypotheses[0].share > 0
        found += fingerprint(second.run(events[stop:]))
        assert found == expected
        assert second.ignored == whole.ignored


def test_what_a_user_asked_for_is_saved_too(world, tmp_path):
    composition = Composition(
        size="fixed", recovery="random", settings={"size": {"particles": 200}}
    )
    policy = UpdatePolicy(distance=1.0)
    loc = Localizer(world.grid, composition, seed=2**64 - 1, policy=policy)
    loc.process(world.scans(world.path([0.1, 0, 0], 1))[0])
    loc.force_update()
    loc.set_pose(world.start, np.eye(3) * 0.01)
    loc.force_update()
    save(loc, tmp_path / "s.npz")
    again = restore(tmp_path / "s.npz", world.grid)
    assert again.composition == composition
    assert (again.policy, again.seed, again.step) == (policy, 2**64 - 1, loc.step)
    assert again.update is None
    events = world.scans(world.path([0.1, 0, 0], 4))[1:]
    assert fingerprint(again.run(events)) == fingerprint(loc.run(events))


class Capricious:
    """A pace of somebody's own."""

    clocked = False

    def seconds(self, update, beams):
        return 1.0


def test_a_pace_that_could_not_be_restored_is_not_saved(world, tmp_path):
    loc = world.localizer(pace=Capricious())
    with pytest.raises(ConfigError, match="pace Capricious cannot be saved, only one of offline"):
        save(loc, tmp_path / "s.npz")
    assert not list(tmp_path.iterdir())


def test_saving_changes_nothing(world, events):
    loc = world.localizer()
    for event in events[:22]:
        loc.process(event)
    before, _ = packed(loc)
    again, _ = packed(loc)
    assert json.dumps(before) == json.dumps(again)


def test_another_map_is_refused(world, tmp_path):
    save(world.localizer(), tmp_path / "s.npz")
    for cells, resolution in ((world.grid.cells.T, 0.05), (world.grid.cells, 0.06)):
        other = OccupancyGrid(cells, resolution, world.grid.origin, name="other")
        with pytest.raises(StateError, match=r"s\.npz: was saved on another map than other"):
            restore(tmp_path / "s.npz", other)


def test_another_version_is_refused(world, tmp_path):
    write_state(tmp_path / "s.npz", {"version": 99}, {})
    with pytest.raises(StateError, match=f"version 99, but this mcloc reads version {VERSION}"):
        restore(tmp_path / "s.npz", world.grid)


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04", b"no state", b"\x80\x04N."])
def test_a_file_that_is_none(world, tmp_path, content):
    (tmp_path / "s.npz").write_bytes(content)
    with pytest.raises(StateError, match="damaged, or no saved state"):
        restore(tmp_path / "s.npz", world.grid)


def test_a_missing_file(world, tmp_path):
    with pytest.raises(StateError, match="cannot be read"):
        restore(tmp_path / "none.npz", world.grid)


def test_a_pickle_in_it_is_not_executed(world, tmp_path):
    np.savez(tmp_path / "s.npz", **{VALUES: np.array([object()], dtype=object)})
    with pytest.raises(StateError, match="damaged"):
        restore(tmp_path / "s.npz", world.grid)


@pytest.mark.parametrize("missing", ["belief.states", "odometry"])
def test_a_state_without_a_part(world, tmp_path, missing):
    values, arrays = packed(world.localizer())
    del arrays[missing]
    write_state(tmp_path / "s.npz", {"version": VERSION, **values}, arrays)
    with pytest.raises(StateError, match="damaged"):
        restore(tmp_path / "s.npz", world.grid)


@settings(max_examples=60, deadline=None)
@given(st.data())
def test_a_damaged_file_is_restored_or_refused(world, tmp_path_factory, data):
    path = tmp_path_factory.mktemp("damage") / "s.npz"
    save(world.localizer(50), path)
    raw = bytearray(path.read_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        raw[data.draw(st.integers(0, len(raw) - 1))] = data.draw(st.integers(0, 255))
    path.write_bytes(raw[: data.draw(st.integers(0, len(raw)))])
    with suppress(McLocError):
        restore(path, world.grid)


def test_a_half_written_file_never_takes_the_place_of_a_whole_one(world, tmp_path, monkeypatch):
    save(world.localizer(), tmp_path / "s.npz")
    whole = (tmp_path / "s.npz").read_bytes()

    def full(*args, **kwargs):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("mcloc.storage.os.fsync", full)
    with pytest.raises(McLocError, match="No space left"):
        save(world.localizer(seed=5), tmp_path / "s.npz")
    assert (tmp_path / "s.npz").read_bytes() == whole
    assert [p.name for p in tmp_path.iterdir()] == ["s.npz"]


def test_a_state_is_read_as_it_was_written(tmp_path):
    arrays = {"a": np.array([np.nan, -np.inf, 0.1]), "b": np.arange(6).reshape(2, 3)}
    write_state(tmp_path / "s.npz", {"version": 3, "x": [0.1, None, "π"]}, arrays)
    values, again = read_state(tmp_path / "s.npz", 3)
    assert values == {"version": 3, "x": [0.1, None, "π"]}
    assert {k: v.tobytes() for k, v in again.items()} == {k: v.tobytes() for k, v in arrays.items()}
