"""How every kernel is compiled, and how the work is shared among threads.

A kernel works on the half-open range [start, stop) of particles and releases the GIL; what it
computes for a particle depends on nothing but that particle, so the result is the same for any
split and any number of threads.
"""

import itertools
import os
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from typing import Any

import numba

from mcloc.errors import ConfigError

# Errors as NumPy has them, so arithmetic is IEEE: −inf and NaN mean what they say. A wrapper for
# callers in C would be compiled with everything that is part of it, once more.
_OPTIONS: Any = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}


_SOURCES = tuple(
    (path.name, path.stat().st_mtime, path.stat().st_size)
    for path in sorted(Path(__file__).parent.glob("*.py"))
)


def kernel(function: Callable[..., Any]) -> Any:
    """Decorator of a compiled function.

    What is compiled is kept beside the file, or where that cannot be written in the user's cache
    directory (NUMBA_CACHE_DIR names another); where there is none either, for this process alone.
    """
    compiled = numba.njit(**_OPTIONS)(function)
    with suppress(AttributeError, RuntimeError):  # it is not compiled at all; nowhere to write
        compiled.enable_caching()
        # Numba looks at the file of the kernel alone, not at those of the scalars in it.
        compiled._cache._cache_file._source_stamp = _SOURCES
    return compiled


scalar: Any = numba.njit(forceinline=True, **_OPTIONS)
"""Decorator of the equation of one particle, for the loop of a kernel.

It becomes part of that loop, which the compiler can then do for 8 particles at once: it does not
vectorise over a call, and by itself it inlines nothing as long as Philox (11.8 → 1.5 ns).
"""

fused: Any = numba.njit(forceinline=True, fastmath={"contract"}, **_OPTIONS)
"""As `scalar`, but products and sums may be rounded once instead of twice: for a loop over the
beams of one particle, which is the same loop whichever particles are done with it (5 % of the
field).
"""

SERIAL_BELOW = 500_000
"""Nanoseconds of work under which starting threads costs more than it saves, measured."""


def _default_threads() -> int:
    """MCLOC_NUM_THREADS, or as many as there are processors."""
    wanted = os.environ.get("MCLOC_NUM_THREADS", "")
    if wanted and not (wanted.isascii() and wanted.isdigit() and int(wanted) > 0):
        raise ConfigError(f"MCLOC_NUM_THREADS must be a whole number >= 1, got {wanted!r}")
    return int(wanted) if wanted else os.cpu_count() or 1


_threads = _default_threads()
_pool: ThreadPoolExecutor | None = None
_inside = threading.local()


def set_threads(n: int) -> None:
    """Use up to n threads from now on; results do not depend on it."""
    global _threads, _pool
    if _pool is not None and n != _threads:
        _pool.shutdown()
        _pool = None
    _threads = n


def share(run: Callable[[int, int], Any], n: int, work: float) -> None:
    """Call run(start, stop) over [0, n), on several threads if there is enough work for them.

    work: what it takes on one thread, about, in ns. What is shared may share in turn: that is then
    done by the thread that it falls to.
    """
    global _pool
    if _threads == 1 or work < SERIAL_BELOW or n < _threads or getattr(_inside, "share", False):
        run(0, n)
        return
    if _pool is None:
        _pool = ThreadPoolExecutor(_threads - 1, thread_name_prefix="mcloc")
    first, *others = itertools.pairwise([n * k // _threads for k in range(_threads + 1)])
    shared = [_pool.submit(_within, run, *part) for part in others]
    try:
        _within(run, *first)  # to wake a thread costs more than to go on in this one
    finally:
        for done in shared:
            done.result()


def _within(run: Callable[[int, int], Any], start: int, stop: int) -> None:
    _inside.share = True
    try:
        run(start, stop)
    finally:
        _inside.share = False
