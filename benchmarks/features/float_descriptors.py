"""Our descriptors without rounding to bytes, by plain array sums, to measure what bytes cost."""

import numpy as np
from numpy.typing import NDArray

from contracts.config import DESCRIPTOR_SIZES, Descriptor
from contracts.records import Frames
from retrieval.descriptors.shape_context import find_edges
from retrieval.patches import PATCH_SIDE, cut_patches, patch_gradients
from retrieval.pyramid import Pyramid

Floats = NDArray[np.float32]

_CELL = PATCH_SIDE / 4
_HALF = PATCH_SIDE // 2
_RINGS = np.array([6, 11, 15]) / 15


def describe_in_floats(pyramid: Pyramid, frames: Frames) -> dict[Descriptor, Floats]:
    """Describe frames as `retrieval.descriptors.describe` does; float32 in the same units."""
    described = {
        name: np.empty((len(frames), size), np.float32) for name, size in DESCRIPTOR_SIZES.items()
    }
    for rows, patches in cut_patches(pyramid, frames):
        magnitude, angle = patch_gradients(patches)
        described["sift"][rows] = float_sift(magnitude, angle)
        described["surf"][rows] = float_surf(patches)
        described["sc"][rows] = float_shape_context(magnitude, angle)
    return described


def float_sift(magnitude: Floats, angle: Floats) -> Floats:
    """RootSIFT times 512 of patches' gradients, (n, 41, 41) -> (n, 128)."""
    offset = np.arange(PATCH_SIDE)
    centres = _CELL * (np.arange(4) + 0.5) - 0.5
    share = np.maximum(1 - np.abs(offset[None] - centres[:, None]) / _CELL, 0)
    share = share * np.exp(-0.5 * ((offset - _HALF) / (2 * _CELL)) ** 2)
    cells = np.einsum("ir,jc->ijrc", share, share).reshape(16, -1)
    votes = _split_directions(magnitude, 8 * angle, 8)
    histogram = (cells @ votes).reshape(len(votes), 128)
    norm = np.linalg.norm(histogram, axis=1, keepdims=True)
    return _rooted(np.minimum(histogram, 0.2 * norm))


def float_surf(patches: Floats) -> Floats:
    """SURF times 256 plus 128 of patches, (n, 41, 41) -> (n, 64)."""
    base = patches[:, :1, :1].astype(np.float64)
    padded = np.pad(patches - base, ((0, 0), (1, 1), (1, 1)), mode="edge")
    sums = np.pad(padded, ((0, 0), (1, 0), (1, 0))).cumsum(axis=1).cumsum(axis=2)
    at = 2 * np.arange(20) + 2

    def box(top: int, left: int, bottom: int, right: int) -> NDArray[np.float64]:
        """Sum of padded[y + top : y + bottom, x + left : x + right] at all sites."""
        low, high = sums[:, at + top], sums[:, at + bottom]
        total = high[:, :, at + right] - high[:, :, at + left]
        return np.asarray(total - low[:, :, at + right] + low[:, :, at + left])

    dx = box(-2, 1, 3, 3) - box(-2, -2, 3, 0)
    dy = box(1, -2, 3, 3) - box(-2, -2, 0, 3)
    away = 2 * np.arange(20) - 19
    window = np.exp(-0.5 * (away[:, None] ** 2 + away[None] ** 2) / 13.2**2)
    responses = np.stack((dx, np.abs(dx), dy, np.abs(dy)), axis=3) * window[:, :, None]
    cells = responses.reshape(len(patches), 4, 5, 4, 5, 4).sum(axis=(2, 4)).reshape(-1, 64)
    norm = np.maximum(np.linalg.norm(cells, axis=1, keepdims=True), 1e-9)
    return np.asarray(256 * cells / norm + 128, np.float32)


def float_shape_context(magnitude: Floats, angle: Floats) -> Floats:
    """Shape context times 512 of patches' gradients, (n, 41, 41) -> (n, 36)."""
    edges = np.zeros(magnitude.shape, np.uint8)
    found = np.empty(PATCH_SIDE**2, np.int32)
    for i in range(len(magnitude)):
        find_edges(magnitude[i], angle[i], edges[i], found)
    y, x = np.mgrid[-_HALF : _HALF + 1, -_HALF : _HALF + 1]
    ring = np.searchsorted(_RINGS, np.hypot(x, y).ravel() / _HALF)
    sector = (np.arctan2(y, x).ravel() / (2 * np.pi) * 4) % 4
    places = np.zeros((9, PATCH_SIDE**2))
    places[0] = ring == 0
    for number in range(4):
        away = np.abs(sector - number)
        share = np.maximum(1 - np.minimum(away, 4 - away), 0)
        places[1 + number], places[5 + number] = share * (ring == 1), share * (ring == 2)
    votes = _split_directions(magnitude * (edges == 2), 8 * angle, 4)
    return _rooted((places @ votes).reshape(len(votes), 36))


def _split_directions(weight: Floats, direction: Floats, count: int) -> NDArray[np.float64]:
    """Share votes (n, h, w) linearly between the two nearest of `count` directions, (n, hw, c)."""
    flat = direction.reshape(len(direction), -1, 1).astype(np.float64)
    gap = np.abs(flat - np.arange(count)) % count
    near = np.maximum(1 - np.minimum(gap, count - gap), 0)
    return np.asarray(near * weight.reshape(len(weight), -1, 1))


def _rooted(histogram: NDArray[np.float64]) -> Floats:
    total = np.maximum(histogram.sum(axis=1, keepdims=True), 1e-9)
    return np.asarray(512 * np.sqrt(histogram / total), np.float32)
