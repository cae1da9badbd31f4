"""The component tree and the maximally stable regions in it, beside slow and obvious ones."""

from dataclasses import dataclass

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import ndimage

from contracts.records import Frames
from retrieval.detectors import detect
from retrieval.detectors.component_tree import TOP_LEVEL, ComponentTree, build_tree, region_moments
from retrieval.detectors.mser import area_variation, distinct_regions, moment_ellipses
from retrieval.pyramid import build_pyramid

Picture = NDArray[np.uint8]
Pixels = frozenset[tuple[int, int]]


@dataclass(frozen=True)
class Region:
    """Pixels (x, y), and the lowest level at which they are a region."""

    level: int
    pixels: Pixels


def _regions_at(grey: Picture, level: int) -> set[Pixels]:
    labels, n = ndimage.label(grey <= level)
    places = (np.nonzero(labels == i + 1) for i in range(n))
    return {frozenset(zip(x.tolist(), y.tolist(), strict=True)) for y, x in places}


def _regions(grey: Picture, min_area: int = 1) -> set[Region]:
    return {
        Region(max(int(grey[y, x]) for x, y in pixels), pixels)
        for level in range(TOP_LEVEL + 1)
        for pixels in _regions_at(grey, level)
        if len(pixels) >= min_area
    }


def _listed(tree: ComponentTree) -> list[Region]:
    listed = []
    for level, begin, end in zip(tree.level, tree.begin, tree.end, strict=True):
        row, column = np.divmod(tree.order[begin:end].astype(int), tree.width)
        pixels = frozenset(zip((column - 1).tolist(), (row - 1).tolist(), strict=True))
        listed.append(Region(int(level), pixels))
    return listed


def _pictures() -> list[Picture]:
    rng = np.random.default_rng(3)
    smooth = cv2.GaussianBlur(rng.normal(0, 1, (24, 31)), (0, 0), 1.5)
    smooth = (smooth - smooth.min()) / (smooth.max() - smooth.min()) * TOP_LEVEL
    return [
        rng.integers(0, 4, (9, 14), dtype=np.uint8),
        rng.integers(0, TOP_LEVEL + 1, (12, 7), dtype=np.uint8),
        smooth.astype(np.uint8),
        (smooth / 20).astype(np.uint8),
        rng.integers(0, 9, (1, 40), dtype=np.uint8),
        rng.integers(0, 9, (40, 1), dtype=np.uint8),
        np.full((5, 6), TOP_LEVEL, np.uint8),
        np.zeros((1, 1), np.uint8),
    ]


@pytest.mark.parametrize("min_area", [1, 5])
@pytest.mark.parametrize("grey", _pictures())
def test_the_tree_holds_what_every_threshold_cuts_out(grey: Picture, min_area: int) -> None:
    tree = build_tree(grey, min_area)
    listed = _listed(tree)
    assert len(set(listed)) == len(listed)
    assert set(listed) == _regions(grey, min_area)
    assert sorted(tree.order) == sorted(
        (y + 1) * tree.width + x + 1 for y in range(grey.shape[0]) for x in range(grey.shape[1])
    )


@pytest.mark.parametrize("grey", _pictures())
def test_a_regions_parent_is_the_smallest_around_it(grey: Picture) -> None:
    tree = build_tree(grey, 1)
    listed = _listed(tree)
    for i, region in enumerate(listed):
        around = [other for other in listed if other.pixels > region.pixels]
        smallest = min(around, key=lambda other: len(other.pixels), default=None)
        assert (listed[tree.parent[i]] if tree.parent[i] >= 0 else None) == smallest


@pytest.mark.parametrize("grey", _pictures())
def test_moments_are_those_of_the_regions_pixels(grey: Picture) -> None:
    tree = build_tree(grey, 2)
    moments = region_moments(tree, np.arange(len(tree.level)))
    for region, measured in zip(_listed(tree), moments, strict=True):
        x, y = np.array(sorted(region.pixels)).T
        (xx, xy), (_, yy) = np.cov(x, y, bias=True)
        assert np.allclose(measured, (x.mean(), y.mean(), xx, xy, yy), atol=1e-9)


