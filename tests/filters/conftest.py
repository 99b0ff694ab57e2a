"""How fast errors fall with the number of particles."""

from collections.abc import Callable, Iterator, Sequence

import numpy as np
import pytest
from numpy.typing import NDArray

from mcloc.kernels import jit


def _fit(
    sizes: Sequence[float], squared_errors: Sequence[NDArray[np.float64]]
) -> tuple[float, float]:
    """Slope of log RMS over log N by least squares, and its standard error.

    squared_errors: those of independent repeats, for each size. The log of the root of their mean
    has, to first order, deviation ½ · std / (mean · √repeats); the slope is a weighted sum.
    """
    logs = np.log(sizes)
    rms = np.array([0.5 * np.log(e.mean()) for e in squared_errors])
    deviation = np.array([0.5 * e.std() / (e.mean() * np.sqrt(len(e))) for e in squared_errors])
    weights = (logs - logs.mean()) / np.sum((logs - logs.mean()) ** 2)
    return float(weights @ rms), float(np.sqrt(weights**2 @ deviation**2))


@pytest.fixture
def fitted_slope() -> Callable[..., tuple[float, float]]:
    """The fit itself, where −½ is not what is expected."""
    return _fit


@pytest.fixture
def falls_as_root_n() -> Callable[[Sequence[float], Sequence[NDArray[np.float64]]], None]:
    """Asserts that the fitted slope is −½ within 3.5 of its standard errors.

    These must be small enough to tell −½ from 0 and −1. A right filter fails for 1 of 2000 seeds.
    """

    def check(sizes: Sequence[float], squared_errors: Sequence[NDArray[np.float64]]) -> None:
        slope, error = _fit(sizes, squared_errors)
        assert error < 0.03
        assert slope == pytest.approx(-0.5, abs=3.5 * error)

    return check


@pytest.fixture
def set_threads() -> Iterator[Callable[[int], None]]:
    """Sets the number of threads for one test."""
    before = jit._threads
    yield jit.set_threads
    jit.set_threads(before)
