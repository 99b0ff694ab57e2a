"""Chains of frames against SciPy's rotations."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from mcloc.io.frames import Frames, frame_name, planar, tilt, transform, upside_down

numbers = st.floats(-100.0, 100.0)
vectors = st.tuples(numbers, numbers, numbers)
quaternions = st.tuples(numbers, numbers, numbers, numbers).filter(
    lambda q: np.linalg.norm(q) > 1e-3
)
EAST = transform((1.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))


def oracle(translation, quaternion):
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_quat(quaternion).as_matrix()
    matrix[:3, 3] = translation
    return matrix


@given(vectors, quaternions)
def test_a_transform_is_scipys(translation, quaternion):
    np.testing.assert_allclose(
        transform(translation, quaternion), oracle(translation, quaternion), atol=1e-9
    )


@pytest.mark.parametrize(
    ("translation", "quaternion"),
    [
        ((0, 0, 0), (0, 0, 0, 0)),
        ((0, 0, 0), (0, 0, np.nan, 1)),
        ((0, 0, 0), (0, 0, np.inf, 1)),
        ((0, np.nan, 0), (0, 0, 0, 1)),
    ],
)
def test_what_is_no_transform_is_nan(translation, quaternion):
    assert np.isnan(transform(translation, quaternion)).all()


@given(st.lists(st.tuples(vectors, quaternions), min_size=2, max_size=5), st.data())
def test_the_way_between_two_frames_goes_over_their_common_ancestor(edges, data):
    frames, poses = Frames(), {"0": np.eye(4)}
    for i, (translation, quaternion) in enumerate(edges, 1):
        parent = str(data.draw(st.integers(0, i - 1)))
        assert frames.add(parent, str(i), transform(translation, quaternion))
        poses[str(i)] = poses[parent] @ oracle(translation, quaternion)
    a, b = (data.draw(st.sampled_from(sorted(poses))) for _ in range(2))
    expected = np.linalg.inv(poses[a]) @ poses[b]
    np.testing.assert_allclose(frames.find(a, b), expected, atol=1e-6)


def test_frames_of_two_trees_are_not_joined():
    frames = Frames()
    frames.add("base", "laser", EAST)
    frames.add("map", "odom", EAST)
    assert frames.find("odom", "laser") is None
    assert frames.find("nowhere", "laser") is None
    assert np.array_equal(frames.find("nowhere", "nowhere"), np.eye(4))


def test_a_loop_ends():
    frames = Frames()
    for parent, child in [("a", "b"), ("b", "c"), ("c", "a"), ("self", "self")]:
        frames.add(parent, child, EAST)
    assert frames.find("elsewhere", "c") is None
    assert frames.find("self", "a") is None
    assert planar(frames.find("a", "b")) == pytest.approx([1.0, 0.0, 0.0])


def test_the_first_transform_to_a_frame_stays_and_none_that_is_nan_is_taken():
    frames = Frames()
    assert not frames.add("base", "laser", transform((0, 0, 0), (0, 0, 0, 0)))
    assert frames.add("base", "laser", EAST)
    assert not frames.add("base", "laser", np.eye(4))
    assert planar(frames.find("base", "laser")) == pytest.approx([1.0, 0.0, 0.0])


def test_a_chain_that_overflows_is_none():
    frames = Frames()
    huge = transform((1e308, 0, 0), (0, 0, 0, 1))
    for parent, child in ["ab", "bc"]:
        frames.add(parent, child, huge)
    assert frames.find("a", "c") is None
    assert frames.find("c", "a") is None


@given(st.floats(-np.pi, np.pi), st.floats(0.0, np.pi), st.floats(-np.pi, np.pi))
def test_how_it_leans(heading, lean, towards):
    """Leaned about a horizontal axis, the z axis is `lean` off the vertical."""
    axis = np.array([np.cos(towards), np.sin(towards), 0.0])
    turned = Rotation.from_rotvec(lean * axis) * Rotation.from_euler("z", heading)
    matrix = transform((0, 0, 0), turned.as_quat())
    assert tilt(matrix) == pytest.approx(min(lean, np.pi - lean), abs=1e-7)
    if abs(lean - np.pi / 2) > 1e-6:
        assert upside_down(matrix) == (lean > np.pi / 2)
    if lean == 0.0:
        assert np.cos(planar(matrix)[2] - heading) == pytest.approx(1.0)


def test_names_of_the_first_tf_lose_their_slash():
    assert frame_name("/base_link") == frame_name("base_link") == "base_link"
    assert frame_name("/robot/base") == "robot/base"
    assert frame_name("") == ""
