"""The state spaces name each axis once."""

import pytest

from mcloc.statespace import LINE, PLANE, R3, SE2


@pytest.mark.parametrize("space", [SE2, R3, LINE, PLANE])
def test_every_axis_has_a_name_a_unit_and_a_kind(space):
    assert space.dimension == len(space.axes) == len(space.units) == len(space.circular)
    assert len(set(space.axes)) == space.dimension
    for unit, circular in zip(space.units, space.circular, strict=True):
        assert (unit == "rad") == circular


def test_only_the_heading_of_se2_is_circular():
    assert SE2.circular == (False, False, True)
    assert not any(R3.circular + LINE.circular + PLANE.circular)
