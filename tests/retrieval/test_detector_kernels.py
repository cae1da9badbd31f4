"""The compiled loops of hesaff, har and colsym, beside slow and obvious ones."""

from collections import Counter

import numpy as np
import pytest
from numpy.typing import NDArray
from picture_scenes import facade
from scipy import linalg, ndimage

from retrieval.detectors import har
from retrieval.detectors.affine import adapt_shapes, second_moment_shapes
from retrieval.detectors.extrema import find_extrema
from retrieval.pyramid import Pyramid, build_pyramid
from retrieval.selection import round_frames

Plane = NDArray[np.float32]
Exact = NDArray[np.float64]
SIZES = [(1, 1), (1, 9), (9, 1), (2, 7), (3, 3), (4, 30), (5, 5), (23, 31)]
SLACK = 1e-9
"""What lies exactly on a limit passes, however an oracle's own arithmetic rounds it."""


def _random(
    seed: int, size: tuple[int, ...], blur: tuple[float, ...] = (1.0, 1.0), grain: float = 1 / 64
) -> Plane:
    """Random values of deviation 96, blurred by so much along each axis.

    Multiples of `grain`, a power of two, which float32 subtracts exactly; a coarse one gives ties.
    """
    rough = np.random.default_rng(seed).normal(0, 1, size)
    smooth = ndimage.gaussian_filter(rough, blur, mode="wrap")
    return np.asarray(np.rint(96 * smooth / (smooth.std() + SLACK) / grain) * grain, np.float32)


def _beats_its_neighbours(planes: Exact, row: int, column: int) -> bool:
    """In the middle plane; of equal neighbours the first by plane, row and column wins."""
    block = planes[:, row - 1 : row + 2, column - 1 : column + 2].ravel()
    middle = len(block) // 2
    block = block * np.sign(block[middle])
    before, after = block[:middle], block[middle + 1 :]
    return bool(before.max() < block[middle] >= after.max())


def _derivatives(stack: Exact) -> tuple[Exact, Exact]:
    """Gradient (h, w, 3) and Hessian (h, w, 3, 3) of the middle plane along x, y and scale."""
    axes = (2, 1, 0)
    slopes = [np.gradient(stack, axis=axis) for axis in axes]
    bends = [[np.gradient(slope, axis=axis)[1] for axis in axes] for slope in slopes]
    for i, axis in enumerate(axes):
        bends[i][i] = ndimage.correlate1d(stack, [1.0, -2.0, 1.0], axis=axis)[1]
    return np.stack([slope[1] for slope in slopes], -1), np.array(bends).transpose(2, 3, 0, 1)


def _refined(stack: Exact, row: int, column: int) -> tuple[str, list[float]]:
    """What becomes of an extremum; x, y, offset in scale and response if it is kept."""
    gradient, hessian = _derivatives(stack)
    for n_moves in range(5):
        slope, bend = gradient[row, column], hessian[row, column]
        flat, steep = sorted(linalg.eigvalsh(bend[:2, :2]), key=abs)
        if flat * steep <= SLACK or steep / flat > 10 + SLACK:
            return "edge", []
        if abs(linalg.det(bend)) < SLACK:
            return "flat", []
        offset = np.linalg.solve(bend, -slope)
        right, down = (np.sign(offset) * (np.abs(offset) > 0.6 + SLACK)).astype(int)[:2]
        if right == 0 and down == 0:
            if abs(offset[2]) > 1 + SLACK:
                return "other scale", []
            response = abs(stack[1, row, column] + slope @ offset / 2)
            return f"moved {n_moves}", [column + offset[0], row + offset[1], offset[2], response]
        row, column = row + down, column + right
        if not (0 < row < stack.shape[1] - 1 and 0 < column < stack.shape[2] - 1):
            return "left", []
    return "ran away", []


def _extrema(planes: Plane, floor: float) -> tuple[Exact, Counter[str]]:
    """Every extremum by brute force, in reading order, and what became of how many."""
    stack = planes.astype(np.float64)
    _, height, width = stack.shape
    outcomes = [
        _refined(stack, row, column)
        for row in range(2, height - 2)
        for column in range(2, width - 2)
        if abs(stack[1, row, column]) > floor and _beats_its_neighbours(stack, row, column)
    ]
    found = [values for _, values in outcomes if values]
    return np.array(found).reshape(-1, 4), Counter(outcome for outcome, _ in outcomes)


