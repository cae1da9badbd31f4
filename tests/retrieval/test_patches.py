"""Patches and their gradients, against slow plain sampling."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from picture_scenes import all_patches, facade

from contracts.records import Frames
from retrieval.detectors import detect
from retrieval.patches import PATCH_SIDE, cut_patches, patch_gradients, sample_patches, turns
from retrieval.pyramid import Level, build_pyramid
from retrieval.selection import no_frames


def _frame(x: float, y: float, shape: list[list[float]]) -> Frames:
    return Frames(
        np.array([[x, y]], np.float32), np.array([shape], np.float32), np.ones(1, np.float32)
    )


def _bilinear(pixels: NDArray[np.float32], x: float, y: float) -> float:
    height, width = pixels.shape
    x, y = min(max(x, 0.0), width - 1.0), min(max(y, 0.0), height - 1.0)
    left, top = math.floor(x), math.floor(y)
    total = 0.0
    for row, share_y in ((top, 1 - (y - top)), (top + 1, y - top)):
        for column, share_x in ((left, 1 - (x - left)), (left + 1, x - left)):
            if share_x * share_y > 0:
                total += share_x * share_y * float(pixels[row, column])
    return total


def _oracle(level: Level, frame: Frames) -> NDArray[np.float64]:
    patch = np.empty((41, 41))
    for row in range(41):
        for column in range(41):
            offset = np.array([column - 20, row - 20]) * 3 / 20
            x, y = frame.xy[0].astype(float) + frame.shape[0].astype(float) @ offset
            patch[row, column] = _bilinear(level.pixels, x / level.step, y / level.step)
    return patch


@pytest.mark.parametrize(
    ("frame", "sigma"),
    [
        (_frame(200.3, 150.7, [[3, 0], [0, 3]]), 0.5),
        (_frame(200.3, 150.7, [[9, 0], [3, 11]]), 1.27),
        (_frame(100, 250, [[30, 0], [-8, 25]]), 1.6 * 2 ** (4 / 3)),
        (_frame(4, 355, [[20, 5], [2, 20]]), 1.6 * 2 ** (2 / 3)),
        (_frame(240, 180, [[90, 0], [0, 120]]), 1.6 * 2 ** (9 / 3)),
    ],
)
def test_a_patch_is_the_photo_at_its_own_scale_seen_through_the_shape(
    frame: Frames, sigma: float
) -> None:
    pyramid = build_pyramid(facade())
    (level,) = [v for v in pyramid.sampling_levels() if v.sigma == pytest.approx(sigma)]
    (patch,) = all_patches(pyramid, frame)
    assert np.abs(patch - _oracle(level, frame)).max() < 0.02


def test_every_frame_is_cut_once() -> None:
    pyramid = build_pyramid(facade())
    frames = detect(pyramid, "hesaff", 300)
    rows = np.concatenate([rows for rows, _ in cut_patches(pyramid, frames)])
    assert sorted(rows) == list(range(len(frames)))


@pytest.mark.parametrize("size", [(1, 1), (1, 9), (9, 1), (2, 2)])
def test_the_smallest_pictures_are_sampled_within_them(size: tuple[int, int]) -> None:
    pixels = np.random.default_rng(0).uniform(0, 255, size).astype(np.float32)
    xy = np.array([[size[1] / 2, size[0] / 2]], np.float32)
    (patch,) = sample_patches(pixels, xy, np.eye(2, dtype=np.float32)[None] * 20)
    assert patch[0, 0] == pytest.approx(pixels[0, 0])
    assert patch[-1, -1] == pytest.approx(pixels[-1, -1])


def test_a_patch_does_not_depend_on_the_frames_beside_it() -> None:
    pyramid = build_pyramid(facade())
    frames = detect(pyramid, "hesaff", 60)
    together = all_patches(pyramid, frames)
    for i in range(len(frames)):
        one = Frames(frames.xy[i : i + 1], frames.shape[i : i + 1], frames.response[i : i + 1])
        assert all_patches(pyramid, one)[0].tobytes() == together[i].tobytes()


def test_no_frames_give_no_patches() -> None:
    assert list(cut_patches(build_pyramid(facade()), no_frames())) == []


def test_gradients_agree_with_numpy() -> None:
    patches = np.random.default_rng(0).normal(0, 40, (3, 41, 41)).astype(np.float32)
    magnitude, angle = patch_gradients(patches)
    gy, gx = np.gradient(patches.astype(np.float64), axis=(1, 2))
    inner = (slice(None), slice(1, -1), slice(1, -1))
    assert np.allclose(magnitude[inner], np.hypot(gx, gy)[inner], atol=1e-3)
    expected = np.arctan2(gy, gx)[inner] / (2 * np.pi)
    difference = (angle[inner] - expected + 0.5) % 1.0 - 0.5
    assert np.abs(difference).max() < 1e-5
    border = np.ones((PATCH_SIDE, PATCH_SIDE), np.bool_)
    border[1:-1, 1:-1] = False
    assert (magnitude[:, border] == 0).all()


def test_angles_cover_one_turn_and_no_more() -> None:
    for degrees in range(-720, 720):
        radians = math.radians(degrees / 4)
        x, y = np.float32(math.cos(radians)), np.float32(math.sin(radians))
        angle = float(turns(x, y))
        assert 0.0 <= angle < 1.0
        expected = math.atan2(y, x) / (2 * math.pi)
        assert abs((angle - expected + 0.5) % 1.0 - 0.5) < 1e-5
    assert turns(np.float32(0), np.float32(0)) == 0
    assert turns(np.float32(1), np.float32(-1e-30)) < 1
