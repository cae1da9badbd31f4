"""Synthetic photos whose geometry is known, and what is cut out of them."""

import cv2
import numpy as np
from numpy.typing import NDArray

from contracts.records import Frames
from retrieval.patches import PATCH_SIDE, cut_patches
from retrieval.pyramid import Pyramid


def facade(height: int = 360, width: int = 480, seed: int = 7) -> NDArray[np.uint8]:
    """A cluttered picture: rectangles, discs and ellipses of many sizes, lightly textured."""
    rng = np.random.default_rng(seed)
    picture = np.full((height, width, 3), 128, np.uint8)
    for _ in range(260):
        x, y = int(rng.integers(0, width)), int(rng.integers(0, height))
        size = int(np.exp(rng.uniform(1.2, 3.6)))
        grey = int(rng.integers(0, 256))
        colour = (grey, grey, grey)
        kind = rng.integers(0, 3)
        if kind == 0:
            cv2.rectangle(picture, (x, y), (x + size, y + int(1.4 * size)), colour, -1)
        elif kind == 1:
            cv2.circle(picture, (x, y), size // 2 + 1, colour, -1, cv2.LINE_AA)
        else:
            turn = float(rng.uniform(0, 180))
            axes = (size, size // 2 + 1)
            cv2.ellipse(picture, (x, y), axes, turn, 0, 360, colour, -1, cv2.LINE_AA)
    soft = cv2.GaussianBlur(picture, (0, 0), 0.8).astype(np.float64)
    grain = cv2.GaussianBlur(rng.normal(0, 12, (height, width)), (0, 0), 1.5)
    return np.clip(np.rint(soft + grain[:, :, None]), 0, 255).astype(np.uint8)


def warp(picture: NDArray[np.uint8], matrix: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Move every point p of a picture to matrix @ (p, 1); grey outside."""
    height, width = picture.shape[:2]
    return np.asarray(
        cv2.warpAffine(
            picture, matrix, (width, height), flags=cv2.INTER_CUBIC, borderValue=(128, 128, 128)
        ),
        np.uint8,
    )


def all_patches(pyramid: Pyramid, frames: Frames) -> NDArray[np.float32]:
    """The patches of all frames, in their order: (n, 41, 41) float32."""
    patches = np.full((len(frames), PATCH_SIDE, PATCH_SIDE), np.nan, np.float32)
    for rows, block in cut_patches(pyramid, frames):
        patches[rows] = block
    return patches