def _find(planes: Plane, floor: float) -> Plane:
    return find_extrema(planes[0], planes[1], planes[2], floor)


STACK = (3, 60, 72)
FIELDS = [
    (_random(23, STACK, (0.5, 1.0, 1.0)), {"left", "ran away"}),
    (_random(37, STACK, (0.5, 1.0, 1.0), 32), set()),
    (_random(128, STACK, (0.5, 1.0, 1.0), 64), {"other scale"}),
    (_random(4, STACK, (0.4, 0.8, 3.0)), {"edge", "moved 0", "moved 1", "moved 3"}),
    (_random(462, STACK, (0.5, 1.0, 1.0), 32), {"moved 4"}),
    (_random(29, STACK, (0.5, 1.0, 1.0), 128), {"flat"}),
]


@pytest.mark.parametrize("floor", [0.0, 96.0])
@pytest.mark.parametrize(("planes", "seen"), FIELDS)
def test_extrema_beat_26_neighbours_and_move_to_the_top_of_the_fit(
    planes: Plane, seen: set[str], floor: float
) -> None:
    expected, outcomes = _extrema(planes, floor)
    assert floor > 0 or seen <= set(outcomes)
    assert np.allclose(_find(planes, floor), expected, rtol=1e-5, atol=1e-4)


@pytest.mark.parametrize("size", SIZES)
def test_flat_responses_of_any_size_have_no_extrema(size: tuple[int, int]) -> None:
    for level, beside in ((-9, -9), (-9, -4), (0, 0), (9, 9), (9, 4)):
        planes = np.empty((3, *size), np.float32)
        planes[:] = np.array([beside, level, beside])[:, None, None]
        assert _find(planes, 0.0).shape == (0, 4)


@pytest.mark.parametrize("sign", [1, -1])
def test_extrema_keep_two_pixels_off_the_border_and_exceed_the_floor(sign: int) -> None:
    for row in range(7):
        for column in range(7):
            planes = np.zeros((3, 7, 7), np.float32)
            planes[:, row, column] = sign * np.array((4, 8, 4))
            expected = [[column, row, 0, 8]] if 1 < row < 5 and 1 < column < 5 else []
            assert _find(planes, 7.9).tolist() == expected
            assert len(_find(planes, 8.0)) == 0


@pytest.mark.parametrize("sigma", [1.0, 1.6, 3.2])
@pytest.mark.parametrize("size", SIZES)
def test_harris_measures_gradients_weighed_by_a_gaussian_1_4_times_as_wide(
    size: tuple[int, int], sigma: float
) -> None:
    pixels, planes = _random(2, size), np.zeros((3, *size))
    if min(size) > 2:
        gy, gx = sigma * np.array(np.gradient(pixels.astype(np.float64)))[:, 1:-1, 1:-1]
        planes[:, 1:-1, 1:-1] = gx * gx, gx * gy, gy * gy
    assert np.allclose(har.gradient_products(pixels, sigma), planes, rtol=1e-5)
    reach = int(np.ceil(2 * 1.4 * sigma))
    weight = np.exp(-0.5 * (np.arange(-reach, reach + 1) / (1.4 * sigma)) ** 2)
    for axis in (1, 2):
        planes = ndimage.correlate1d(planes, weight / weight.sum(), axis=axis, mode="mirror")
    matrix = planes[[[0, 1], [1, 2]]].transpose(2, 3, 0, 1)
    squared_trace = np.trace(matrix, axis1=2, axis2=3) ** 2
    expected = np.linalg.det(matrix) - 0.06 * squared_trace
    bound = 1e-5 * squared_trace.max()
    assert np.abs(har.harris_response(pixels, sigma) - expected).max() <= bound
    xx, xy, yy = planes.astype(np.float32)
    assert np.abs(har.corner_measure(xx, xy, yy) - expected).max() <= bound


