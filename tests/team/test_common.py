"""Fingerprints of what robots of a team should have in common."""

from dataclasses import replace

import numpy as np
import pytest

from mcloc.filters.catalog import Composition
from mcloc.localizer import Localizer
from mcloc.maps.landmarks import Landmarks, open_floor
from mcloc.maps.teammates import Teammates
from mcloc.registry import parameters
from mcloc.team.common import common_of
from mcloc.team.detection import DetectionModel
from mcloc.team.letters import Common

PLACES = np.array([[0.0, 0.0], [3.0, 0.0], [1.5, 1.5], [0.0, 3.0]])
MCL = Composition(filter="mcl", size="fixed", settings={"size": {"particles": 10}})


def robot(places=PLACES, landmarks=True, seed=1, **changed):
    aids = (Landmarks.numbered(places), Teammates()) if landmarks else (Teammates(),)
    localizer = Localizer(open_floor(places, 2.0, "a name"), MCL, aids=aids, seed=seed)
    return common_of(localizer, replace(DetectionModel(), **changed))


def test_what_is_the_same_differs_in_nothing():
    assert robot().differing(robot(seed=2)) == []
    assert 0 not in (robot().detection, robot().map, robot().landmarks)


def test_each_parameter_of_how_robots_see_each_other_matters():
    own = {"particles", "p_detect", "fov"}
    for f in parameters(DetectionModel()):
        value = f.default + 50 if f.name == "particles" else 0.5 * f.default + 0.1
        expected = [] if f.name in own else ["detection"]
        assert robot().differing(robot(**{f.name: value})) == expected


def test_maps_and_landmarks_that_differ_are_named():
    inner, outer = PLACES.copy(), PLACES.copy()
    inner[2] += 0.01
    outer[1] += 2.0
    assert robot().differing(robot(inner)) == ["landmarks"]
    assert robot().differing(robot(outer)) == ["map", "landmarks"]


@pytest.mark.parametrize("other", [Common(), robot(landmarks=False)])
def test_who_has_none_differs_in_nothing(other):
    assert robot().differing(other) == other.differing(robot()) == []
