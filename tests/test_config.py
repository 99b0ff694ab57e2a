"""A run's description: to YAML and back, complete, and strict about names."""

import math
import os
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mcloc.config import CHOICES, RunConfig, limited, merged, read_entries
from mcloc.errors import ConfigError, McLocError
from mcloc.localizer import Measured, Modelled, Offline
from mcloc.registry import parameters

NOT_UTF8 = os.fsdecode(b"floor-\xff")

finite = st.floats(allow_nan=False, allow_infinity=False)
poses = st.none() | st.tuples(finite, finite, finite)
on_robot = st.floats(-7.0, 7.0)
mounts = st.none() | st.tuples(on_robot, on_robot, finite)


@given(
    initial=poses,
    mount=mounts,
    start=st.none() | st.floats(-1e9, 0.0),
    seed=st.none() | st.integers(0, 2**64 - 1),
    path=st.text(st.characters(codec="utf-8", exclude_categories=["Cs", "Cc"]), min_size=1),
    sigma_hit=st.floats(1e-12, 1e12),
)
def test_yaml_and_back(tmp_path_factory, initial, mount, start, seed, path, sigma_hit):  # type: ignore[no-untyped-def]
    config = RunConfig(
        path,
        "log",
        initial=initial,
        mount=mount,
        start=start,
        seed=seed,
        pace="measured",
        settings={"sensor": {"sigma_hit": sigma_hit}, "pace": {"slowdown": sigma_hit}},
    )
    file = tmp_path_factory.mktemp("config") / "config.yaml"
    for written in (config, config.resolved()):
        file.write_text(written.to_yaml(), encoding="utf-8")
        assert RunConfig(**read_entries(file)) == written


def test_resolved_spells_everything_out() -> None:
    config = RunConfig("m", "l", settings={"motion": {"alpha1": 0.5}}).resolved()
    assert config.seed is not None
    assert config.settings["motion"]["alpha1"] == 0.5
    for kind, registry in CHOICES.items():
        known = {f.name for f in parameters(registry.get(getattr(config, kind)))}
        assert set(config.settings.get(kind, {})) == known
    assert config.resolved() == config


def test_text_becomes_what_the_parameter_is() -> None:
    config = RunConfig("m", "l", settings={"size": {"minimum": "1e3"}, "update": {"angle": "1"}})
    assert config.settings["size"]["minimum"] == 1000
    assert isinstance(config.settings["size"]["minimum"], int)
    assert config.policy.angle == 1.0
    assert isinstance(config.policy.angle, float)


def test_merging_keeps_what_is_not_overridden() -> None:
    entries = {"map": "m", "seed": 1, "settings": {"sensor": {"sigma_hit": 0.1, "z_rand": 0.2}}}
    over = {"seed": 2, "settings": {"sensor": {"z_rand": 0.3}}}
    assert merged(entries, over) == {
        "map": "m",
        "seed": 2,
        "settings": {"sensor": {"sigma_hit": 0.1, "z_rand": 0.3}},
    }


def test_topics_are_merged_by_role() -> None:
    entries = {"topics": {"scan": "/a", "map": "/map"}}
    assert merged(entries, {"topics": {"scan": ["/b", "/c"]}})["topics"] == {
        "scan": ["/b", "/c"],
        "map": "/map",
    }
    assert merged(entries, {"seed": 1})["topics"] == entries["topics"]


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"map": "m", "topics": {"maps": "/map"}}, "unknown role 'maps' of a topic; did you mean"),
        ({"map": "m", "topics": {"map": "/map"}}, "map is given twice, as a file and as a topic"),
        ({"map": None}, "which map"),
        ({"map": "m", "topics": {"odometry": ["/a", "/b"]}}, "only one topic can be the odometry"),
        ({"map": "m", "truth": "t", "topics": {"truth": "/t"}}, "truth is given twice"),
    ],
)
def test_topics_that_cannot_be(given, message) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(ConfigError, match=message):
        RunConfig(log="l", **given)


def test_an_exchanged_part_loses_its_settings() -> None:
    entries = {"size": "kld", "settings": {"size": {"epsilon": 0.1}}}
    assert merged(entries, {"size": "fixed"})["settings"] == {}
    assert merged(entries, {"size": "kld"})["settings"] == {"size": {"epsilon": 0.1}}


