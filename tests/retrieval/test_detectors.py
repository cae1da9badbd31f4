"""What every detector promises, and what some do."""

import numpy as np
import pytest
from numpy.typing import NDArray
from picture_scenes import facade, warp

from contracts.config import DETECTORS, Detector
from contracts.records import Frames
from retrieval.detectors import detect
from retrieval.detectors.affine import adapt_shapes
from retrieval.detectors.har import harris_response
from retrieval.detectors.hesaff import REGION_SIGMAS, hessian_response
from retrieval.pyramid import build_pyramid
from retrieval.selection import round_frames

WARPS = {
    "shift": np.array([[1, 0, 12.3], [0, 1, -7.6]]),
    "zoom": np.array([[1.25, 0, -50], [0, 1.25, -40]]),
    "affine": np.array([[0.9, 0.1, 10], [-0.08, 1.05, 12]]),
}


def _detect(picture: NDArray[np.uint8], detector: Detector, n: int = 400) -> Frames:
    return detect(build_pyramid(picture), detector, n)


def _repeatability(before: Frames, after: Frames, matrix: NDArray[np.float64]) -> float:
    """Share of frames found again within a quarter of the radius and 1.5 times the size."""
    moved = before.xy @ matrix[:, :2].T + matrix[:, 2]
    visible = ((moved > 25) & (moved < np.array([480, 360]) - 25)).all(axis=1)
    area = np.abs(np.linalg.det(before.shape)) * np.linalg.det(matrix[:, :2])
    other_area = np.abs(np.linalg.det(after.shape))
    found = 0
    for i in np.flatnonzero(visible):
        near = np.linalg.norm(after.xy - moved[i], axis=1) < max(2.5, 0.25 * area[i] ** 0.5)
        alike = np.abs(np.log(other_area / area[i])) < 2 * np.log(1.5)
        found += bool((near & alike).any())
    return found / int(visible.sum())


@pytest.mark.parametrize("name", WARPS)
@pytest.mark.parametrize("detector", DETECTORS)
def test_frames_move_with_the_picture(detector: Detector, name: str) -> None:
    bar = 0.55 if name == "zoom" else 0.7
    picture = facade()
    # Few before, many after: selection shall not decide what was found again.
    before = _detect(picture, detector, 150)
    after = _detect(warp(picture, WARPS[name]), detector, 1000)
    assert len(before) >= 50
    assert _repeatability(before, after, WARPS[name]) >= bar


@pytest.mark.parametrize("detector", DETECTORS)
def test_frames_are_best_first_few_enough_and_inside(detector: Detector) -> None:
    frames = _detect(facade(), detector, 100)
    assert 50 < len(frames) <= 100
    assert (np.diff(frames.response) <= 0).all()
    assert (frames.xy >= 0).all()
    assert (frames.xy <= (479, 359)).all()
    assert (np.linalg.det(frames.shape) > 0).all()
    assert frames.xy.dtype == frames.shape.dtype == frames.response.dtype == np.float32


@pytest.mark.parametrize("detector", DETECTORS)
def test_detection_is_deterministic(detector: Detector) -> None:
    first, second = _detect(facade(), detector), _detect(facade(), detector)
    assert first.xy.tobytes() == second.xy.tobytes()
    assert first.shape.tobytes() == second.shape.tobytes()


@pytest.mark.parametrize("detector", DETECTORS)
def test_nothing_is_found_where_nothing_is(detector: Detector) -> None:
    slope = np.repeat(np.linspace(90, 180, 200).astype(np.uint8)[:, None, None], 240, axis=1)
    for picture in (
        np.full((200, 240, 3), 255, np.uint8),
        np.zeros((200, 240, 3), np.uint8),
        np.repeat(slope, 3, axis=2),
        np.zeros((1, 1, 3), np.uint8),
        np.full((1, 500, 3), 40, np.uint8),
        np.full((17, 17, 3), 40, np.uint8),
    ):
        assert len(_detect(picture, detector)) == 0


@pytest.mark.parametrize("detector", DETECTORS)
def test_small_pictures_of_any_size_are_no_error(detector: Detector) -> None:
    for side in (2, 15, 16, 17, 31, 33, 40):
        frames = _detect(np.ascontiguousarray(facade()[:side, : side + 3]), detector)
        assert np.isfinite(frames.shape).all()


