"""Draws(seed, step, part): every random number as a function of where it is used.

A number depends on (seed, step, part, stream, particle index) and on nothing else: not on threads,
not on the size of the chunks in which particles are drawn, not on what was drawn before.
"""

from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from mcloc.errors import ConfigError
from mcloc.kernels.jit import share
from mcloc.kernels.normals import fill_normal
from mcloc.kernels.philox import fill_words


class Stream(IntEnum):
    """What a number is for: within a step, no two uses share a number."""

    ANCESTOR = 0
    MOTION = 1
    CHOICE = 2
    RANDOM_POSE = 3
    TREE = 4
    PROPOSAL = 5


def check_seed(seed: int) -> None:
    """Raises ConfigError unless it is one."""
    if not 0 <= seed < 2**64:
        raise ConfigError(f"seed must be a whole number from 0 to 2^64 - 1, got {seed}")


@dataclass(frozen=True, slots=True)
class Draws:
    """The random numbers of one step of one part of a filter. seed: 0 … 2⁶⁴ − 1."""

    seed: int
    step: int = 0
    part: int = 0

    def __post_init__(self) -> None:
        check_seed(self.seed)

    def of_part(self, part: int) -> "Draws":
        """The numbers of another part of the same step."""
        return replace(self, part=part)

    def uniform(self, stream: Stream, first: int, n: int) -> NDArray[np.float64]:
        """(4, n): four uniforms in (0, 1) for each of the particles first … first + n − 1."""
        words = np.empty((4, n), dtype=np.uint32)
        self._fill(fill_words, words, stream, first)
        uniform = words.astype(np.float64)
        uniform += 0.5
        uniform *= 2.0**-32
        return uniform

    def normal(self, stream: Stream, first: int, n: int) -> NDArray[np.float64]:
        """(4, n): four standard normals for each of the particles first … first + n − 1."""
        normal = np.empty((4, n))
        self._fill(fill_normal, normal, stream, first)
        return normal

    def _fill(self, fill, out, stream: Stream, first: int) -> None:  # type: ignore[no-untyped-def]
        n = out.shape[1]
        counter = (first, int(stream), self.step, self.part, np.uint64(self.seed))
        share(lambda start, stop: fill(out, *counter, start, stop), n, 5.0 * n)
