"""How every kernel is compiled, and how the work is shared among threads.

A kernel works on the half-open range [start, stop) of particles and releases the GIL; what it
computes for a particle depends on nothing but that particle, so the result is the same for any
split and any number of threads.
"""

import itertools
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numba

from mcloc.errors import ConfigError

kernel: Any = numba.njit(cache=True, nogil=True, error_model="numpy")
"""Decorator of every compiled function; arithmetic is IEEE, so −inf and NaN mean what they say."""

SERIAL_BELOW = 100_000
"""Units of work (particle·beams or their like, ~1 ns each) under which starting threads costs more
than it saves."""


def _default_threads() -> int:
    """MCLOC_NUM_THREADS, or as many as there are processors."""
    wanted = os.environ.get("MCLOC_NUM_THREADS", "")
    if wanted and not (wanted.isascii() and wanted.isdigit() and int(wanted) > 0):
        raise ConfigError(f"MCLOC_NUM_THREADS must be a whole number >= 1, got {wanted!r}")
    return int(wanted) if wanted else os.cpu_count() or 1


_threads = _default_threads()
_pool: ThreadPoolExecutor | None = None


def set_threads(n: int) -> None:
    """Use up to n threads from now on; results do not depend on it."""
    global _threads, _pool
    if _pool is not None and n != _threads:
        _pool.shutdown()
        _pool = None
    _threads = n


def share(run: Callable[[int, int], Any], n: int, work: int) -> None:
    """Call run(start, stop) over [0, n), on several threads if there is enough work for them."""
    global _pool
    if _threads == 1 or work < SERIAL_BELOW or n < _threads:
        run(0, n)
        return
    if _pool is None:
        _pool = ThreadPoolExecutor(_threads, thread_name_prefix="mcloc")
    edges = [n * k // _threads for k in range(_threads + 1)]
    for done in [_pool.submit(run, a, b) for a, b in itertools.pairwise(edges)]:
        done.result()
