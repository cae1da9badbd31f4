"""The measures of features against closed forms and slow, plain counts."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.features.float_descriptors import describe_in_floats
from benchmarks.features.overlap import (
    View,
    correspondences,
    in_common_part,
    map_frames,
    one_to_one,
    overlap_errors,
    repeated,
)
from benchmarks.features.pairs import WidePair
from benchmarks.features.warps import (
    map_points,
    reduction,
    resample,
    turned_plane,
    warped_versions,
)
from benchmarks.features.wide_baseline import agreeing, fit_affine, predict
from contracts.config import DESCRIPTORS, Descriptor
from contracts.records import Frames
from retrieval.descriptors import describe
from retrieval.detectors import detect
from retrieval.pyramid import build_pyramid
from retrieval.selection import mean_radius, round_frames

Floats = NDArray[np.float64]


def _smooth_picture(height: int = 240, width: int = 320) -> NDArray[np.uint8]:
    """Blobs of several sizes, smooth enough to be compared after resampling."""
    row, column = np.mgrid[:height, :width]
    waves = np.sin(row / 9.0) * np.sin(column / 13.0) + np.sin((row + 2 * column) / 31.0)
    grey = np.clip(127 + 55 * waves, 0, 255).astype(np.uint8)
    return np.repeat(grey[:, :, None], 3, axis=2)


def _discs(xy: Floats, radius: Floats) -> Frames:
    ones = np.ones(len(xy), np.float32)
    return round_frames(np.asarray(xy, np.float32), np.asarray(radius, np.float32), ones)


def _random_frames(n: int, seed: int, side: float) -> Frames:
    rng = np.random.default_rng(seed)
    shape = np.zeros((n, 2, 2))
    shape[:, 0, 0] = rng.uniform(3, 9, n)
    shape[:, 1, 1] = rng.uniform(3, 9, n)
    shape[:, 1, 0] = rng.uniform(-3, 3, n)
    xy = rng.uniform(0, side, (n, 2))
    return Frames(xy.astype(np.float32), shape.astype(np.float32), np.ones(n, np.float32))


def _painted_error(first: Floats, second: Floats, offset: Floats) -> float:
    """1 - intersection / union of two shapes, by counting the pixels of a fine grid."""
    x, y = np.meshgrid(np.linspace(-20, 20, 801), np.linspace(-20, 20, 801))
    points = np.stack((x.ravel(), y.ravel()))
    one = (np.linalg.solve(first, points) ** 2).sum(axis=0) <= 1
    other = (np.linalg.solve(second, points - offset[:, None]) ** 2).sum(axis=0) <= 1
    return float(1 - (one & other).sum() / (one | other).sum())


@pytest.mark.parametrize("apart", [0.0, 3.0, 9.0, 14.0])
@pytest.mark.parametrize("other", [4.0, 10.0])
def test_overlap_of_two_discs_is_the_lens_of_the_formula(apart: float, other: float) -> None:
    one = 10.0
    if apart <= abs(one - other):
        lens = math.pi * min(one, other) ** 2
    elif apart >= one + other:
        lens = 0.0
    else:
        u = math.acos((apart**2 + one**2 - other**2) / (2 * apart * one))
        v = math.acos((apart**2 + other**2 - one**2) / (2 * apart * other))
        lens = one**2 * (u - math.sin(2 * u) / 2) + other**2 * (v - math.sin(2 * v) / 2)
    expected = 1 - lens / (math.pi * (one**2 + other**2) - lens)
    found = overlap_errors(
        one**2 * np.eye(2)[None], other**2 * np.eye(2)[None], np.array([[0.6, 0.8]]) * apart
    )
    assert found[0] == pytest.approx(expected, abs=0.003)


def test_overlap_of_ellipses_is_what_painting_them_gives() -> None:
    frames = _random_frames(12, 3, 6.0)
    shape, xy = frames.shape.astype(float), frames.xy.astype(float)
    first, second = shape[:6], shape[6:]
    offset = xy[6:] - xy[:6]
    found = overlap_errors(
        first @ first.transpose(0, 2, 1), second @ second.transpose(0, 2, 1), offset
    )
    expected = [_painted_error(*three) for three in zip(first, second, offset, strict=True)]
    assert found == pytest.approx(expected, abs=0.005)


@pytest.mark.parametrize("normalised", [True, False])
def test_prefilters_lose_no_correspondence(normalised: bool) -> None:
    one, other = _random_frames(150, 1, 50.0), _random_frames(150, 2, 50.0)
    found = correspondences(one, other, normalised=normalised)
    rows, columns = (grid.ravel() for grid in np.mgrid[:150, :150])
    factor = 30 / mean_radius(one.shape)[rows] if normalised else np.ones(len(rows))
    squared = [
        frames.shape.astype(float) @ frames.shape.astype(float).transpose(0, 2, 1)
        for frames in (one, other)
    ]
    offset = other.xy[columns].astype(float) - one.xy[rows]
    errors = overlap_errors(
        factor[:, None, None] ** 2 * squared[0][rows],
        factor[:, None, None] ** 2 * squared[1][columns],
        offset,
    )
    expected = set(zip(rows[errors <= 0.4], columns[errors <= 0.4], strict=True))
    assert len(expected) > 20
    assert set(zip(found.first, found.second, strict=True)) == expected
    assert (np.diff(found.error) >= 0).all()


def test_one_frame_repeats_once_however_many_lie_on_it() -> None:
    pile = _discs(np.full((5, 2), 50.0), np.full(5, 8.0))
    single = _discs(np.full((1, 2), 50.0), np.full(1, 8.0))
    found = correspondences(pile, single)
    assert len(found.first) == 5
    assert one_to_one(found) == 1


def test_the_photograph_itself_repeats_wholly_and_chance_does_not() -> None:
    view = View(_random_frames(100, 5, 200.0), (200, 200))
    found = repeated(view, view, np.eye(3))
    assert found.share == found.own_size == 1.0
    assert found.chance < 0.7
    same = 1 - np.eye(100, dtype=np.float32)
    assert found.matched(same[found.first][:, found.second]) == 1.0
    assert found.matched(np.roll(same, 1, axis=1)) < 0.2


def test_no_frames_repeat_nowhere() -> None:
    nothing = View(_random_frames(0, 0, 1.0), (100, 100))
    something = View(_random_frames(9, 0, 90.0), (100, 100))
    for one, other in ((nothing, something), (something, nothing), (nothing, nothing)):
        found = repeated(one, other, np.eye(3))
        assert (found.share, found.chance, found.own_size) == (0.0, 0.0, 0.0)


def test_a_mapped_frame_covers_the_mapped_rim() -> None:
    homography, _ = turned_plane(400, 300, 40)
    frames = _random_frames(5, 4, 250.0)
    mapped = map_frames(frames, homography)
    turn = np.linspace(0, 2 * np.pi, 9)
    circle = 0.1 * np.stack((np.cos(turn), np.sin(turn)))
    for i in range(5):
        rim = (frames.xy[i].astype(float)[:, None] + frames.shape[i] @ circle).T
        expected = mapped.xy[i][:, None] + mapped.shape[i] @ circle
        assert map_points(homography, rim) == pytest.approx(expected.T, abs=0.01)


@pytest.mark.parametrize(
    ("homography", "size"), [turned_plane(320, 240, 40), reduction(320, 240, 2)]
)
def test_resampled_pictures_show_the_scene_where_the_homography_says(
    homography: Floats, size: tuple[int, int]
) -> None:
    picture = _smooth_picture()
    warped = resample(picture, homography, size)
    assert warped.shape == (size[1], size[0], 3)
    column, row = np.meshgrid(np.arange(10, size[0] - 10), np.arange(10, size[1] - 10))
    there = np.stack((column.ravel(), row.ravel()), axis=1).astype(float)
    x, y = map_points(np.asarray(np.linalg.inv(homography)), there).T
    left, top = np.floor(x).astype(int), np.floor(y).astype(int)
    grey = picture[:, :, 0].astype(float)
    upper = grey[top, left] * (left + 1 - x) + grey[top, left + 1] * (x - left)
    lower = grey[top + 1, left] * (left + 1 - x) + grey[top + 1, left + 1] * (x - left)
    expected = upper * (top + 1 - y) + lower * (y - top)
    found = warped[row.ravel(), column.ravel(), 0]
    assert np.abs(found - expected).max() < 3.0


def test_every_pixel_of_a_warp_shows_the_photograph() -> None:
    picture = _smooth_picture()
    for warped in warped_versions(picture):
        height, width = warped.rgb.shape[:2]
        right, bottom = width - 1.0, height - 1.0
        corners = np.array([[0, 0], [right, 0], [0, bottom], [right, bottom]])
        frames = _discs(corners, np.ones(4))
        back = np.asarray(np.linalg.inv(warped.homography), np.float64)
        assert in_common_part(frames, back, picture.shape).all(), warped


def test_an_affine_map_is_found_from_its_points() -> None:
    rng = np.random.default_rng(8)
    truth = np.array([[1.2, -0.3, 40.0], [0.1, 0.8, -7.0]])
    source = rng.uniform(0, 800, (1, 6, 2))
    target = source @ truth[:, :2].T + truth[:, 2]
    assert fit_affine(source, target, rng.uniform(0.1, 1, (1, 6)))[0] == pytest.approx(truth)


def _pair_of_known_map(noise_px: float) -> WidePair:
    rng = np.random.default_rng(2)
    first = rng.uniform(50, 550, (40, 2))
    second = first @ np.array([[0.7, 0.1], [0.0, 0.9]]).T + 20
    blank = np.zeros((600, 600, 3), np.uint8)
    return WidePair("", blank, blank, first, second + rng.normal(0, noise_px, second.shape))


def test_frames_are_predicted_where_the_map_takes_them_and_only_there() -> None:
    frames = _random_frames(200, 6, 600.0)
    predicted = predict(_pair_of_known_map(0.0), frames)
    xy = frames.xy.astype(float)[predicted.rows] @ np.array([[0.7, 0.1], [0.0, 0.9]]).T + 20
    assert 100 < len(predicted.rows) < 200  # none outside the points' hull
    assert predicted.xy == pytest.approx(xy, abs=1e-6)
    grown = math.sqrt(0.63) * mean_radius(frames.shape)[predicted.rows]
    assert predicted.radius == pytest.approx(grown)
    exact = _discs(predicted.xy, predicted.radius)
    assert agreeing(predicted, exact).diagonal().all()
    larger = _discs(predicted.xy, 2.1 * predicted.radius)
    assert not agreeing(predicted, larger).diagonal().any()
    moved = _discs(predicted.xy + 9.0, predicted.radius)
    assert not agreeing(predicted, moved).diagonal().any()


def test_points_that_contradict_each_other_predict_nothing() -> None:
    predicted = predict(_pair_of_known_map(80.0), _random_frames(200, 6, 600.0))
    assert len(predicted.rows) < 5


@pytest.mark.parametrize("descriptor", DESCRIPTORS)
def test_descriptors_in_floats_round_to_the_bytes(descriptor: Descriptor) -> None:
    pyramid = build_pyramid(_smooth_picture())
    frames = detect(pyramid, "har", 60)
    assert len(frames) > 10
    floats = describe_in_floats(pyramid, frames)[descriptor]
    found = describe(pyramid, frames, [descriptor])[descriptor].astype(float)
    assert np.abs(found - np.clip(floats, 0, 255)).max() < 1.0
