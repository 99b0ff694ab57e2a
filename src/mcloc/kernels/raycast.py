"""The length of a ray up to the first wall, exactly  [Amanatides, Woo: A fast voxel traversal
algorithm for ray tracing, Eurographics 1987], with leaps through open space (kernels/cones).

In the axes of its octant a ray is y(k) = start + slope · k, 0 ≤ slope ≤ 1: at the border to column
k it enters the cell (k, ⌊y(k)⌋). That cell may end it, at this border; or, where the ray rises
before the next border, the cell above, at the height where it does so.

Some 256 rays go on in step, each loop over them being simple enough for the compiler to do 8 at
once; those that have ended are taken out when they are most of them. One ray after the other takes
three times as long (17 instead of 45 ns), since the processor cannot guess when each will end.
"""

import numpy as np

from mcloc.kernels.cones import (
    BESIDE_UNKNOWN,
    BESIDE_WALL,
    LARGEST_LEAP,
    UNKNOWN,
    WALL,
)
from mcloc.kernels.elementary import sincos
from mcloc.kernels.jit import kernel, scalar

_LANES = 256  # rays in step, a multiple of 4
_REALS = 7 * _LANES + 4
_WHOLES = 8 * _LANES + 4

# What is known of each ray lies in rows of one table: the compiler sees that they do not overlap.
# Of rays that still go on: y(k) = START + SLOPE k, and the k at which they are out of reach.
_START, _SLOPE, _END = 0, _LANES, 2 * _LANES
# Of all rays, by number: where they begin along the major and minor axis, length per cell of each.
_FROM_MAJOR, _FROM_MINOR, _PER_MAJOR, _PER_MINOR = range(3 * _LANES, 7 * _LANES, _LANES)
# Whole numbers of rays that go on: column and row, where their octant begins in the table, its
# cells per column, the cell they are in, what the table says there, whether they end, their number.
_K, _R, _OCTANT, _STRIDE, _CELL, _LEAP, _ENDED, _NUMBER = range(0, 8 * _LANES, _LANES)

_FEW = 3, 8  # rays are taken out when this share of them goes on


@kernel
def lengths(states, offset, directions, leaps, frame, limit, four, out, start, stop):  # type: ignore[no-untyped-def]
    """out (N · B,): length of every ray of every pose, in cells; inf where no wall is nearer than
    the limit, NaN where the ray leaves known space before.

    offset: x, y of the sensor on the robot, m. directions: (2, B) unit vectors in the robot's
    frame. leaps: from `leaps_of`. frame: height and width of the map with its ring, x, y of its
    corner in the map frame, m, cos and sin of its yaw, cells per m.
    """
    beams = directions.shape[1]
    reals, wholes = np.zeros(_REALS), np.zeros(_WHOLES, np.int32)
    i, b, done = start, 0, start * beams
    while i < stop and beams > 0:
        i, b, lanes = _aim(states, offset, directions, frame, limit, i, b, stop, reals, wholes)
        _cast(leaps, lanes, limit, four, reals, wholes, out[done : done + lanes])
        done += lanes


@kernel
def sum_over_rays(  # type: ignore[no-untyped-def]
    states, offset, directions, leaps, frame, limit, table, knots_per_cell, four, out, start, stop
):
    """out (N,): Σ over the rays of table[ray, length], linear between the knots.

    table: (B, K + 3) float32: at K lengths, knots 1 / knots_per_cell cells apart from 0 on and up
    to the limit or farther; then where no wall is nearer than the limit; then where the ray leaves
    known space; then 0. Everything else as for `lengths`.
    """
    beams, beyond = table.shape[0], table.shape[1] - 3
    reals, wholes = np.zeros(_REALS), np.zeros(_WHOLES, np.int32)
    length = np.empty(_LANES)
    out[start:stop] = 0.0
    i, b = start, 0
    while i < stop and beams > 0:
        pose, beam = i, b
        i, b, lanes = _aim(states, offset, directions, frame, limit, i, b, stop, reals, wholes)
        _cast(leaps, lanes, limit, four, reals, wholes, length)
        for lane in range(lanes):
            out[pose] += _at(table[beam], length[lane], knots_per_cell, beyond)
            beam += 1
            if beam == beams:
                pose, beam = pose + 1, 0


