"""Local shape context: where the edges of a patch lie, and which way they run.

Belongie, Malik & Puzicha, PAMI 2002; this small form Mikolajczyk & Schmid, PAMI 2005.
"""

import numpy as np
from numpy.typing import NDArray

from retrieval.kernels import kernel
from retrieval.patches import PATCH_SIDE, turns

_SECTORS = 4
_LOCATIONS = 1 + 2 * _SECTORS
_ORIENTATIONS = 4
_HALF = PATCH_SIDE // 2
_RADII = (6.0 / 15.0, 11.0 / 15.0, 1.0)
"""Outer radii of the centre and the two rings, over the patch's half-width."""
_HIGH = 1.5
_LOW = 0.6
"""Canny's two thresholds over the patch's mean gradient magnitude."""
_SCALE = 512.0


@kernel
def describe_shape_context(
    magnitude: NDArray[np.float32], angle: NDArray[np.float32]
) -> NDArray[np.uint8]:
    """Shape context of patches: square root of the L1-normalised histogram, times 512, at most 255.

    Canny edge points vote with their gradient magnitude for one of 9 locations (0 the centre;
    1 + 4 ring + sector) and, linearly, for the two nearest of 4 edge orientations and of the 4
    sectors: entry 4 location + orientation.

    Parameters
    ----------
    magnitude, angle : (n, 41, 41) float32; angles in turns.

    Returns
    -------
    (n, 36) uint8; zero for a flat patch.
    """
    n = len(magnitude)
    out = np.zeros((n, _LOCATIONS * _ORIENTATIONS), np.uint8)
    ring, sector = _locations()
    edges = np.zeros((PATCH_SIDE, PATCH_SIDE), np.uint8)
    found = np.empty(PATCH_SIDE * PATCH_SIDE, np.int32)
    histogram = np.empty((_LOCATIONS, _ORIENTATIONS), np.float64)
    for i in range(n):
        n_found = find_edges(magnitude[i], angle[i], edges, found)
        histogram[:] = 0.0
        for at in found[:n_found]:
            row, column = at // PATCH_SIDE, at % PATCH_SIDE
            if ring[row, column] >= 0:
                _vote(
                    histogram,
                    float(magnitude[i, row, column]),
                    float(angle[i, row, column]),
                    ring[row, column],
                    sector[row, column],
                )
        _quantise(histogram, out[i])
    return out


@kernel
def _locations() -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Per pixel: ring (0 centre, -1 outside) and position among the sectors, 0 <= sector < 4."""
    ring = np.full((PATCH_SIDE, PATCH_SIDE), -1, np.int64)
    sector = np.zeros((PATCH_SIDE, PATCH_SIDE), np.float64)
    for row in range(PATCH_SIDE):
        for column in range(PATCH_SIDE):
            x, y = column - _HALF, row - _HALF
            radius = np.sqrt(x * x + y * y) / _HALF
            sector[row, column] = _SECTORS * turns(np.float32(x), np.float32(y))
            for k in range(3):
                if radius <= _RADII[k]:
                    ring[row, column] = k
                    break
    return ring, sector


@kernel
def find_edges(
    magnitude: NDArray[np.float32],
    angle: NDArray[np.float32],
    edges: NDArray[np.uint8],
    found: NDArray[np.int32],
) -> int:
    """Canny's edges of one patch; two pixels at its border have none.

    Thresholds follow the patch's mean gradient magnitude, so that faint patches have edges too.

    Parameters
    ----------
    magnitude, angle : (41, 41) float32.
    edges : (41, 41) uint8, written: 2 = edge, 1 = weak and unconnected, 0 = none; zero at its
    border of two pixels before and after.
    found : (1681,) int32, written: edge pixels, 41 row + column each.

    Returns
    -------
    How many edge pixels there are.
    """
    mean = _mean(magnitude)
    _thin(magnitude, angle, np.float32(_LOW) * mean, np.float32(_HIGH) * mean, edges)
    n_found = 0
    for row in range(2, PATCH_SIDE - 2):
        for column in range(2, PATCH_SIDE - 2):
            if edges[row, column] == 2:
                found[n_found] = row * PATCH_SIDE + column
                n_found += 1
    flat = edges.reshape(PATCH_SIDE * PATCH_SIDE)
    reached = 0
    while reached < n_found:
        at = found[reached]
        reached += 1
        for down in (-PATCH_SIDE, 0, PATCH_SIDE):
            for near in (at + down - 1, at + down, at + down + 1):
                if flat[np.uint32(near)] == 1:
                    flat[np.uint32(near)] = 2
                    found[n_found] = near
                    n_found += 1
    return n_found


@kernel
def _mean(magnitude: NDArray[np.float32]) -> np.float32:
    """Column by column first, which the compiler turns into vectors."""
    sums = np.zeros(PATCH_SIDE, np.float32)
    for row in range(PATCH_SIDE):
        for column in range(PATCH_SIDE):
            sums[column] += magnitude[row, column]
    total = np.float32(0.0)
    for column in range(PATCH_SIDE):
        total += sums[column]
    return total / np.float32(PATCH_SIDE * PATCH_SIDE)


@kernel
def _thin(
    magnitude: NDArray[np.float32],
    angle: NDArray[np.float32],
    low: np.float32,
    high: np.float32,
    edges: NDArray[np.uint8],
) -> None:
    """Keep what is not weaker than its neighbours across the edge; of two equals the second.

    All four directions are compared without a branch: then the loop becomes vectors, eight times
    as fast.
    """
    for row in range(2, PATCH_SIDE - 2):
        above, here, below = magnitude[row - 1], magnitude[row], magnitude[row + 1]
        for column in range(2, PATCH_SIDE - 2):
            octant = np.int32(np.float32(8.0) * angle[row, column] + np.float32(0.5)) & 3
            left, right = column - 1, column + 1
            value = here[column]
            tops = (
                ((octant == 0) & (value >= here[left]) & (value > here[right]))
                | ((octant == 1) & (value >= above[left]) & (value > below[right]))
                | ((octant == 2) & (value >= above[column]) & (value > below[column]))
                | ((octant == 3) & (value >= below[left]) & (value > above[right]))
            )
            weak = tops & (value > low)
            edges[row, column] = np.uint8(weak) + np.uint8(weak & (value > high))


@kernel
def _vote(
    histogram: NDArray[np.float64], weight: float, angle: float, ring: int, sector: float
) -> None:
    orientation = 2.0 * _ORIENTATIONS * angle
    low = int(orientation)
    part = orientation - low
    first, second = low % _ORIENTATIONS, (low + 1) % _ORIENTATIONS
    if ring == 0:
        histogram[0, first] += weight * (1.0 - part)
        histogram[0, second] += weight * part
        return
    begin = 1 + (ring - 1) * _SECTORS
    here = int(sector) % _SECTORS
    share = sector - int(sector)
    for location, vote in (
        (begin + here, weight * (1.0 - share)),
        (begin + (here + 1) % _SECTORS, weight * share),
    ):
        histogram[location, first] += vote * (1.0 - part)
        histogram[location, second] += vote * part


@kernel
def _quantise(histogram: NDArray[np.float64], out: NDArray[np.uint8]) -> None:
    total = histogram.sum()
    if total <= 0.0:
        return
    for location in range(_LOCATIONS):
        for k in range(_ORIENTATIONS):
            value = _SCALE * np.sqrt(histogram[location, k] / total)
            out[location * _ORIENTATIONS + k] = min(int(value + 0.5), 255)
