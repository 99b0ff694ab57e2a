"""Threads are a setting of the process: what a test changes is put back."""

from collections.abc import Callable, Iterator

import pytest

from mcloc.kernels import jit


@pytest.fixture
def set_threads() -> Iterator[Callable[[int], None]]:
    before = jit._threads
    yield jit.set_threads
    jit.set_threads(before)