@scalar
def _at(values, length, knots_per_cell, beyond):  # type: ignore[no-untyped-def]
    """The row of a beam at a length, without a branch."""
    at = length * knots_per_cell
    found = at < np.inf  # not where it is NaN
    knot = min(np.int64(at), beyond - 2) if found else beyond
    knot = beyond + 1 if at != at else knot
    here, there = values[knot], values[knot + 1]
    between = at - knot if found else 0.0
    return here + between * (there - here)


@kernel
def _aim(states, offset, directions, frame, limit, i, b, stop, reals, wholes):  # type: ignore[no-untyped-def]
    """Rays from beam b of pose i on, as many as there are lanes. Returns where the next begin, and
    how many these are.
    """
    height, width, corner_x, corner_y, cos0, sin0, per_cell = frame
    beams = directions.shape[1]
    lanes = 0
    while lanes < _LANES and i < stop:
        s, c = sincos(states[2, i])
        dx = states[0, i] + c * offset[0] - s * offset[1] - corner_x
        dy = states[1, i] + s * offset[0] + c * offset[1] - corner_y
        x, y = (cos0 * dx + sin0 * dy) * per_cell, (cos0 * dy - sin0 * dx) * per_cell
        cos, sin = c * cos0 + s * sin0, s * cos0 - c * sin0
        n = min(_LANES - lanes, beams - b)
        # Sine and cosine of what is no angle of a robot, such as 1e300, are no direction.
        if 0.0 <= x < width and 0.0 <= y < height and 0.5 < cos * cos + sin * sin < 2.0:
            _aim_beams(x, y, cos, sin, directions, height, width, limit, b, n, lanes, reals, wholes)
        else:  # nothing is known there: rays of length 0
            _in_the_ring(lanes, lanes + n, wholes)
            reals[_FROM_MAJOR + lanes : _FROM_MAJOR + lanes + n] = 0.0
            reals[_PER_MAJOR + lanes : _PER_MAJOR + lanes + n] = 0.0
        lanes, b = lanes + n, b + n
        if b == beams:
            i, b = i + 1, 0
    for lane in range(lanes):
        wholes[_NUMBER + lane] = lane
    return i, b, lanes


@kernel
def _aim_beams(  # type: ignore[no-untyped-def]
    x0, y0, cos, sin, directions, height, width, limit, b, n, lane, reals, wholes
):
    """n rays from (x0, y0), in the axes of their octants."""
    along, across = directions[0, b : b + n], directions[1, b : b + n]
    reals, wholes = reals[lane:], wholes[lane:]
    cells, one = np.int32(height * width), np.int32(1)
    column0, row0 = np.int32(x0), np.int32(y0)
    height_, width_ = np.int32(height), np.int32(width)
    for j in range(n):
        dx, dy = cos * along[j] - sin * across[j], sin * along[j] + cos * across[j]
        left, down = dx < 0.0, dy < 0.0
        # The cell is that of the point, whatever the side that it is seen from.
        x, column = (width - x0 if left else x0), (width_ - one - column0 if left else column0)
        y, row = (height - y0 if down else y0), (height_ - one - row0 if down else row0)
        dx, dy = abs(dx), abs(dy)
        steep = dy > dx
        major, minor = (y if steep else x), (x if steep else y)
        d_major, d_minor = (dy if steep else dx), (dx if steep else dy)
        k, r = (row if steep else column), (column if steep else row)
        stride = width_ if steep else height_
        octant = np.int32(4 if down else 0) + np.int32(2 if left else 0) + np.int32(steep)
        slope = d_minor / d_major
        reals[_START + j], reals[_SLOPE + j] = minor - major * slope, slope
        reals[_END + j] = major + limit * d_major
        reals[_FROM_MAJOR + j], reals[_FROM_MINOR + j] = major, minor
        reals[_PER_MAJOR + j], reals[_PER_MINOR + j] = 1.0 / d_major, 1.0 / d_minor
        wholes[_K + j], wholes[_R + j] = k, r
        wholes[_OCTANT + j], wholes[_STRIDE + j] = octant * cells, stride
        wholes[_CELL + j] = octant * cells + k * stride + r