def test_an_exchanged_pace_loses_its_settings_too() -> None:
    entries = {"pace": "measured", "settings": {"pace": {"slowdown": 5.0}}}
    assert merged(entries, {"pace": "modelled"})["settings"] == {}
    assert merged(entries, {"pace": "measured"})["settings"] == entries["settings"]
    assert limited(entries, 10)["settings"]["pace"] == {"slowdown": 5.0}


def test_the_pace_of_the_replay() -> None:
    assert RunConfig("m", "l").replay_pace == Offline()
    slow = RunConfig("m", "l", pace="measured", settings={"pace": {"slowdown": "5"}})
    assert slow.replay_pace == Measured(slowdown=5.0)
    assert RunConfig("m", "l", pace="modelled").replay_pace == Modelled()
    assert "pace" not in RunConfig("m", "l").composition.settings
    assert "pace" not in slow.composition.settings


@pytest.mark.parametrize(
    ("size", "particles", "expected"),
    [
        ("fixed", 10, {"particles": 10}),
        ("kld", 10_000, {"maximum": 10_000}),
        ("kld", 1, {"maximum": 1, "minimum": 1}),
    ],
)
def test_limited(size: str, particles: int, expected: dict[str, int]) -> None:
    assert limited({"size": size}, particles)["settings"]["size"] == expected


def test_no_filter_has_more_particles_than_that_while_it_searches() -> None:
    assert limited({}, 300)["settings"]["filter"] == {"particles": 300}
    few, many = ({"settings": {"filter": {"particles": n}}} for n in (200, 30_000))
    assert limited(few, 300)["settings"]["filter"] == {"particles": 200}
    assert limited(many, 20_000)["settings"]["filter"] == {"particles": 20_000}
    assert limited({"size": "fixed"}, 20_000)["settings"]["filter"] == {"particles": 20_000}
    assert "filter" not in limited({}, 20_000)["settings"]
    assert "filter" not in limited({"filter": "mcl"}, 300)["settings"]


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"start": 2.0, "end": 1.0}, "start = 2 s must not lie after end = 1 s"),
        ({"start": math.nan}, "start must be a finite number of seconds, got nan"),
        ({"end": math.inf}, "end must be a finite number of seconds, got inf"),
        (
            {"mount": (1e300, 0.0, 0.0)},
            r"mount must be .* at most 10 m .* got \[1e\+300, 0\.0, 0\.0\]",
        ),
        ({"mount": (8.0, 8.0, 0.0)}, "mount must be a pose on the robot"),
        ({"mount": (0.0, math.nan, 0.0)}, "mount must be a pose on the robot"),
        ({"mount": (0.0, 0.0, math.inf)}, "mount must be a pose on the robot"),
        ({"mount": (0.0, 0.0)}, "mount must be a pose on the robot"),
        ({"map": NOT_UTF8}, r"map must be a name in UTF-8, got 'floor-\\udcff'; rename it"),
        ({"log": NOT_UTF8}, "log must be a name in UTF-8"),
        ({"truth": NOT_UTF8}, "truth must be a name in UTF-8"),
        ({"pace": "mesured"}, "unknown pace 'mesured'; did you mean 'measured'"),
        ({"settings": {"pace": {"slowdown": 5}}}, "pace 'offline' has no parameter 'slowdown'"),
        ({"truth": "a\0b"}, r"truth must be a name in UTF-8, got 'a\\x00b'"),
        (
            {"size": "recorded", "settings": {"size": {"file": NOT_UTF8}}},
            r"size\.file must be a name in UTF-8",
        ),
    ],
)
def test_what_cannot_be_is_named(given: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        RunConfig(**{"map": "m", "log": "l", **given})


def test_a_policy_that_cannot_be_is_named_as_it_is_set() -> None:
    config = RunConfig("m", "l", settings={"update": {"distance": -1.0}})
    with pytest.raises(ConfigError, match=r"^update\.distance = -1\.0 m must be >= 0$"):
        config.policy  # noqa: B018


@given(st.text() | st.binary().map(lambda raw: raw.decode("latin-1")))
def test_any_file_is_read_or_refused(tmp_path_factory, text):  # type: ignore[no-untyped-def]
    file: Path = tmp_path_factory.mktemp("fuzz") / "config.yaml"
    file.write_text(text, encoding="utf-8", errors="replace")
    with suppress(McLocError):
        RunConfig(**{"map": "m", "log": "l", **read_entries(file)})
