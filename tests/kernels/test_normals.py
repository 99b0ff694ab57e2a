"""Normals against Box–Muller in double precision; their log, sin and cos against NumPy's."""

import numpy as np
import pytest

from mcloc.kernels.normals import TOGETHER, fill_normal, log, normal_pair, sincos_of_turns
from mcloc.kernels.philox import fill_words

COUNTER = (7, 2, 5, 1, np.uint64(99))  # first particle, stream, step, part, key


def box_muller(words):
    """(4, n): normals in double precision, from the upper 31 bits of each word (4, n)."""
    top = (words >> np.uint32(1)).astype(float)
    radius = np.sqrt(-2.0 * np.log((top[::2] + 0.5) / 2**31))
    angle = 2.0 * np.pi * top[1::2] / 2**31
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1).reshape(4, -1)


def drawn(n):
    """Normals (4, n), and the words (4, n) that they are made of."""
    normals, words = np.empty((4, n)), np.empty((4, n), dtype=np.uint32)
    fill_normal(normals, *COUNTER, 0, n)
    fill_words(words, *COUNTER, 0, n)
    return normals, words


def test_they_are_box_muller():
    normals, words = drawn(3 * TOGETHER + 7)
    # The angle is rounded to 2⁻²⁴ turns, the radius to some 10⁻⁷ of it.
    assert np.abs(normals - box_muller(words)).max() < 6.7 * 2.0 * np.pi * 2.0**-24


def test_the_first_and_the_last_words():
    """0 and 2³² − 1 for the radius and for the angle: the largest normals, and the least."""
    words = np.array([[0, 0, 2**32 - 1], [0, 2**32 - 1, 12345]], dtype=np.uint32)
    radius = np.hypot(*np.array([normal_pair(*pair) for pair in words.T], dtype=float).T)
    expected = np.sqrt(-2.0 * np.log((words[0] // 2 + 0.5) / 2**31))
    assert radius == pytest.approx(expected, abs=4e-4)  # √(2 · 2⁻²⁴): 1 is the next to the last


def test_the_logarithm_in_single_precision():
    x = np.concatenate([np.linspace(1e-3, 1.0, 4001), 2.0 ** -np.arange(33.0)]).astype(np.float32)
    found = np.array([log(v) for v in x], dtype=float)
    expected = np.log(x.astype(float))
    assert np.abs(found - expected).max() <= 1.2e-7 * np.abs(expected).max()
    assert found[x == 1.0].tolist() == [0.0] * 2


def test_sines_of_turns_in_single_precision():
    t = np.linspace(0.0, 1.0, 4001).astype(np.float32)
    sin, cos = np.array([sincos_of_turns(v) for v in t], dtype=float).T
    angle = 2.0 * np.pi * t.astype(float)
    assert np.abs(sin - np.sin(angle)).max() < 2.0**-23
    assert np.abs(cos - np.cos(angle)).max() < 2.0**-23


def test_any_split_gives_the_same_bits():
    n = 2 * TOGETHER + 50
    whole, split = np.empty((4, n)), np.empty((4, n))
    fill_normal(whole, *COUNTER, 0, n)
    for start, stop in ((0, 1), (1, 300), (300, n)):
        fill_normal(split, *COUNTER, start, stop)
    assert np.array_equal(whole, split)