@kernel
def _in_the_ring(first, stop, wholes):  # type: ignore[no-untyped-def]
    """Lanes whose ray has ended: they are in the map's first cell, which is unknown."""
    for lane in range(first, stop):
        wholes[_K + lane], wholes[_R + lane] = 0, 0
        wholes[_OCTANT + lane], wholes[_STRIDE + lane], wholes[_CELL + lane] = 0, 0, 0


@kernel
def _cast(leaps, lanes, limit, four, reals, wholes, length):  # type: ignore[no-untyped-def]
    """length (≥ lanes,): of the rays that are aimed."""
    going = lanes
    few, of = _FEW
    while going > 0:
        padded = -(-going // 4) * 4
        _in_the_ring(going, padded, wholes)
        left = going
        while of * left > few * going:
            _look(leaps, wholes, np.uint64(padded), four)
            left = _leap(reals, wholes, going)
        going = _take_out(reals, wholes, going, limit, length)


@kernel
def _look(leaps, wholes, n, four):  # type: ignore[no-untyped-def]
    """What the table says at each cell; why `four` is an argument is told in kernels/field."""
    cell, leap = np.uint64(_CELL), np.uint64(_LEAP)
    one, two, three = np.uint64(1), np.uint64(2), np.uint64(3)
    j = np.uint64(0)
    while j < n:
        wholes[leap + j] = leaps[np.uint64(wholes[cell + j])]
        wholes[leap + j + one] = leaps[np.uint64(wholes[cell + j + one])]
        wholes[leap + j + two] = leaps[np.uint64(wholes[cell + j + two])]
        wholes[leap + j + three] = leaps[np.uint64(wholes[cell + j + three])]
        j += four


@kernel
def _leap(reals, wholes, n):  # type: ignore[no-untyped-def]
    """Each ray onwards, unless it ends. Returns how many go on."""
    going, one = np.int32(0), np.int32(1)
    for j in range(n):
        leap, k, r = wholes[_LEAP + j], wholes[_K + j], wholes[_R + j]
        open_ = (leap != WALL) & (leap <= LARGEST_LEAP)
        next_k = k + (leap if open_ else one)
        next_r = np.int32(reals[_START + j] + np.float64(next_k) * reals[_SLOPE + j])
        ended = (leap == WALL) | (leap == UNKNOWN) | ((leap >= BESIDE_WALL) & (next_r > r))
        ended = ended | (np.float64(next_k) > reals[_END + j])
        k, r = (k if ended else next_k), (r if ended else next_r)
        wholes[_K + j], wholes[_R + j] = k, r
        wholes[_CELL + j] = wholes[_OCTANT + j] + k * wholes[_STRIDE + j] + r
        wholes[_ENDED + j] = np.int32(ended)
        going += np.int32(0) if ended else one
    return going


@kernel
def _take_out(reals, wholes, n, limit, length):  # type: ignore[no-untyped-def]
    """Lengths of the rays that have ended; the others close ranks. Returns how many these are."""
    to = 0
    for j in range(n):
        if wholes[_ENDED + j]:
            ray, leap = wholes[_NUMBER + j], wholes[_LEAP + j]
            k, r = wholes[_K + j], wholes[_R + j]
            entered = max(k - reals[_FROM_MAJOR + ray], 0.0) * reals[_PER_MAJOR + ray]
            found, unseen = np.inf, leap == UNKNOWN
            if leap == WALL or unseen:  # at the border before it; at 0 where the sensor is inside
                found = entered
            elif leap >= BESIDE_WALL and r < np.int32(
                reals[_START + j] + (k + 1) * reals[_SLOPE + j]
            ):
                risen = (r + 1 - reals[_FROM_MINOR + ray]) * reals[_PER_MINOR + ray]
                # A ray along a border rises anywhere; rounding must not lead out of the column.
                found = min(max(risen, entered), entered + reals[_PER_MAJOR + ray])
                unseen = leap == BESIDE_UNKNOWN
            found = np.inf if found >= limit else found
            length[ray] = np.nan if unseen and found < np.inf else found
        else:
            for row in (_START, _SLOPE, _END):
                reals[row + to] = reals[row + j]
            for row in (_K, _R, _OCTANT, _STRIDE, _CELL, _NUMBER):
                wholes[row + to] = wholes[row + j]
            to += 1
    return to
