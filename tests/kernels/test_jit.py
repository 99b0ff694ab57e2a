"""Sharing work among threads, and all kernels once more as plain Python."""

import os
import subprocess
import sys
import threading
from pathlib import Path

import numba
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


NESTED = """
import threading
import numpy as np
from mcloc.kernels import jit

jit.set_threads({threads})
done, strangers = np.zeros((40, 60), dtype=int), []

def outer(start, stop):
    mine = threading.get_ident()

    def inner(a, b):
        done[i, a:b] += 1
        if {threads} > 1 and threading.get_ident() != mine:
            strangers.append(i)

    for i in range(start, stop):
        jit.share(inner, 60, 10 * jit.SERIAL_BELOW)

jit.share(outer, 40, 10 * jit.SERIAL_BELOW)
jit.share(outer, 40, 10 * jit.SERIAL_BELOW)
print((done == 2).all(), strangers)
"""


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_what_is_shared_may_share_in_turn(threads):
    """All of it once, each part by the thread that it falls to. In a process of its own, since
    threads that wait for each other would wait for ever.
    """
    run = subprocess.run(
        [sys.executable, "-c", NESTED.format(threads=threads)],
        capture_output=True,
        text=True,
        check=True,
        timeout=120,
    )
    assert run.stdout == "True []\n"


def test_what_is_shared_first_within_no_share_is_shared(set_threads):
    """A thread of the pool has shared before, and so has the one that asks, which does a part."""
    set_threads(2)
    for _ in range(2):
        threads = set()
        at_once = threading.Barrier(2)

        def run(start, stop, threads=threads, at_once=at_once):
            at_once.wait(timeout=60)
            threads.add(threading.get_ident())

        jit.share(run, 1000, 10 * jit.SERIAL_BELOW)
        assert len(threads) == 2
        assert threading.get_ident() in threads


def test_little_work_is_done_by_the_thread_that_asks(set_threads):
    set_threads(2)
    calls = []
    jit.share(lambda a, b: calls.append((a, b, threading.get_ident())), 1000, 1.0)
    assert calls == [(0, 1000, threading.get_ident())]


def test_numbers_do_not_depend_on_threads(monkeypatch, set_threads):
    monkeypatch.setattr(jit, "SERIAL_BELOW", 0)
    n, results = 5003, []
    for threads in (1, 2, 3):
        set_threads(threads)
        results.append(Draws(1, 2, 3).normal(Stream.MOTION, 5, n))
    assert np.array_equal(results[0], results[1])
    assert np.array_equal(results[0], results[2])


@pytest.mark.skipif("NUMBA_DISABLE_JIT" in os.environ, reason="this is the run without the JIT")
def test_kernels_are_right_without_the_jit_too():
    """The same tests as plain Python, where NumPy warns of the overflow that a hash is made of."""
    here = Path(__file__).parent
    compiling = f"--ignore={here / 'test_compiling.py'}"  # there is nothing to compile
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", str(here), compiling]
    run = subprocess.run(
        [*command, "-W", "ignore:overflow encountered in scalar multiply:RuntimeWarning"],
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        cwd=here.parents[1],
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stdout[-3000:] + run.stderr[-1000:]


def test_a_kernel_works_where_nothing_can_be_kept(monkeypatch):
    """Numba says so by an error when caching is asked for."""

    def refuse(self):
        raise RuntimeError("cannot cache function 'doubled': no locator available")

    def doubled(x):
        for i in range(len(x)):
            x[i] *= 2.0

    monkeypatch.setattr(numba.core.dispatcher.Dispatcher, "enable_caching", refuse)
    x = np.ones(3)
    jit.kernel(doubled)(x)
    assert x.tolist() == [2.0] * 3


ONE_RUN = """
import importlib, pkgutil
import numpy as np
import mcloc.kernels
from mcloc.events import Scan
from mcloc.localizer import Localizer
from mcloc.maps.occupancy import OccupancyGrid

grid = OccupancyGrid(np.pad(np.zeros((20, 20)), 2, constant_values=100), 0.1, np.zeros(3))
ranges, angles = np.full(9, 1.0), np.linspace(-1, 1, 9)
scans = [Scan(t, ranges, angles, 8.0, odometry=np.full(3, t)) for t in (0.0, 1.0)]
assert len(list(Localizer(grid, seed=1).run(scans))) == 2
for module in pkgutil.iter_modules(mcloc.kernels.__path__):
    for name, value in vars(importlib.import_module(f"mcloc.kernels.{module.name}")).items():
        if len(getattr(value, "signatures", ())) > 1:
            print(name, value.signatures)
"""


@pytest.mark.skipif("NUMBA_DISABLE_JIT" in os.environ, reason="nothing is compiled")
def test_every_kernel_is_compiled_once():
    """A second signature costs a second compilation of seconds at the first run."""
    run = subprocess.run(
        [sys.executable, "-c", ONE_RUN], capture_output=True, text=True, check=True
    )
    assert run.stdout == ""