@pytest.mark.parametrize("detector", DETECTORS)
def test_a_faded_photo_still_has_most_of_its_frames(detector: Detector) -> None:
    faded = (facade() * 0.15 + 110).astype(np.uint8)
    assert len(_detect(faded, detector, 300)) >= 0.5 * len(_detect(facade(), detector, 300))


@pytest.mark.parametrize("detector", DETECTORS)
def test_masked_parts_and_the_masks_outline_yield_no_frames(detector: Detector) -> None:
    usable = np.ones((360, 480), np.bool_)
    usable[100:260, 150:330] = False
    blotted = facade()
    blotted[~usable] = 255
    frames = detect(build_pyramid(blotted), detector, 1000, usable)
    assert len(frames) > 50
    x, y = np.rint(frames.xy).astype(int).T
    assert usable[y, x].all()
    # A corner of the blot is seen by any corner detector unless its frame is dropped.
    for corner in ((150, 100), (330, 100), (150, 260), (330, 260)):
        gap = np.linalg.norm(frames.xy - np.array(corner, np.float32), axis=1)
        assert (gap > 2.0).all()


def test_hesaff_and_mser_shapes_keep_the_vertical_upright() -> None:
    for detector in ("hesaff", "mser"):
        shape = _detect(facade(), detector).shape
        assert (shape[:, 0, 1] == 0).all()
        assert (shape[:, 0, 0] > 0).all()
        assert (shape[:, 1, 1] > 0).all()


def _spot(sigma_x: float, sigma_y: float) -> NDArray[np.uint8]:
    y, x = np.mgrid[:201, :201] - 100.0
    spot = 40 + 180 * np.exp(-0.5 * ((x / sigma_x) ** 2 + (y / sigma_y) ** 2))
    return np.repeat(spot.astype(np.uint8)[:, :, None], 3, axis=2)


@pytest.mark.parametrize("sigma", [3.0, 5.0, 8.0, 12.0])
def test_hesaff_finds_the_scale_and_place_of_a_gaussian_spot(sigma: float) -> None:
    best = _detect(_spot(sigma, sigma), "hesaff")
    assert np.abs(best.xy[0] - 100).max() < 0.2
    scale = np.linalg.det(best.shape[0]) ** 0.5 / REGION_SIGMAS
    assert scale == pytest.approx(sigma, rel=0.12)


@pytest.mark.parametrize(("across", "along"), [(6.0, 9.0), (9.0, 6.0), (5.0, 9.0)])
def test_affine_adaptation_measures_a_stretched_spot(across: float, along: float) -> None:
    pyramid = build_pyramid(_spot(across, along))
    radius = np.array([REGION_SIGMAS * (across * along) ** 0.5], np.float32)
    start = round_frames(np.array([[100, 100]], np.float32), radius, np.ones(1, np.float32))
    (shape,) = adapt_shapes(pyramid, start, REGION_SIGMAS).shape
    # Fixed smoothing rounds a stretched spot off; the direction and most of the ratio remain.
    assert shape[1, 1] / shape[0, 0] == pytest.approx(along / across, rel=0.25)
    assert (shape[1, 1] > shape[0, 0]) == (along > across)


def test_responses_agree_with_plain_numpy() -> None:
    pixels = np.random.default_rng(0).uniform(0, 255, (30, 40)).astype(np.float32)
    p = pixels.astype(np.float64)
    dxx = p[1:-1, :-2] + p[1:-1, 2:] - 2 * p[1:-1, 1:-1]
    dyy = p[:-2, 1:-1] + p[2:, 1:-1] - 2 * p[1:-1, 1:-1]
    dxy = (p[2:, 2:] - p[2:, :-2] - p[:-2, 2:] + p[:-2, :-2]) / 4
    expected = 1.7**4 * (dxx * dyy - dxy**2)
    assert np.allclose(hessian_response(pixels, 1.7)[1:-1, 1:-1], expected, rtol=1e-3, atol=5)


def test_harris_prefers_a_corner_to_an_edge() -> None:
    picture = np.zeros((80, 80), np.float32)
    picture[40:, 40:] = 200
    response = harris_response(picture, 1.6)
    row, column = np.unravel_index(response.argmax(), response.shape)
    assert max(abs(row - 40), abs(column - 40)) <= 1
    assert response[70, 40] < 0
    assert response[10, 10] == 0
