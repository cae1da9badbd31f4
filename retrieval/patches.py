"""Frames as small upright images of one size, and the gradients that descriptors share."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from contracts.records import Frames
from retrieval.kernels import kernel
from retrieval.pyramid import Pyramid
from retrieval.selection import mean_radius

PATCH_SIDE = 41
MAGNIFICATION = 3.0
"""A patch spans the frame's region times this (Mikolajczyk et al. 2005)."""

_HALF = PATCH_SIDE // 2
_BLOCK = 96
_ANTIALIAS = 1.0
"""Blur wanted before sampling, in sampling steps."""


def cut_patches(
    pyramid: Pyramid, frames: Frames
) -> Iterator[tuple[NDArray[np.intp], NDArray[np.float32]]]:
    """Sample one patch per frame from the level whose blur suits its size, in small blocks.

    Pixel (20 + i, 20 + j) of a patch shows the photo at xy + shape @ (j, i) * 3 / 20. The level
    is the most blurred one that does not exceed one sampling step (that of the frame's mean
    radius). Beyond the photo its border pixels repeat.

    Yields
    ------
    rows (m,) intp of `frames`, each once in all, in no particular order; their patches
    (m, 41, 41) float32, rows first. A block stays in a core's cache while it is described.
    """
    levels = pyramid.sampling_levels()
    wanted = _ANTIALIAS * MAGNIFICATION / _HALF * mean_radius(frames.shape)
    sigmas = np.array([level.sigma for level in levels], np.float32)
    chosen = np.maximum(np.searchsorted(sigmas, wanted, side="right") - 1, 0)
    for i in np.unique(chosen):
        of_level = np.flatnonzero(chosen == i)
        step = np.float32(levels[i].step)
        for rows in np.array_split(of_level, -(-len(of_level) // _BLOCK)):
            xy, shape = frames.xy[rows] / step, frames.shape[rows] / step
            yield rows, sample_patches(levels[i].pixels, xy, shape)


@kernel
def sample_patches(
    pixels: NDArray[np.float32], xy: NDArray[np.float32], shape: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Sample frames bilinearly.

    Parameters
    ----------
    pixels : (h, w) float32. xy (m, 2), shape (m, 2, 2) : float32, pixels of this level.

    Returns
    -------
    (m, 41, 41) float32.
    """
    patches = np.empty((len(xy), PATCH_SIDE, PATCH_SIDE), np.float32)
    height, width = pixels.shape
    flat = pixels.reshape(height * width)
    unit, zero = np.float32(MAGNIFICATION / _HALF), np.float32(0.0)
    right, bottom = np.float32(width - 1), np.float32(height - 1)
    # Unsigned positions need no look at their sign: half the time. The last column and row are
    # reached as the far end of the step before them.
    last_left, last_top = np.int32(max(width - 2, 0)), np.int32(max(height - 2, 0))
    beside, below = np.uint32(min(width - 1, 1)), np.uint32(width if height > 1 else 0)
    for i in range(len(xy)):
        across_x, across_y = shape[i, 0, 0] * unit, shape[i, 1, 0] * unit
        down_x, down_y = shape[i, 0, 1] * unit, shape[i, 1, 1] * unit
        for row in range(PATCH_SIDE):
            v = np.float32(row - _HALF)
            from_x, from_y = xy[i, 0] + down_x * v, xy[i, 1] + down_y * v
            line = patches[i, row]
            for column in range(PATCH_SIDE):
                u = np.float32(column - _HALF)
                x = min(max(from_x + across_x * u, zero), right)
                y = min(max(from_y + across_y * u, zero), bottom)
                left, top = min(np.int32(x), last_left), min(np.int32(y), last_top)
                fx, fy = x - np.float32(left), y - np.float32(top)
                at = np.uint32(top * np.int32(width) + left)
                upper = flat[at] + fx * (flat[at + beside] - flat[at])
                at += below
                lower = flat[at] + fx * (flat[at + beside] - flat[at])
                line[column] = upper + fy * (lower - upper)
    return patches


@kernel
def patch_gradients(
    patches: NDArray[np.float32],
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Gradients by central differences, zero on the patch's border.

    Parameters
    ----------
    patches : (n, 41, 41) float32.

    Returns
    -------
    magnitude, angle : (n, 41, 41) float32; the angle is in turns, 0 <= angle < 1, from +x to +y.
    """
    magnitude = np.zeros(patches.shape, np.float32)
    angle = np.zeros(patches.shape, np.float32)
    half = np.float32(0.5)
    for i in range(len(patches)):
        patch = patches[i]
        for row in range(1, PATCH_SIDE - 1):
            for column in range(1, PATCH_SIDE - 1):
                gx = half * (patch[row, column + 1] - patch[row, column - 1])
                gy = half * (patch[row + 1, column] - patch[row - 1, column])
                magnitude[i, row, column] = np.sqrt(gx * gx + gy * gy)
                angle[i, row, column] = turns(gx, gy)
    return magnitude, angle


@kernel
def turns(x: np.float32, y: np.float32) -> np.float32:
    """Angle of (x, y) in turns, in [0, 1); 0 for the zero vector.

    A polynomial (error below 1e-5 radian), as the library's arctangent is several times slower
    and may differ between platforms.
    """
    ax, ay = abs(x), abs(y)
    largest = max(ax, ay)
    if largest == np.float32(0.0):
        return np.float32(0.0)
    t = min(ax, ay) / largest
    s = t * t
    angle = np.float32(-0.01172120) * s + np.float32(0.05265332)
    angle = angle * s - np.float32(0.11643287)
    angle = angle * s + np.float32(0.19354346)
    angle = angle * s - np.float32(0.33262347)
    angle = (angle * s + np.float32(0.99997726)) * t * np.float32(0.15915494)
    if ay > ax:
        angle = np.float32(0.25) - angle
    if x < np.float32(0.0):
        angle = np.float32(0.5) - angle
    if y < np.float32(0.0):
        angle = np.float32(1.0) - angle
    return angle if angle < np.float32(1.0) else np.float32(0.0)