def _vertex(before: float, at: float, after: float) -> float:
    square, straight, _ = np.polyfit([-1, 0, 1], [before, at, after], 2)
    return float(np.clip(-straight / (2 * square), -0.5, 0.5)) if square < -SLACK else 0.0


def _corners(response: Plane, images: list[Plane], floor: float) -> Exact:
    """Peaks of the response at which scale-normalised |Laplacian|s are strongest in between."""
    measure = response.astype(np.float64)
    laplacians = [
        np.abs(ndimage.laplace(image.astype(np.float64))) * 2 ** (2 * i / 3)
        for i, image in enumerate(images, start=-1)
    ]
    found = []
    for row in range(2, response.shape[0] - 2):
        for column in range(2, response.shape[1] - 2):
            at = measure[row, column]
            if at <= floor or not _beats_its_neighbours(measure[None], row, column):
                continue
            before, middle, after = (float(plane[row, column]) for plane in laplacians)
            if middle >= max(before, after):
                x = column + _vertex(measure[row, column - 1], at, measure[row, column + 1])
                y = row + _vertex(measure[row - 1, column], at, measure[row + 1, column])
                found.append([x, y, _vertex(before, middle, after), at])
    return np.array(found).reshape(-1, 4)


@pytest.mark.parametrize("floor", [0.0, 9.0])
@pytest.mark.parametrize("grain", [1 / 64, 32])
def test_corners_peak_in_the_picture_and_their_laplacian_over_scale(
    grain: float, floor: float
) -> None:
    response = _random(3, (70, 80), grain=grain)
    below, level, above = (_random(seed, (70, 80), (2.0, 2.0)) for seed in (4, 5, 6))
    above /= 2
    found = har.laplacian_corners(response, below, level, above, floor)
    assert len(found) > 15
    expected = _corners(response, [below, level, above], floor)
    assert np.allclose(found, expected, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("size", SIZES)
def test_a_flat_response_has_no_corners_whatever_the_picture(size: tuple[int, int]) -> None:
    below, level, above = (_random(seed, size) for seed in (4, 5, 6))
    flat = np.full(size, 9, np.float32)
    assert har.laplacian_corners(flat, below, level, above, 1.0).shape == (0, 4)


def _window() -> Exact:
    """A Gaussian of three deviations to the edge of a disc, where it ends."""
    away = np.hypot(*np.mgrid[-9:10, -9:10]) / 9
    return np.where(away <= 1, np.exp(-0.5 * (3 * away) ** 2), 0.0)


def _adapted(pixels: Plane, x: float, y: float, scale: float) -> tuple[str, Exact]:
    """Why the iteration stops, and the matrix A A of the ellipse; zero if it did not converge."""
    window, nothing = _window(), np.zeros((2, 2))
    v, u = np.mgrid[:19, :19] - 9.0
    a = np.eye(2)
    for _ in range(16):
        at_x, at_y = np.tensordot(a * scale / 1.6, np.stack((u, v)), 1)
        at_x, at_y = at_x + x, at_y + y
        bottom, right = np.array(pixels.shape) - 1
        if min(at_x.min(), at_y.min()) < 0 or at_x.max() >= right or at_y.max() >= bottom:
            return "left", nothing
        patch = ndimage.map_coordinates(pixels.astype(np.float64), (at_y, at_x), order=1)
        gy, gx = 2 * np.array(np.gradient(patch))[:, 1:-1, 1:-1]
        xx, xy, yy = ((window[1:-1, 1:-1] * g).sum() for g in (gx * gx, gx * gy, gy * gy))
        moments = np.array([[xx, xy], [xy, yy]])
        if xx + yy < SLACK or linalg.det(moments) <= 1e-8 * (xx + yy) ** 2:
            return "flat", nothing
        small, large = linalg.eigvalsh(moments)
        if small / large > 0.95**2:
            return "converged", a @ a
        step = linalg.inv(linalg.sqrtm(moments / linalg.det(moments) ** 0.5))
        a = linalg.sqrtm(a @ step @ step @ a)
        thin, wide = linalg.eigvalsh(a)
        if wide / thin > 6:
            return "stretched", nothing
    return "unsettled", nothing


def _level() -> Plane:
    """Clutter on the left; on the right faint clutter over stripes and a flat corner."""
    grey = facade(180, 240)[:, :, 0].astype(np.float64)
    stripes = 60 * np.sin(np.arange(240) / 3.0)
    grey[:, 120:], grey[120:, 160:] = (stripes + 0.12 * grey)[:, 120:], 90
    return np.asarray(ndimage.gaussian_filter(grey, 1.6), np.float32)


def test_shapes_are_what_the_iteration_by_matrix_roots_ends_at() -> None:
    # By this seed one converges in the last round, and one would in the next.
    pixels, rng = _level(), np.random.default_rng(285)
    xy = rng.uniform((0, 0), (239, 179), (160, 2)).astype(np.float32)
    scale = rng.uniform(1.0, 3.5, 160).astype(np.float32)
    shape = second_moment_shapes(pixels, xy, scale, _window().astype(np.float32))
    ends: Counter[str] = Counter()
    for found, (x, y), size in zip(shape.astype(np.float64), xy, scale, strict=True):
        end, expected = _adapted(pixels, float(x), float(y), float(size))
        ends[end] += 1
        assert np.allclose(found @ found.T, expected, rtol=1e-4, atol=1e-4)
        if end == "converged":
            assert found[0, 1] == 0
            assert np.linalg.det(found) == pytest.approx(1.0, rel=1e-5)
    assert len(ends) == 5
    assert min(ends.values()) >= 5


def test_flat_pictures_and_windows_beyond_the_border_give_no_shape() -> None:
    window, two = _window().astype(np.float32), np.full(1, 2.0, np.float32)
    for size in ((1, 1), (3, 40), (60, 60)):
        centre = np.array([[size[1] / 2, size[0] / 2]], np.float32)
        assert not second_moment_shapes(np.full(size, 9, np.float32), centre, two, window).any()
    spot = (99 * np.exp(-0.5 * (np.hypot(*np.mgrid[-15:16, -15:16]) / 4) ** 2)).astype(np.float32)
    # Half the window is 9 steps of 2 / 1.6 pixels.
    for low, high, n_found in ((11.2, 18.8, 0), (11.3, 18.7, 1)):
        for x, y in ((low, 15), (15, low), (high, 15), (15, high)):
            pixels = ndimage.shift(spot, (y - 15, x - 15), order=1, mode="nearest")
            found = second_moment_shapes(pixels, np.array([[x, y]], np.float32), two, window)
            assert found.any() == n_found, (x, y)


def _ellipse(pyramid: Pyramid, x: float, y: float, sigma: float) -> Exact:
    """Of a frame, by the level next to two thirds of an octave sharper; of determinant 1."""
    levels = [level for octave in pyramid.octaves for level in octave[:-2]]
    at = min(levels, key=lambda level: abs(np.log2(sigma / level.sigma) - 2 / 3))
    return _adapted(at.pixels, x / at.step, y / at.step, sigma / at.step)[1]


def test_frames_that_converge_are_adapted_on_a_sharper_level_and_keep_their_order() -> None:
    pyramid, rng = build_pyramid(facade(240, 320)), np.random.default_rng(6)
    xy = rng.uniform((30, 30), (290, 210), (60, 2)).astype(np.float32)
    sigma = np.exp2(rng.uniform(0.7, 3.7, 60)).astype(np.float32)
    frames = round_frames(xy, 3 * sigma, np.arange(60, dtype=np.float32))
    adapted = adapt_shapes(pyramid, frames, 3.0)
    expected = [_ellipse(pyramid, *one) for one in np.column_stack((xy, sigma)).tolist()]
    rows = [i for i, ellipse in enumerate(expected) if ellipse.any()]
    assert len(rows) > 20
    assert adapted.response.tolist() == rows
    assert np.array_equal(adapted.xy, xy[rows])
    for found, row in zip(adapted.shape.astype(np.float64) / 3, rows, strict=True):
        assert np.allclose(found @ found.T / sigma[row] ** 2, expected[row], atol=1e-3)
