"""sin, cos, exp and the wrapping of angles against NumPy in extended precision, and the same bits
wherever in an array a number stands.
"""

import os

import numpy as np
import pytest

from mcloc.kernels.elementary import exp, sincos, wrapped
from mcloc.kernels.jit import scalar

EXTENDED = np.longdouble
AS_PYTHON = "NUMBA_DISABLE_JIT" in os.environ
MANY = 2_000 if AS_PYTHON else 100_000

# Compiled as kernels are, but kept in no cache: it would not notice a change of what is called.


@scalar
def sincos_of_all(x, sin, cos):
    for i in range(len(x)):
        sin[i], cos[i] = sincos(x[i])


@scalar
def exp_of_all(x, out):
    for i in range(len(x)):
        out[i] = exp(x[i])


@scalar
def wrapped_of_all(x, out):
    for i in range(len(x)):
        out[i] = wrapped(x[i])


def of_all(loop, x, outputs=1):
    """(outputs, n)"""
    out = np.full((outputs, len(x)), -7.0)
    with np.errstate(invalid="ignore"):  # as plain Python, of ∞ − ∞
        loop(x, *out)
    return out


def in_units(found, exactly):
    """Errors in units in the last place of the exact result."""
    return np.abs(found - exactly) / np.spacing(np.abs(exactly).astype(float))


@pytest.fixture(scope="module")
def angles():
    """Of all sizes and signs up to 10⁵, and the numbers next to multiples of π/4."""
    rng = np.random.default_rng(0)
    spread = [rng.uniform(-size, size, MANY) for size in (1.0, 4.0, 100.0, 1e5)]
    small = 10.0 ** rng.uniform(-300.0, 0.0, MANY) * rng.choice([-1.0, 1.0], MANY)
    multiples = np.unique(rng.integers(-127_000, 127_001, MANY)) * (np.pi / 4.0)
    beside = [np.nextafter(multiples, way) for way in (-np.inf, np.inf)]
    return np.concatenate([*spread, small, multiples, *beside, np.arange(-40, 41) * np.pi / 4.0])


def test_sines_to_two_units(angles):
    """And to what the two parts of π/2 leave of the angle itself, 10⁻²⁶ of it: to that a sine of
    nearly 0 is known, however large the angle.
    """
    sin, cos = of_all(sincos_of_all, angles, 2)
    lost = 1e-26 * np.abs(angles)
    for found, function in ((sin, np.sin), (cos, np.cos)):
        exactly = function(angles.astype(EXTENDED))
        unit = np.spacing(np.abs(exactly).astype(float))
        assert (np.abs(found - exactly) <= 2.0 * unit + lost).all()
        assert np.abs(found).max() <= 1.0


def test_sines_of_small_angles_to_two_units(angles):
    """Where nothing is lost of the angle: −π/2 … π/2, but for the last two bits of it."""
    small = angles[np.abs(angles) < np.pi / 2.0 - 1e-9]
    assert len(small) > 2 * MANY
    sin, cos = of_all(sincos_of_all, small, 2)
    assert in_units(sin, np.sin(small.astype(EXTENDED))).max() <= 2.0
    assert in_units(cos, np.cos(small.astype(EXTENDED))).max() <= 2.0


def test_sines_at_right_angles():
    quarters = np.array([0.0, 0.5, 1.0, 1.5, 2.0, -0.5, -1.0]) * np.pi
    sin, cos = of_all(sincos_of_all, quarters, 2)
    assert sin == pytest.approx([0.0, 1.0, 0.0, -1.0, 0.0, -1.0, 0.0], abs=3e-16)
    assert cos == pytest.approx([1.0, 0.0, -1.0, 0.0, 1.0, 0.0, -1.0], abs=3e-16)
    assert (sin[0], cos[0]) == (0.0, 1.0)


def test_no_angle_has_no_sine():
    assert np.isnan(of_all(sincos_of_all, np.array([np.nan, np.inf, -np.inf]), 2)).all()


