"""Σ_i β_i N(x; μ_i, σ²) N(θ; ϑ_i, σ_θ²), each cut off at some deviations: the density of a Gaussian
mixture over poses, of which only those components are looked at that are near.
"""

import numpy as np

from mcloc.kernels.elementary import exp, wrapped
from mcloc.kernels.jit import kernel


@kernel
def mixture_density(  # type: ignore[no-untyped-def]
    states, rows, starts, first_row, means, weights, deviations, limits, out, start, stop
):
    """out (N,): the sum of weights · exp(−½ d²) over the components that are near each state.

    states: (3, N). means: (3, M), weights: (M,), in the order of their rows, and along each row of
    their x; a row is a stripe limits[0] deviations wide across y. rows: (R,) the number of each row
    that has some, sorted; starts: (R + 1,) the first component of each. first_row: y of row 0, m.
    deviations: m and rad. limits: deviations from the mean, in the plane and in heading, from which
    on there is nothing.
    """
    sigma, turn = deviations[0], deviations[1]
    reach, most = limits[0] * sigma, limits[0] * limits[0]
    x_of, y_of, heading_of = means[0], means[1], means[2]
    for i in range(start, stop):
        x, y, theta = states[0, i], states[1, i], states[2, i]
        row = np.floor((y - first_row) / reach)
        k, total = np.searchsorted(rows, row - 1.0), 0.0
        while k < len(rows) and rows[k] <= row + 1.0:
            begin, end = starts[k], starts[k + 1]
            j = begin + np.searchsorted(x_of[begin:end], x - reach)
            while j < end and x_of[j] <= x + reach:
                dx, dy = (x - x_of[j]) / sigma, (y - y_of[j]) / sigma
                off = wrapped(theta - heading_of[j]) / turn
                square = dx * dx + dy * dy
                if square <= most and abs(off) <= limits[1]:
                    total += weights[j] * exp(-0.5 * (square + off * off))
                j += 1
            k += 1
        out[i] = total
