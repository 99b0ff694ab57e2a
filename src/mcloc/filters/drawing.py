"""x^(i), w^(i), i = 1 … n, drawn and weighed: in chunks where n is found on the way, by several
threads where they are many.
"""

from threading import Lock

import numpy as np

from mcloc.kernels.jit import SERIAL_BELOW, share
from mcloc.protocols import Counter, Source, Weighed

BLOCK = 1 << 15  # particles that a thread takes through all stages at a time
LEAST_CHUNK = 2048  # drawn before it is looked at whether they are enough
WORK = 40.0  # ns that a particle takes, about


def draw(source: Source, counter: Counter, first: int | None, n: int | None) -> Weighed:
    """n weighted particles, or as many as the counter asks for where n is None.

    They are drawn in chunks, `first` of them to begin with, but where drawing stops depends on the
    particles alone, not on the chunks.
    """
    if n is not None:
        return _drawn(source, 0, n)
    drawn, chunks = 0, []
    while True:
        count = first or max(LEAST_CHUNK, drawn // 4)
        chunk = _drawn(source, drawn, count)
        enough = counter.enough(chunk.states, chunk.log_weights)
        chunks.append(chunk.first(enough))
        if enough is not None:
            break
        drawn += count
    return _joined(chunks)


def _drawn(source: Source, first: int, n: int) -> Weighed:
    """The particles first … first + n − 1, by several threads if they are many. Each thread takes
    as many at a time through all stages as its cache holds.
    """
    if n <= BLOCK and n * WORK < SERIAL_BELOW:
        return source(first, n)
    made: list[Weighed] = []
    lock = Lock()

    def run(start: int, stop: int) -> None:
        for at in range(start, stop, BLOCK):
            block = source(first + at, min(BLOCK, stop - at))
            with lock:
                if not made:  # only now it is known what a state is
                    states = np.empty((len(block.states), n))
                    made.append(Weighed(states, np.empty(n), np.empty(n)))
            for whole, part in zip(made[0], block, strict=True):
                whole[..., at : at + part.shape[-1]] = part

    share(run, n, WORK * n)
    return made[0]


def _joined(parts: list[Weighed]) -> Weighed:
    """One after the other."""
    if len(parts) == 1:
        return parts[0]
    return Weighed(
        np.concatenate([p.states for p in parts], axis=1),
        np.concatenate([p.log_before for p in parts]),
        np.concatenate([p.log_likelihoods for p in parts]),
    )