def test_exponentials_to_two_units():
    """On all of −708 … 0, next to 0, and where k log 2 and (k + ½) log 2 part the reductions."""
    rng = np.random.default_rng(1)
    halves = np.arange(2042) * 0.5 * np.log(2.0)
    x = -np.concatenate(
        [
            rng.uniform(0.0, 708.0, MANY),
            10.0 ** rng.uniform(-320.0, 0.0, MANY),
            *(np.nextafter(halves, way) for way in (-1.0, 1000.0)),
            [0.0, 708.0],
        ]
    )
    x = x[(x <= 0.0) & (x >= -708.0)]
    (found,) = of_all(exp_of_all, x)
    assert in_units(found, np.exp(x.astype(EXTENDED))).max() <= 2.0
    assert (found > 0.0).all()
    assert (found <= 1.0).all()
    assert found[x == 0.0].tolist() == [1.0] * int((x == 0.0).sum())


def test_exponentials_end_at_0():
    x = np.array([-np.inf, -1e308, -746.0, np.nextafter(-708.0, -np.inf), -708.0])
    (found,) = of_all(exp_of_all, x)
    assert found[:4].tolist() == [0.0] * 4
    assert 3e-308 < found[4] < 4e-308


@pytest.mark.skipif(AS_PYTHON, reason="NumPy refuses to make NaN a whole number")
@pytest.mark.parametrize("n", [1, 8, 17])
def test_the_exponential_of_nan_is_nan(n):
    """Wherever it stands; its neighbours in a vector are none the worse."""
    for at in range(n):
        x = np.full(n, -1.0)
        x[at] = np.nan
        (found,) = of_all(exp_of_all, x)
        assert np.isnan(found[at])
        assert np.delete(found, at) == pytest.approx(np.exp(-1.0), rel=1e-15)


@pytest.fixture(scope="module")
def turned():
    """Angles up to 10¹² with the numbers on and next to the borders of every turn up to 1000."""
    rng = np.random.default_rng(2)
    spread = [rng.uniform(-size, size, MANY) for size in (np.pi, 10.0, 1e3, 1e5, 1e12)]
    borders = np.arange(-1999, 2000) * np.pi
    beside = [np.nextafter(borders, way) for way in (-np.inf, np.inf)]
    by_a_hair = [565973250397.1912]  # without its last turn, rounding takes it beyond π
    return np.concatenate([*spread, borders, *beside, by_a_hair])


def test_wrapped_angles_stay_in_the_circle(turned):
    (found,) = of_all(wrapped_of_all, turned)
    assert (found > -np.pi).all()
    assert (found <= np.pi).all()


def test_wrapped_angles_are_the_same_angles(turned):
    """To 2 units in the last place of the larger of the angle and π, modulo 2π."""
    (found,) = of_all(wrapped_of_all, turned)
    off = (found.astype(EXTENDED) - turned) / (2.0 * EXTENDED("3.14159265358979323846264"))
    off = np.abs(off - np.rint(off)) * 2.0 * np.pi
    assert (off <= 2.0 * np.spacing(np.maximum(np.abs(turned), np.pi))).all()


def test_an_angle_inside_stays_as_it_is():
    rng = np.random.default_rng(3)
    inside = np.append(rng.uniform(-np.pi, np.pi, 1000), [0.0, np.pi, 1e-300, -1e-300])
    assert np.array_equal(of_all(wrapped_of_all, inside)[0], inside)
    assert of_all(wrapped_of_all, np.array([-np.pi]))[0].tolist() == [np.pi]


def test_no_angle_is_wrapped_into_none():
    assert np.isnan(of_all(wrapped_of_all, np.array([np.nan, np.inf, -np.inf]))).all()


@pytest.mark.parametrize(
    ("loop", "outputs", "low"),
    [(sincos_of_all, 2, -1e4), (exp_of_all, 1, -720.0), (wrapped_of_all, 1, -1e4)],
    ids=["sincos", "exp", "wrapped"],
)
def test_the_same_bits_wherever_a_number_stands(loop, outputs, low):
    """In the vectors of a loop, in the rest that fills none, alone, and in memory that begins
    anywhere.
    """
    x = np.random.default_rng(4).uniform(low, 0.0, 80)
    alone = np.concatenate([of_all(loop, x[i : i + 1], outputs) for i in range(80)], axis=1)
    for n in range(1, 41):
        for first in (0, 1, 2, 3, 5, 7, 80 - n):
            part = slice(first, first + n)
            assert np.array_equal(of_all(loop, x[part], outputs), alone[:, part])
