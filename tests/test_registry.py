"""Parameters: checked when a part is built, listed and set by name."""

import math
from dataclasses import dataclass

import pytest

from mcloc.errors import ConfigError
from mcloc.registry import Configurable, Registry, param, parameters, suggest


@dataclass(frozen=True)
class Gadget(Configurable):
    bound: object
    sigma: float = param(0.5, "m", "a deviation", above=0)
    share: float = param(0.1, "", "a share", low=0, high=1)
    count: int = param(3, "", "a number", low=1)
    mode: str = param("slow", "", "how", choices=("slow", "fast"))
    on: bool = param(True, "", "whether")


GADGETS = Registry("gadget", {"gadget": Gadget})


def test_parameters_are_the_fields_made_with_param():
    assert [f.name for f in parameters(Gadget)] == ["sigma", "share", "count", "mode", "on"]
    made = GADGETS.make("gadget", "the map", sigma=2, mode="fast")
    made_with = {f.name: getattr(made, f.name) for f in parameters(made)}
    assert made_with == {"sigma": 2.0, "share": 0.1, "count": 3, "mode": "fast", "on": True}
    assert made.bound == "the map"


def test_values_take_the_type_of_the_default():
    made = Gadget(None, sigma=2, count=4.0)
    assert isinstance(made.sigma, float)
    assert isinstance(made.count, int)


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ({"sigma": 0.0}, r"gadget\.sigma = 0\.0 m must be > 0"),
        ({"sigma": -1.0}, r"gadget\.sigma = -1\.0 m must be > 0"),
        ({"sigma": math.nan}, r"gadget\.sigma must be a number, got nan"),
        ({"sigma": math.inf}, r"gadget\.sigma must be a number, got inf"),
        ({"sigma": "wide"}, r"gadget\.sigma must be a number, got 'wide'"),
        ({"sigma": True}, r"gadget\.sigma must be a number, got True"),
        ({"sigma": None}, r"gadget\.sigma must be a number, got None"),
        ({"share": 1.5}, r"gadget\.share = 1\.5 must be >= 0 and <= 1"),
        ({"count": 2.5}, r"gadget\.count must be a whole number, got 2\.5"),
        ({"count": 0}, r"gadget\.count = 0 must be >= 1"),
        ({"mode": "sideways"}, r"gadget\.mode must be one of slow, fast, got 'sideways'"),
        ({"mode": 3}, r"gadget\.mode must be str, got 3"),
        ({"on": 1}, r"gadget\.on must be bool, got 1"),
    ],
)
def test_a_value_that_cannot_be_right_is_refused(setting, message):
    with pytest.raises(ConfigError, match=message):
        GADGETS.make("gadget", None, **setting)


def test_a_part_that_is_built_as_a_class_is_named_as_that():
    with pytest.raises(ConfigError, match=r"^Gadget\.count = 0 must be >= 1$"):
        Gadget(None, count=0)


def test_unknown_names_suggest_the_nearest():
    with pytest.raises(ConfigError, match=r"unknown gadget 'gadgt'; did you mean 'gadget'"):
        GADGETS.get("gadgt")
    with pytest.raises(ConfigError, match=r"no parameter 'sgma'; did you mean 'sigma'"):
        GADGETS.make("gadget", None, sgma=1.0)


def test_a_field_that_is_no_parameter_cannot_be_set():
    with pytest.raises(ConfigError, match="no parameter 'bound'"):
        GADGETS.make("gadget", bound=None)


def test_suggest():
    assert suggest("zzz", {"b": 1, "a": 2}) == "known: a, b"
    assert suggest("zzz", ()) == "known: it has none"


def test_registries_iterate_over_names():
    assert list(GADGETS) == ["gadget"]
