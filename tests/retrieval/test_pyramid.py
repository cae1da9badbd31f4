"""The scale space of a photo."""

from itertools import pairwise

import cv2
import numpy as np
import pytest
from picture_scenes import facade

from retrieval.pyramid import build_pyramid


def test_each_level_shows_the_photo_at_its_stated_blur_and_place() -> None:
    pyramid = build_pyramid(facade())
    margin = 40
    for level in pyramid.sampling_levels()[1:10]:
        extra = (level.sigma**2 - 0.5**2) ** 0.5
        expected = cv2.GaussianBlur(pyramid.grey.astype(np.float64), (0, 0), extra)
        expected = expected[:: level.step, :: level.step]
        inner = slice(margin // level.step, -(margin // level.step))
        difference = np.abs(level.pixels - expected)[inner, inner]
        assert difference.max() < 6.0
        assert difference.mean() < 1.0


def test_sampling_levels_get_blurrier_one_by_one() -> None:
    sigmas = [level.sigma for level in build_pyramid(facade()).sampling_levels()]
    assert all(after > before for before, after in pairwise(sigmas))


def test_a_faded_photo_is_stretched_to_the_full_range() -> None:
    faded = (facade() * 0.3 + 100).astype(np.uint8)
    grey = build_pyramid(faded).grey
    low, high = np.percentile(grey, (1, 99))
    assert abs(low) < 5
    assert abs(high - 255) < 5


def test_the_smallest_and_the_thinnest_photos_have_a_pyramid() -> None:
    for shape in ((1, 1, 3), (1, 300, 3), (15, 15, 3)):
        assert build_pyramid(np.zeros(shape, np.uint8)).octaves == ()


@pytest.mark.parametrize(
    "picture",
    [np.zeros((4, 4), np.uint8), np.zeros((4, 4, 3), np.float32), np.zeros((0, 4, 3), np.uint8)],
)
def test_what_is_not_a_photo_is_refused_by_name(picture: np.ndarray) -> None:
    with pytest.raises(ValueError, match="expected \\(h, w, 3\\) uint8"):
        build_pyramid(picture)
