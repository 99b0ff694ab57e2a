"""Philox4x32-10 against the known answers of Random123; words to uniforms."""

import numpy as np
import pytest

from mcloc.kernels.philox import fill_uniform, fill_words, philox, unit

FULL = 0xFFFFFFFF


@pytest.mark.parametrize(
    ("counter", "key", "words"),
    [
        ((0, 0, 0, 0), (0, 0), (0x6627E8D5, 0xE169C58D, 0xBC57AC4C, 0x9B00DBD8)),
        ((FULL,) * 4, (FULL,) * 2, (0x408F276D, 0x41C83B0E, 0xA20BC7C6, 0x6D5451FD)),
        (
            (0x243F6A88, 0x85A308D3, 0x13198A2E, 0x03707344),
            (0xA4093822, 0x299F31D0),
            (0xD16CFE09, 0x94FDCCEB, 0x5001E420, 0x24126EA1),
        ),
    ],
)
def test_known_answers(counter, key, words):
    packed = np.uint64(key[0] | key[1] << 32)
    assert tuple(int(w) for w in philox(*counter, packed)) == words


def test_unit_stays_inside_the_open_interval():
    assert 0.0 < unit(np.uint64(0)) < 2.0**-32
    assert 1.0 - 2.0**-32 < unit(np.uint64(FULL)) < 1.0


def test_filling_puts_the_words_of_a_counter_in_its_column():
    first, stream, step, part, key = 7, 2, 5, 1, np.uint64(99)
    uniform, words = np.empty((4, 20)), np.empty((4, 20), dtype=np.uint32)
    fill_uniform(uniform, first, stream, step, part, key, 0, 20)
    fill_words(words, 20, first, stream, step, part, key)
    for i in range(20):
        drawn = philox(first + i, stream, step, part, key)
        assert uniform[:, i].tolist() == [unit(word) for word in drawn]
        assert words[:, i].tolist() == [int(word) for word in drawn]
