"""Harris corners with a scale of their own (Harris-Laplace).

Harris & Stephens 1988; scale selection after Mikolajczyk & Schmid, IJCV 2004.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from contracts.records import Frames
from retrieval.kernels import kernel
from retrieval.pyramid import LEVELS_PER_OCTAVE, Level, Pyramid
from retrieval.selection import favour_large, inside, no_frames, round_frames, spread, take

_REGION_SIGMAS = 3.0**0.5 * 2.0
"""Region radius in units of the differentiation scale; corners show little inside it."""
_INTEGRATION = 1.4
"""Integration scale over differentiation scale."""
_KAPPA = 0.06
_FLOOR = 1.0
"""In grey levels to the fourth, scale-normalised."""


def detect_har(
    pyramid: Pyramid, max_frames: int, usable: NDArray[np.bool_] | None = None
) -> Frames:
    """Find Harris-Laplace frames, round. See `detect`."""
    shape = (pyramid.grey.shape[0], pyramid.grey.shape[1])
    if not pyramid.octaves:
        return no_frames()
    frames = _find(pyramid.octaves, shape, usable)
    if len(frames) < max_frames:
        # One level finer: the smallest corners repeat less well, but a poor photo needs them.
        finer = (pyramid.fine[-1], *pyramid.octaves[0])
        frames = _find((finer, *pyramid.octaves[1:]), shape, usable)
    return spread(frames, shape, max_frames)


def _find(
    octaves: tuple[tuple[Level, ...], ...],
    shape: tuple[int, int],
    usable: NDArray[np.bool_] | None,
) -> Frames:
    found = np.concatenate([_find_in_octave(octave) for octave in octaves])
    frames = favour_large(round_frames(found[:, :2], found[:, 2], found[:, 3]))
    return take(frames, inside(frames, shape, usable))


def _find_in_octave(octave: tuple[Level, ...]) -> NDArray[np.float32]:
    """Return (n, 4) float32: x, y, region radius in photo pixels, response."""
    step = octave[0].step
    parts = []
    for i in range(1, len(octave) - 1):
        sigma = octave[i].sigma / step
        found = laplacian_corners(
            harris_response(octave[i].pixels, sigma),
            octave[i - 1].pixels,
            octave[i].pixels,
            octave[i + 1].pixels,
            _FLOOR,
        )
        found[:, :2] *= step
        found[:, 2] = _REGION_SIGMAS * octave[i].sigma * 2.0 ** (found[:, 2] / LEVELS_PER_OCTAVE)
        parts.append(found)
    return np.concatenate(parts)


def harris_response(pixels: NDArray[np.float32], sigma: float) -> NDArray[np.float32]:
    """Scale-normalised det(M) - 0.06 trace(M)^2 of the gradient's second-moment matrix.

    Parameters
    ----------
    pixels : (h, w) float32. sigma : its blur (the differentiation scale), in its own pixels.

    Returns
    -------
    (h, w) float32.
    """
    products = gradient_products(pixels, sigma)
    integration = _INTEGRATION * sigma
    side = 2 * int(np.ceil(2.0 * integration)) + 1
    for plane in products:
        cv2.GaussianBlur(plane, (side, side), integration, dst=plane)
    return corner_measure(products[0], products[1], products[2])


@kernel
def gradient_products(pixels: NDArray[np.float32], sigma: float) -> NDArray[np.float32]:
    """Return (3, h, w) float32: gx gx, gx gy, gy gy times sigma^2; zero on the border."""
    height, width = pixels.shape
    products = np.zeros((3, height, width), np.float32)
    norm = np.float32(0.5 * sigma)
    for row in range(1, height - 1):
        for column in range(1, width - 1):
            gx = norm * (pixels[row, column + 1] - pixels[row, column - 1])
            gy = norm * (pixels[row + 1, column] - pixels[row - 1, column])
            products[0, row, column] = gx * gx
            products[1, row, column] = gx * gy
            products[2, row, column] = gy * gy
    return products


@kernel
def corner_measure(
    xx: NDArray[np.float32], xy: NDArray[np.float32], yy: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Harris measure of second-moment planes (h, w) float32, pixel by pixel."""
    height, width = xx.shape
    response = np.empty((height, width), np.float32)
    kappa = np.float32(_KAPPA)
    for row in range(height):
        for column in range(width):
            a, b, c = xx[row, column], xy[row, column], yy[row, column]
            response[row, column] = a * c - b * b - kappa * (a + c) * (a + c)
    return response


@kernel
def laplacian_corners(
    response: NDArray[np.float32],
    below: NDArray[np.float32],
    level: NDArray[np.float32],
    above: NDArray[np.float32],
    floor: float,
) -> NDArray[np.float32]:
    """Find spatial maxima of the Harris measure whose Laplacian peaks at this scale.

    Parameters
    ----------
    response : (h, w) float32. below, level, above : (h, w) float32, images blurred one
    level apart.

    Returns
    -------
    (n, 4) float32 : x, y in pixels of the level, offset in levels, response.
    """
    height, width = response.shape
    found = np.empty(((height // 2 + 1) * (width // 2 + 1), 4), np.float32)
    n_found = 0
    ratio = 2.0 ** (2.0 / LEVELS_PER_OCTAVE)
    for row in range(2, height - 2):
        for column in range(2, width - 2):
            value = response[row, column]
            if value <= floor or not _is_peak(response, row, column):
                continue
            middle = _laplacian(level, row, column)
            lower = _laplacian(below, row, column) / ratio
            upper = _laplacian(above, row, column) * ratio
            if middle < lower or middle < upper:
                continue
            out = found[n_found]
            out[0] = column + _peak(response[row, column - 1], value, response[row, column + 1])
            out[1] = row + _peak(response[row - 1, column], value, response[row + 1, column])
            out[2] = _peak(float(lower), float(middle), float(upper))
            out[3] = value
            n_found += 1
    return found[:n_found].copy()


@kernel
def _is_peak(response: NDArray[np.float32], row: int, column: int) -> bool:
    value = response[row, column]
    for down in range(-1, 2):
        for right in range(-1, 2):
            here = response[row + down, column + right]
            if here > value or (here == value and (down < 0 or (down == 0 and right < 0))):
                return False
    return True


@kernel
def _laplacian(pixels: NDArray[np.float32], row: int, column: int) -> np.float32:
    laplacian: np.float32 = abs(
        pixels[row, column - 1]
        + pixels[row, column + 1]
        + pixels[row - 1, column]
        + pixels[row + 1, column]
        - np.float32(4.0) * pixels[row, column]
    )
    return laplacian


@kernel
def _peak(before: float, at: float, after: float) -> float:
    """Vertex of the parabola through three samples, within half a step."""
    curvature = before + after - 2.0 * at
    if curvature >= 0.0:
        return 0.0
    return max(-0.5, min(0.5, 0.5 * (before - after) / curvature))
