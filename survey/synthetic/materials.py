"""What walls, roofs and roads are made of: procedural textures from a seeded generator."""

import cv2
import numpy as np
from numpy.typing import NDArray

from survey.synthetic.canvas import PX_PER_M, Colour, Rgb

Tone = NDArray[np.float32]
"""(H, W) relative brightness: 0 leaves a colour as it is, 0.1 makes it a tenth brighter."""


def noise(shape: tuple[int, int], cell_px: float, rng: np.random.Generator) -> Tone:
    """Smooth noise of unit deviation whose blobs are about `cell_px` wide."""
    rows, cols = (max(2, int(side / cell_px) + 2) for side in shape)
    coarse = rng.standard_normal((rows, cols), dtype=np.float32)
    return np.asarray(
        cv2.resize(coarse, (shape[1], shape[0]), interpolation=cv2.INTER_LINEAR), dtype=np.float32
    )


def grain(shape: tuple[int, int], rng: np.random.Generator) -> Tone:
    """Fine and coarse noise together: weathered mineral surface."""
    fine = noise(shape, 1.7, rng) * 0.035 + noise(shape, 5, rng) * 0.025
    return np.asarray(fine + noise(shape, 40, rng) * 0.03 + noise(shape, 170, rng) * 0.035)


def coloured(tone: Tone, colour: Colour) -> Rgb:
    """A colour modulated by a tone map, (H, W, 3) uint8."""
    layers = [cv2.convertScaleAbs(tone + 1.0, alpha=channel) for channel in colour]
    return np.asarray(cv2.merge(layers), dtype=np.uint8)


def courses(
    shape: tuple[int, int],
    block_m: tuple[float, float],
    joint: tuple[float, float],
    spread: float,
    rng: np.random.Generator,
) -> Tone:
    """Blocks in running bond, each with its own tone, and darker or lighter joints.

    block_m : width and height of a block. joint : its width in metres and its tone.
    spread : deviation of the blocks' tones.
    """
    height, width = shape
    half_px, course_px = block_m[0] * PX_PER_M / 2, block_m[1] * PX_PER_M
    n_rows, n_halves = int(height / course_px) + 2, int(width / half_px) + 4
    tones = rng.normal(0, spread, (n_rows, n_halves // 2 + 1)).astype(np.float32)
    halves = np.repeat(tones, 2, axis=1)
    halves[1::2] = np.roll(halves[1::2], 1, axis=1)
    # Counted from the ground, so that instances of a template have their courses level.
    rows = ((height - 1 - np.arange(height)) / course_px).astype(np.intp)
    cols = (np.arange(width) / half_px).astype(np.intp)
    tone = halves[rows][:, cols]
    seams = np.zeros(shape, dtype=np.uint8)
    seams[1:] |= (tone[1:] != tone[:-1]).astype(np.uint8)
    seams[:, 1:] |= (tone[:, 1:] != tone[:, :-1]).astype(np.uint8)
    thick = max(1, round(joint[0] * PX_PER_M))
    seams = np.asarray(cv2.dilate(seams, np.ones((thick, thick), np.uint8)), dtype=np.uint8)
    return np.where(seams > 0, np.float32(joint[1]), tone)


def rubble(shape: tuple[int, int], stone_m: float, rng: np.random.Generator) -> Tone:
    """Irregular stones in mortar: cells of random points, each with its own tone."""
    height, width = shape
    n_stones = int(height * width / (stone_m * PX_PER_M) ** 2)
    seeds = np.full(shape, 255, dtype=np.uint8)
    seeds[rng.integers(0, height, n_stones), rng.integers(0, width, n_stones)] = 0
    _, labels = cv2.distanceTransformWithLabels(
        seeds, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    tones = rng.normal(0, 0.13, int(labels.max()) + 1).astype(np.float32)
    tone = tones[labels]
    seams = np.zeros(shape, dtype=np.uint8)
    seams[:-1, :-1] = (labels[1:, :-1] != labels[:-1, :-1]) | (labels[:-1, 1:] != labels[:-1, :-1])
    mortar = cv2.dilate(seams, np.ones((2, 2), np.uint8)) > 0
    return np.where(mortar, np.float32(0.16), tone)


def stains(shape: tuple[int, int], n: int, rng: np.random.Generator) -> Tone:
    """Dark streaks where rain runs down, starting at random places."""
    height, width = shape
    tone = np.zeros(shape, dtype=np.float32)
    for _ in range(n):
        left, top = int(rng.integers(0, width)), int(rng.integers(0, height * 3 // 4))
        wide, long = int(rng.integers(6, 40)), int(rng.integers(60, 300))
        patch = tone[top : top + long, left : left + wide]
        fade = np.linspace(1, 0, patch.shape[0], dtype=np.float32)[:, None]
        patch -= fade * np.float32(rng.uniform(0.08, 0.24))
    return np.asarray(cv2.blur(tone, (9, 15)), dtype=np.float32)


def cracks(pixels: Rgb, n: int, colour: Colour, rng: np.random.Generator) -> None:
    """Draw random walks of thin dark line on a wall, in place."""
    height, width = pixels.shape[:2]
    for _ in range(n):
        steps = rng.normal((0, 14), (9, 6), (14, 2))
        start = rng.uniform((0, 0), (width, height))
        walk = (start + np.cumsum(steps, axis=0)).astype(np.int32)
        cv2.polylines(pixels, [walk], False, colour, 1, cv2.LINE_AA)


def slates(shape: tuple[int, int], colour: Colour, rng: np.random.Generator) -> Rgb:
    """A roof of slates or tiles in courses."""
    tone = courses(shape, (0.26, 0.17), (0.02, -0.3), 0.09, rng)
    return coloured(tone + grain(shape, rng), colour)


def cloth(shape: tuple[int, int], colour: Colour, other: Colour, stripe_m: float) -> Rgb:
    """An awning's vertical stripes."""
    phase = (np.arange(shape[1]) / (stripe_m * PX_PER_M)).astype(np.intp) % 2
    row = np.array([colour, other], dtype=np.uint8)[phase]
    return np.repeat(row[None], shape[0], axis=0)
