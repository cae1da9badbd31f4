"""Each descriptor against a slow, plain form of its definition."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from picture_scenes import all_patches, facade, warp

from contracts.config import DESCRIPTOR_SIZES, DESCRIPTORS, Descriptor
from contracts.records import Frames
from retrieval.descriptors import describe
from retrieval.descriptors.shape_context import describe_shape_context
from retrieval.descriptors.sift import describe_sift
from retrieval.descriptors.surf import describe_surf
from retrieval.detectors import detect
from retrieval.patches import patch_gradients
from retrieval.pyramid import build_pyramid
from retrieval.selection import no_frames

Image = NDArray[np.float64]


@pytest.fixture(scope="module")
def patches() -> NDArray[np.float32]:
    pyramid = build_pyramid(facade())
    return all_patches(pyramid, detect(pyramid, "hesaff", 25))


def _sift_oracle(magnitude: Image, angle: Image) -> Image:
    histogram = np.zeros((4, 4, 8))
    cell = 41 / 4
    for row in range(41):
        for column in range(41):
            window = math.exp(-((row - 20) ** 2 + (column - 20) ** 2) / (2 * (2 * cell) ** 2))
            vote = magnitude[row, column] * window
            for i in range(4):
                for j in range(4):
                    near_i = 1 - abs((row + 0.5) / cell - (i + 0.5))
                    near_j = 1 - abs((column + 0.5) / cell - (j + 0.5))
                    if near_i <= 0 or near_j <= 0:
                        continue
                    for k in range(8):
                        gap = abs(angle[row, column] * 8 - k)
                        near_k = 1 - min(gap, 8 - gap)
                        histogram[i, j, k] += vote * near_i * near_j * max(near_k, 0)
    flat = histogram.ravel()
    flat = np.minimum(flat, 0.2 * np.linalg.norm(flat))
    rooted: Image = np.minimum(512 * np.sqrt(flat / flat.sum()), 255)
    return rooted


def _surf_oracle(patch: Image) -> Image:
    padded = np.pad(patch, 1, mode="edge")
    cells = np.zeros((4, 4, 4))
    for row in range(20):
        for column in range(20):
            y, x = 2 * row + 2, 2 * column + 2
            box = padded[y - 2 : y + 3, x - 2 : x + 3]
            dx = box[:, 3:].sum() - box[:, :2].sum()
            dy = box[3:].sum() - box[:2].sum()
            away = (2 * row + 1 - 20) ** 2 + (2 * column + 1 - 20) ** 2
            weight = math.exp(-away / (2 * 13.2**2))
            cells[row // 5, column // 5] += weight * np.array([dx, abs(dx), dy, abs(dy)])
    flat = cells.ravel()
    signed: Image = np.clip(256 * flat / np.linalg.norm(flat) + 128, 0, 255)
    return signed


def _canny_oracle(magnitude: Image, angle: Image) -> NDArray[np.bool_]:
    ridge = np.zeros((41, 41), np.bool_)
    steps = {0: (0, 1), 1: (1, 1), 2: (1, 0), 3: (-1, 1)}
    for row in range(2, 39):
        for column in range(2, 39):
            down, right = steps[math.floor(8 * angle[row, column] + 0.5) % 4]
            value = magnitude[row, column]
            before = magnitude[row - down, column - right]
            ridge[row, column] = value >= before and value > magnitude[row + down, column + right]
    weak = ridge & (magnitude > 0.6 * magnitude.mean())
    edges: NDArray[np.bool_] = weak & (magnitude > 1.5 * magnitude.mean())
    while True:
        grown = edges.copy()
        for row, column in np.argwhere(edges):
            grown[row - 1 : row + 2, column - 1 : column + 2] |= weak[
                row - 1 : row + 2, column - 1 : column + 2
            ]
        if (grown == edges).all():
            return edges
        edges = grown


def _shape_context_oracle(magnitude: Image, angle: Image) -> Image:
    histogram = np.zeros((9, 4))
    for row, column in np.argwhere(_canny_oracle(magnitude, angle)):
        x, y = column - 20, row - 20
        radius = math.hypot(x, y) / 20 * 15
        if radius > 15:
            continue
        sector = math.atan2(y, x) / (2 * math.pi) * 4 % 4
        for k in range(4):
            gap = abs(angle[row, column] * 8 % 4 - k)
            vote = magnitude[row, column] * max(1 - min(gap, 4 - gap), 0)
            if radius <= 6:
                histogram[0, k] += vote
                continue
            ring = 0 if radius <= 11 else 1
            for s in range(4):
                away = abs(sector - s)
                histogram[1 + 4 * ring + s, k] += vote * max(1 - min(away, 4 - away), 0)
    flat = histogram.ravel()
    rooted: Image = np.minimum(512 * np.sqrt(flat / flat.sum()), 255)
    return rooted


def _assert_rounded(found: NDArray[np.uint8], expected: Image) -> None:
    """Equal but for rounding of float32 sums."""
    assert np.abs(found.astype(float) - expected).max() < 1.0


def test_sift_is_the_trilinear_histogram_square_rooted(patches: NDArray[np.float32]) -> None:
    magnitude, angle = patch_gradients(patches)
    found = describe_sift(magnitude, angle)
    for i in range(8):
        _assert_rounded(found[i], _sift_oracle(magnitude[i].astype(float), angle[i].astype(float)))


def test_surf_is_the_sums_of_haar_responses(patches: NDArray[np.float32]) -> None:
    found = describe_surf(patches)
    for i in range(len(patches)):
        _assert_rounded(found[i], _surf_oracle(patches[i].astype(float)))


def test_shape_context_counts_canny_edges_by_place_and_direction(
    patches: NDArray[np.float32],
) -> None:
    magnitude, angle = patch_gradients(patches)
    found = describe_shape_context(magnitude, angle)
    for i in range(len(patches)):
        expected = _shape_context_oracle(magnitude[i].astype(float), angle[i].astype(float))
        _assert_rounded(found[i], expected)


@pytest.mark.parametrize("descriptor", DESCRIPTORS)
def test_a_flat_patch_has_an_empty_descriptor(descriptor: Descriptor) -> None:
    pyramid = build_pyramid(np.full((100, 100, 3), 77, np.uint8))
    frame = Frames(
        np.full((1, 2), 50, np.float32),
        np.eye(2, dtype=np.float32)[None] * 5,
        np.ones(1, np.float32),
    )
    (found,) = describe(pyramid, frame, [descriptor])[descriptor]
    assert (found == (128 if descriptor == "surf" else 0)).all()


@pytest.mark.parametrize("descriptor", DESCRIPTORS)
def test_no_frames_give_empty_arrays_of_the_right_width(descriptor: Descriptor) -> None:
    found = describe(build_pyramid(facade()), no_frames(), [descriptor])[descriptor]
    assert found.shape == (0, DESCRIPTOR_SIZES[descriptor])
    assert found.dtype == np.uint8


def test_only_the_descriptors_asked_for_come_back_in_that_order() -> None:
    pyramid = build_pyramid(facade())
    found = describe(pyramid, detect(pyramid, "star", 20), ["sc", "sift"])
    assert list(found) == ["sc", "sift"]


def test_a_descriptor_does_not_depend_on_the_frames_beside_it() -> None:
    pyramid = build_pyramid(facade())
    frames = detect(pyramid, "mser", 40)
    together = describe(pyramid, frames, DESCRIPTORS)
    for rows in (slice(0, 1), slice(7, 20)):
        some = Frames(frames.xy[rows], frames.shape[rows], frames.response[rows])
        alone = describe(pyramid, some, DESCRIPTORS)
        for name in DESCRIPTORS:
            assert alone[name].tobytes() == together[name][rows].tobytes()


@pytest.mark.parametrize("descriptor", DESCRIPTORS)
def test_light_and_contrast_leave_a_descriptor_nearly_unchanged(descriptor: Descriptor) -> None:
    pyramid = build_pyramid(facade())
    frames = detect(pyramid, "hesaff", 100)
    dimmed = build_pyramid((facade() * 0.5 + 30).astype(np.uint8))
    before = describe(pyramid, frames, [descriptor])[descriptor].astype(float)
    after = describe(dimmed, frames, [descriptor])[descriptor].astype(float)
    change = np.linalg.norm(before - after, axis=1)
    strangers = np.linalg.norm(before - np.roll(after, 1, axis=0), axis=1)
    assert np.median(change) < 0.15 * np.median(strangers)


@pytest.mark.parametrize("descriptor", DESCRIPTORS)
def test_a_frame_that_moves_with_the_photo_keeps_its_descriptor(descriptor: Descriptor) -> None:
    matrix = np.array([[0.9, 0.0, 10], [-0.15, 1.1, 12]])
    pyramid = build_pyramid(facade())
    frames = detect(pyramid, "hesaff", 100)
    moved = Frames(
        (frames.xy @ matrix[:, :2].T + matrix[:, 2]).astype(np.float32),
        (matrix[:, :2] @ frames.shape).astype(np.float32),
        frames.response,
    )
    inner = ((moved.xy > 40) & (moved.xy < (440, 320))).all(axis=1)
    before = describe(pyramid, frames, [descriptor])[descriptor].astype(float)
    warped = build_pyramid(warp(facade(), matrix))
    after = describe(warped, moved, [descriptor])[descriptor].astype(float)
    gap = np.linalg.norm(before[inner, None] - after[None], axis=2)
    assert (gap.argmin(axis=1) == np.flatnonzero(inner)).mean() > 0.9
