"""Philox4x32-10 against the known answers that its authors publish with Random123 (in its file
kat_vectors, at "philox4x32 10"); words in columns.
"""

import numpy as np
import pytest

from mcloc.kernels.philox import fill_words, philox

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


def test_filling_puts_the_words_of_a_counter_in_its_column():
    first, stream, step, part, key = 7, 2, 5, 1, np.uint64(99)
    words = np.zeros((4, 25), dtype=np.uint32)
    fill_words(words, first, stream, step, part, key, 3, 23)
    for i in range(3, 23):
        drawn = philox(first + i, stream, step, part, key)
        assert words[:, i].tolist() == [int(word) for word in drawn]
    assert not words[:, [0, 1, 2, 23, 24]].any()
