"""Sharing work among threads, and all kernels once more as plain Python."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from mcloc.draws import Draws, Stream
from mcloc.kernels import jit


@pytest.mark.parametrize("threads", [1, 2, 3])
@pytest.mark.parametrize("n", [0, 1, 2, 1001])
def test_every_particle_is_done_once(set_threads, threads, n):
    set_threads(threads)
    done = np.zeros(n, dtype=int)

    def run(start, stop):
        done[start:stop] += 1

    jit.share(run, n, 10 * jit.SERIAL_BELOW)
    assert (done == 1).all()


def test_an_error_in_a_thread_is_raised(set_threads):
    set_threads(2)

    def run(start, stop):
        raise ValueError(f"{start}")

    with pytest.raises(ValueError, match="0"):
        jit.share(run, 1000, 10 * jit.SERIAL_BELOW)


def test_numbers_do_not_depend_on_threads(set_threads):
    n = jit.SERIAL_BELOW  # 40 units of work each: enough for every thread
    results = []
    for threads in (1, 2, 3):
        set_threads(threads)
        results.append(Draws(1, 2, 3).normal(Stream.MOTION, 5, n))
    assert np.array_equal(results[0], results[1])
    assert np.array_equal(results[0], results[2])


@pytest.mark.skipif("NUMBA_DISABLE_JIT" in os.environ, reason="this is the run without the JIT")
def test_kernels_are_right_without_the_jit_too():
    """The same tests as plain Python, where NumPy warns of the overflow that a hash is made of."""
    here = Path(__file__).parent
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", str(here)]
    run = subprocess.run(
        [*command, "-W", "ignore:overflow encountered in scalar multiply:RuntimeWarning"],
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        cwd=here.parents[1],
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stdout[-3000:] + run.stderr[-1000:]
