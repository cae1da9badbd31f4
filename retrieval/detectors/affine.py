"""Affine shape adaptation: make a region's second-moment matrix isotropic.

Baumberg, CVPR 2000; iteration and constants after Perdoch, Chum & Matas, CVPR 2009.
"""

import numpy as np
from numpy.typing import NDArray

from contracts.records import Frames
from retrieval.kernels import kernel
from retrieval.pyramid import BASE_SIGMA, Pyramid
from retrieval.selection import round_frames, take

_WINDOW = 19
_MAX_ROUNDS = 16
_CONVERGED = 0.05
_MAX_STRETCH = 6.0
_SHARPER = 2.0 / 3.0
"""Octaves from the level seen to the frame's scale: at its own, a shape is smoothed too round."""


def adapt_shapes(pyramid: Pyramid, frames: Frames, region_sigmas: float) -> Frames:
    """Replace round shapes by affine ones of the same area; drop frames that do not converge.

    Parameters
    ----------
    frames : round, radius = region_sigmas * detection scale.

    Returns
    -------
    The converged frames in the same order; shapes lower triangular, so that the image's vertical
    stays vertical in the patch (the gravity vector of Perdoch 2009).
    """
    if len(frames) == 0:
        return frames
    levels = [level for octave in pyramid.octaves for level in octave[:-2]]
    radius = frames.shape[:, 0, 0]
    sigmas = radius / np.float32(region_sigmas)
    bounds = np.array([level.sigma for level in levels], np.float32)
    octaves_off = np.log2(sigmas[:, None] / bounds[None, :]) - _SHARPER
    nearest = np.abs(octaves_off).argmin(axis=1)
    unit = np.zeros((len(frames), 2, 2), np.float32)
    for i in np.unique(nearest):
        rows = np.flatnonzero(nearest == i)
        level = levels[i]
        scaled = round_frames(frames.xy[rows], sigmas[rows], frames.response[rows])
        scale = scaled.shape[:, 0, 0] / np.float32(level.step)
        unit[rows] = second_moment_shapes(level.pixels, scaled.xy / level.step, scale, _mask())
    kept = take(frames, unit[:, 0, 0] > 0)
    shape = unit[unit[:, 0, 0] > 0] * kept.shape[:, :1, :1]
    return Frames(kept.xy, shape.astype(np.float32), kept.response)


def _mask() -> NDArray[np.float32]:
    """Gaussian window; its deviation is a third of its half-width, zero outside the disc."""
    offset = np.arange(_WINDOW, dtype=np.float32) - _WINDOW // 2
    squared = offset[:, None] ** 2 + offset[None, :] ** 2
    half = _WINDOW // 2
    window = np.exp(-squared / (2 * (half / 3) ** 2)) * (squared <= half**2)
    mask: NDArray[np.float32] = window.astype(np.float32)
    return mask


@kernel
def second_moment_shapes(
    pixels: NDArray[np.float32],
    xy: NDArray[np.float32],
    scale: NDArray[np.float32],
    mask: NDArray[np.float32],
) -> NDArray[np.float32]:
    """Iterate every frame's shape until the second-moment matrix seen through it is isotropic.

    Parameters
    ----------
    pixels : (h, w) float32, blurred at about the frames' scale.
    xy : (n, 2) float32, pixels of this level. scale : (n,) float32, pixels of this level.
    mask : (m, m) float32, odd m.

    Returns
    -------
    (n, 2, 2) float32 : lower triangular of determinant 1; all zero where it did not converge, got
    stretched more than 6 times, or left the image.
    """
    out = np.zeros((len(xy), 2, 2), np.float32)
    side = len(mask)
    patch = np.empty((side, side), np.float32)
    for i in range(len(xy)):
        unit = scale[i] / BASE_SIGMA
        # The symmetric shape [[a, b], [b, c]], of determinant 1.
        a, b, c = 1.0, 0.0, 1.0
        for _ in range(_MAX_ROUNDS):
            if not _sample(pixels, xy[i, 0], xy[i, 1], a * unit, b * unit, c * unit, patch):
                break
            xx, xy_, yy = _moments(patch, mask)
            trace, determinant = xx + yy, xx * yy - xy_ * xy_
            if determinant <= 1e-8 * trace * trace:
                break
            spread = np.sqrt(max(trace * trace - 4.0 * determinant, 0.0))
            if (trace - spread) / (trace + spread) > (1.0 - _CONVERGED) ** 2:
                _store_upright(a, b, c, out[i])
                break
            # M^(-1/2) of determinant 1, by the closed form of a 2 x 2 root.
            root = np.sqrt(determinant)
            norm = np.sqrt((trace + 2.0 * root) * root)
            p, q, r = (yy + root) / norm, -xy_ / norm, (xx + root) / norm
            a, b, c = _compose(a, b, c, p, q, r)
            largest = 0.5 * (a + c + np.sqrt(max((a + c) ** 2 - 4.0, 0.0)))
            if largest * largest > _MAX_STRETCH:
                break
    return out


