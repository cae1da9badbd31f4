"""The colour symmetry measure against its definition, and what it finds."""

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from retrieval.detectors import detect
from retrieval.detectors.symmetry import colour_symmetry
from retrieval.pyramid import build_pyramid


def _literally(colour: NDArray[np.float32], row: int, column: int, radius: float) -> float:
    """The formula of METHOD section 1, pair by pair; distances between pixels interpolated."""
    planes = colour.astype(np.float64)
    total = 0.0
    for direction in range(8):
        angle = np.pi * direction / 8
        inner = int(radius)
        for distance, weight in ((inner, 1 - radius + inner), (inner + 1, radius - inner)):
            dx, dy = round(distance * np.cos(angle)), round(distance * np.sin(angle))
            for first in planes:
                for second in planes:
                    mi, gi = _gradient(first, row + dy, column + dx, angle)
                    mj, gj = _gradient(second, row - dy, column - dx, angle)
                    term = np.cos(gi + gj) ** 2 * np.cos(gi) ** 2 * np.cos(gj) ** 2
                    total += weight * mi * mj * term
    return total


def _gradient(
    plane: NDArray[np.float64], row: int, column: int, angle: float
) -> tuple[float, float]:
    gx = (plane[row, column + 1] - plane[row, column - 1]) / 2
    gy = (plane[row + 1, column] - plane[row - 1, column]) / 2
    return float(np.log1p(np.hypot(gx, gy))), float(np.arctan2(gy, gx) - angle)


@pytest.mark.parametrize("radius", [1.0, 2.4, 5.0, 6.3])
def test_the_separated_sums_equal_the_pairwise_definition(radius: float) -> None:
    colour = np.random.default_rng(1).uniform(0, 90, (3, 26, 34)).astype(np.float32)
    colour[:, 12:, :9] = 40.0
    symmetry = colour_symmetry(colour.copy(), radius)
    for row, column in ((8, 9), (10, 20), (12, 15), (15, 10), (16, 23)):
        assert symmetry[row, column] == pytest.approx(
            _literally(colour, row, column, radius), rel=2e-4
        )


def test_a_grey_photo_counts_nine_times_its_one_channel() -> None:
    plane = np.random.default_rng(2).uniform(0, 90, (1, 24, 31)).astype(np.float32)
    one, three = colour_symmetry(plane, 3.0), colour_symmetry(np.repeat(plane, 3, axis=0), 3.0)
    assert np.allclose(9 * one, three, rtol=1e-4)


def test_an_image_smaller_than_the_ring_has_no_symmetry() -> None:
    assert not colour_symmetry(np.ones((3, 5, 9), np.float32), 6.0).any()


def _spot_of_equal_grey() -> NDArray[np.uint8]:
    """A red disc on the green that OpenCV's grey makes of the same brightness."""
    mask = np.zeros((200, 240), np.uint8)
    cv2.circle(mask, (130, 90), 11, 255, -1, cv2.LINE_AA)
    share = mask[:, :, None] / 255
    red, green = np.array([200, 30, 60]), np.array([60, 101, 60])
    return np.rint(share * red + (1 - share) * green).astype(np.uint8)


def test_colour_is_seen_where_grey_is_flat() -> None:
    picture = _spot_of_equal_grey()
    grey = cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY)
    assert int(grey.max()) - int(grey.min()) <= 2
    best = detect(build_pyramid(picture), "colsym", 10)
    assert np.abs(best.xy[0] - (130, 90)).max() < 0.5
    assert len(detect(build_pyramid(picture), "hesaff", 10)) == 0


@pytest.mark.parametrize("radius", [6, 9, 14, 22])
def test_the_region_grows_with_the_spot(radius: int) -> None:
    picture = np.full((240, 240, 3), 60, np.uint8)
    cv2.circle(picture, (120, 110), radius, (190, 170, 80), -1, cv2.LINE_AA)
    best = detect(build_pyramid(picture), "colsym", 10)
    assert np.abs(best.xy[0] - (120, 110)).max() < 0.6
    assert 1.0 < np.sqrt(np.linalg.det(best.shape[0])) / radius < 1.6


def test_a_bar_has_no_centre() -> None:
    """Its two edges face each other everywhere: not a point, unlike a square's."""
    bar = np.full((200, 240, 3), 60, np.uint8)
    bar[:, 110:125] = 190
    assert len(detect(build_pyramid(bar), "colsym", 10)) == 0
    square = np.full((200, 240, 3), 60, np.uint8)
    square[90:105, 110:125] = 190
    best = detect(build_pyramid(square), "colsym", 10)
    assert np.abs(best.xy[0] - (117, 97)).max() < 0.6
