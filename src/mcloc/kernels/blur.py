"""p(x') = Σ_taps w p(x' − tap): a grid of poses blurred, in blocks of 8 × 8 cells.

Cells: (K, H, W) float32 for K slices of headings; H and W are multiples of SIDE, and opposite sides
meet. Active: (K, H / SIDE, W / SIDE), of each block. Taps: slices, rows, columns (K, T), for each
slice the heading that mass comes from and by how many cells it has moved; weights (K, T) float32,
those of 0 last.
"""

import numpy as np

from mcloc.kernels.jit import kernel

SIDE = 8  # cells of a block: what a vector of float32 holds on AVX2


@kernel
def scale(cells, factor, plus, totals, start, stop):  # type: ignore[no-untyped-def]
    """cells ← factor · cells + plus, of the slices from start to stop. totals: (K, H), what each
    row adds up to then.
    """
    sums = np.empty(SIDE)
    for k in range(start, stop):
        for i in range(cells.shape[1]):
            row = cells[k, i]
            sums[:] = 0.0
            for b in range(len(row) // SIDE):
                for c in range(SIDE):
                    cell = factor * row[b * SIDE + c] + plus
                    row[b * SIDE + c] = cell
                    sums[c] += cell
            totals[k, i] = sums.sum()


@kernel
def mark_active(cells, least, active, start, stop):  # type: ignore[no-untyped-def]
    """active: which blocks have a cell above `least`, of the slices from start to stop."""
    for k in range(start, stop):
        for i in range(cells.shape[1]):
            row, of_row = cells[k, i], active[k, i // SIDE]
            for b in range(len(of_row)):
                above = False
                for c in range(SIDE):
                    above |= row[b * SIDE + c] > least
                of_row[b] |= above


@kernel
def mark_reached(blocks, starts, slices, rows, columns, weights, reached, start, stop):  # type: ignore[no-untyped-def]
    """reached: also the blocks that something comes to from active ones. Those are blocks (3, n),
    slice, row and column, of each slice from starts (K + 1,) on.
    """
    _, down, across = reached.shape
    for k in range(start, stop):
        for tap in range(weights.shape[1]):
            if weights[k, tap] == np.float32(0.0):
                break
            row, column = rows[k, tap] // SIDE, columns[k, tap] // SIDE
            until_row = row + (1 if rows[k, tap] % SIDE else 0)
            until_column = column + (1 if columns[k, tap] % SIDE else 0)
            source = slices[k, tap]
            for b in range(starts[source], starts[source + 1]):
                for r in range(row, until_row + 1):
                    for c in range(column, until_column + 1):
                        reached[k, (blocks[1, b] + r) % down, (blocks[2, b] + c) % across] = True


@kernel
def gather(cells, out, active, blocks, slices, rows, columns, weights, start, stop):  # type: ignore[no-untyped-def]
    """out: (n, SIDE, SIDE), for each of the blocks (3, n), heading, row and column, what comes to
    its cells from the active ones, beside what is there where the block itself is passive.
    """
    _, height, width = cells.shape
    for b in range(start, stop):
        k, i, j = blocks[0, b], blocks[1, b], blocks[2, b]
        target = out[b]
        if active[k, i, j]:
            target[:] = np.float32(0.0)
        else:
            target[:] = cells[k, i * SIDE : (i + 1) * SIDE, j * SIDE : (j + 1) * SIDE]
        for tap in range(weights.shape[1]):
            weight = weights[k, tap]
            if weight == np.float32(0.0):
                break
            source, send = cells[slices[k, tap]], active[slices[k, tap]]
            first = (j * SIDE - columns[k, tap]) % width
            until = SIDE - first % SIDE
            second = (first + until) % width
            for r in range(SIDE):
                row = (i * SIDE + r - rows[k, tap]) % height
                if send[row // SIDE, first // SIDE]:
                    for c in range(until):
                        target[r, c] += weight * source[row, first + c]
                if until < SIDE and send[row // SIDE, second // SIDE]:
                    for c in range(SIDE - until):
                        target[r, until + c] += weight * source[row, second + c]


@kernel
def put(out, blocks, least, cells, active, start, stop):  # type: ignore[no-untyped-def]
    """cells: in each of the blocks (3, n), what `gather` found; active: whether a cell of it is
    above `least`.
    """
    for b in range(start, stop):
        k, i, j = blocks[0, b], blocks[1, b], blocks[2, b]
        above = False
        for r in range(SIDE):
            row = cells[k, i * SIDE + r]
            for c in range(SIDE):
                row[j * SIDE + c] = out[b, r, c]
                above |= out[b, r, c] > least
        active[k, i, j] = above