def test_moments_of_some_regions_do_not_depend_on_the_others() -> None:
    tree = build_tree(_pictures()[2], 5)
    every = region_moments(tree, np.arange(len(tree.level)))
    rows = np.random.default_rng(0).permutation(len(every))[: len(every) // 4]
    some = region_moments(tree, rows)
    assert np.array_equal(some, every[rows])
    assert region_moments(tree, rows[:0]).shape == (0, 5)


def test_a_large_picture_is_one_region_of_exact_moments() -> None:
    height, width = 1500, 2000
    tree = build_tree(np.zeros((height, width), np.uint8), 30)
    assert tree.area.tolist() == [height * width]
    (x, y, xx, xy, yy) = region_moments(tree, np.arange(len(tree.level)))[0]
    assert (x, y) == ((width - 1) / 2, (height - 1) / 2)
    assert xx == pytest.approx((width**2 - 1) / 12, rel=1e-9)
    assert yy == pytest.approx((height**2 - 1) / 12, rel=1e-9)
    assert abs(xy) < 1e-3


@pytest.mark.parametrize("grey", [np.full((3, 3), 255, np.uint8), np.empty((0, 3), np.uint8)])
def test_a_picture_without_room_for_the_mark_or_without_pixels_is_refused(grey: Picture) -> None:
    with pytest.raises(ValueError, match="none above 254"):
        build_tree(grey, 1)


def _variation(grey: Picture, region: Region, delta: int, min_area: int) -> float:
    above = next(
        pixels
        for pixels in _regions_at(grey, region.level + delta)
        if pixels >= region.pixels and len(pixels) >= min_area
    )
    below = [
        len(pixels)
        for pixels in _regions_at(grey, region.level - delta)
        if pixels <= region.pixels and len(pixels) >= min_area
    ]
    return (len(above) - max(below, default=0)) / len(region.pixels)


@pytest.mark.parametrize(("delta", "min_area"), [(1, 1), (3, 4), (25, 1)])
@pytest.mark.parametrize("grey", _pictures())
def test_variation_is_that_of_thresholds_below_and_above(
    grey: Picture, delta: int, min_area: int
) -> None:
    tree = build_tree(grey, min_area)
    measured = area_variation(tree.level, tree.area, tree.parent, delta)
    expected = [_variation(grey, region, delta, min_area) for region in _listed(tree)]
    assert np.allclose(measured, expected, rtol=1e-6)


def _alike(one: Pixels, other: Pixels) -> bool:
    small, large = sorted((one, other), key=len)
    return small <= large and len(large) < 1.4 * len(small)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("grey", _pictures())
def test_of_nested_regions_alike_the_best_is_kept(grey: Picture, seed: int) -> None:
    tree = build_tree(grey, 2)
    listed = _listed(tree)
    rows = np.random.default_rng(seed).permutation(len(listed))[: 1 + len(listed) // 2]
    rows = rows[: len(listed)].astype(np.intp)
    kept: list[Pixels] = []
    expected = []
    for row in rows:
        expected.append(not any(_alike(listed[row].pixels, other) for other in kept))
        if expected[-1]:
            kept.append(listed[row].pixels)
    assert distinct_regions(rows, tree.area, tree.parent).tolist() == expected


def test_a_region_becomes_the_ellipse_of_its_moments() -> None:
    turn = np.radians(30)
    true = np.array([[20 * np.cos(turn), -8 * np.sin(turn)], [20 * np.sin(turn), 8 * np.cos(turn)]])
    y, x = np.mgrid[:100, :120]
    seen = np.linalg.inv(true) @ np.stack((x.ravel() - 60.5, y.ravel() - 45.25))
    inner = ((seen**2).sum(axis=0) <= 1).reshape(x.shape)
    tree = build_tree(np.where(inner, 90, 200).astype(np.uint8), 1)
    xy, moments = np.split(region_moments(tree, np.arange(len(tree.level))), [2], 1)
    (shape, _) = moment_ellipses(*moments.T)
    assert np.abs(xy[0] - (60.5, 45.25)).max() < 0.2
    assert np.allclose(shape @ shape.T, 4 * np.cov(x[inner], y[inner], bias=True), rtol=1e-4)
    assert np.allclose(shape @ shape.T, true @ true.T, rtol=0.03, atol=3)
    assert shape[0, 1] == 0


def test_lines_and_far_stretched_regions_have_no_ellipse() -> None:
    xx, yy = np.array([[133.0, 0.0], [0.0, 133.0], [133.0, 1.0], [133.0, 2.0]]).T
    shape = moment_ellipses(xx, np.zeros(4), yy)
    assert (shape[:3] == 0).all()
    assert np.allclose(shape[3], np.diag(2 * np.sqrt([133.0, 2.0])))


def _discs(blur: tuple[float, float], dark: int = 60, bright: int = 190) -> Frames:
    picture = np.full((160, 320), 125.0, np.float32)
    for i, grey in enumerate((dark, bright)):
        disc = np.full((160, 160), 125.0, np.float32)
        cv2.circle(disc, (80, 80), 20, float(grey), -1, cv2.LINE_AA)
        picture[:, 160 * i : 160 * (i + 1)] = cv2.GaussianBlur(disc, (0, 0), blur[i])
    rgb = np.repeat(np.rint(picture).astype(np.uint8)[:, :, None], 3, axis=2)
    return detect(build_pyramid(rgb), "mser", 1000)


def test_dark_and_bright_discs_are_found_alike_in_place_and_size() -> None:
    frames = _discs((0.8, 0.8))
    for x in (80, 240):
        best = np.flatnonzero(np.abs(frames.xy - (x, 80)).max(axis=1) < 1)[0]
        assert np.abs(frames.xy[best] - (x, 80)).max() < 0.1
        assert np.allclose(frames.shape[best], 20.5 * np.eye(2), atol=0.5)


def test_the_sharper_of_two_discs_ranks_first() -> None:
    assert abs(_discs((0.8, 6.0)).xy[0, 0] - 80) < 1
    assert abs(_discs((6.0, 0.8)).xy[0, 0] - 240) < 1