@kernel
def _compose(
    a: float, b: float, c: float, p: float, q: float, r: float
) -> tuple[float, float, float]:
    """Symmetric root of A P P A, where A = [[a, b], [b, c]] and P = [[p, q], [q, r]]."""
    m00, m01 = a * p + b * q, a * q + b * r
    m10, m11 = b * p + c * q, b * q + c * r
    s00, s01, s11 = m00 * m00 + m01 * m01, m00 * m10 + m01 * m11, m10 * m10 + m11 * m11
    root = np.sqrt(max(s00 * s11 - s01 * s01, 0.0))
    norm = np.sqrt(s00 + s11 + 2.0 * root)
    return (s00 + root) / norm, s01 / norm, (s11 + root) / norm


@kernel
def _sample(
    pixels: NDArray[np.float32],
    x: float,
    y: float,
    a: float,
    b: float,
    c: float,
    patch: NDArray[np.float32],
) -> bool:
    """Read the window through the shape, bilinearly; False if it leaves the image."""
    height, width = pixels.shape
    half = len(patch) // 2
    reach_x, reach_y = half * (abs(a) + abs(b)), half * (abs(b) + abs(c))
    if x - reach_x < 0 or y - reach_y < 0 or x + reach_x >= width - 1 or y + reach_y >= height - 1:
        return False
    for row in range(len(patch)):
        v = row - half
        for column in range(len(patch)):
            u = column - half
            at_x, at_y = x + a * u + b * v, y + b * u + c * v
            left, top = int(at_x), int(at_y)
            fx, fy = np.float32(at_x - left), np.float32(at_y - top)
            upper = pixels[top, left] + fx * (pixels[top, left + 1] - pixels[top, left])
            lower = pixels[top + 1, left] + fx * (pixels[top + 1, left + 1] - pixels[top + 1, left])
            patch[row, column] = upper + fy * (lower - upper)
    return True


@kernel
def _moments(patch: NDArray[np.float32], mask: NDArray[np.float32]) -> tuple[float, float, float]:
    """Return the windowed sums of gx gx, gx gy and gy gy."""
    xx, xy, yy = 0.0, 0.0, 0.0
    for row in range(1, len(patch) - 1):
        for column in range(1, len(patch) - 1):
            gx = patch[row, column + 1] - patch[row, column - 1]
            gy = patch[row + 1, column] - patch[row - 1, column]
            weight = mask[row, column]
            xx += weight * gx * gx
            xy += weight * gx * gy
            yy += weight * gy * gy
    return xx, xy, yy


@kernel
def _store_upright(a: float, b: float, c: float, out: NDArray[np.float32]) -> None:
    """Lower-triangular Cholesky factor of A A, which maps the unit circle to the same ellipse."""
    s00, s01, s11 = a * a + b * b, a * b + b * c, b * b + c * c
    first = np.sqrt(s00)
    out[0, 0], out[0, 1] = first, 0.0
    out[1, 0], out[1, 1] = s01 / first, np.sqrt(s11 - (s01 / first) ** 2)
