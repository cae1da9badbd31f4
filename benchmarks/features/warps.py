"""Photographs changed in a way that is known exactly: by geometry, light, blur or compression."""

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

Picture = NDArray[np.uint8]
Matrix = NDArray[np.float64]

_SUPERSAMPLING = 4
_FOCAL_WIDTHS = 2.0
"""Focal length of the turned view, in widths of the picture."""
_TURNS_DEG = (20, 40, 60)
_REDUCTIONS = (1.5, 2.0, 3.0)
_SIGMAS = (1.5, 3.0)
_GAMMAS = (0.5, 2.0)
_QUALITIES = (30, 10)


@dataclass(frozen=True, slots=True)
class Warped:
    """A changed photograph.

    family : what was changed. degree : how much. homography : (3, 3), maps pixel centres of the
    photograph to those of `rgb`.
    """

    family: str
    degree: str
    rgb: Picture
    homography: Matrix


def warped_versions(rgb: Picture) -> Iterator[Warped]:
    """Yield every warp of a photograph, the mildest of each family first."""
    for degrees in _TURNS_DEG:
        homography, size = turned_plane(rgb.shape[1], rgb.shape[0], degrees)
        yield Warped("viewpoint", f"{degrees}°", resample(rgb, homography, size), homography)
    for factor in _REDUCTIONS:
        homography, size = reduction(rgb.shape[1], rgb.shape[0], factor)
        yield Warped("scale", f"1/{factor:g}", resample(rgb, homography, size), homography)
    for sigma in _SIGMAS:
        blurred = np.asarray(cv2.GaussianBlur(rgb, (0, 0), sigma), np.uint8)
        yield Warped("blur", f"{sigma:g} px", blurred, np.eye(3))
    for gamma in _GAMMAS:
        light = np.rint(255.0 * (np.arange(256) / 255.0) ** gamma).astype(np.uint8)
        yield Warped("light", f"gamma {gamma:g}", light[rgb], np.eye(3))
    yield Warped("light", "contrast 0.4", np.rint(0.4 * rgb + 70.0).astype(np.uint8), np.eye(3))
    for quality in _QUALITIES:
        yield Warped("JPEG", f"quality {quality}", _recompressed(rgb, quality), np.eye(3))
    yield Warped("faded print", "", faded_print(rgb), np.eye(3))


def turned_plane(width: int, height: int, degrees: float) -> tuple[Matrix, tuple[int, int]]:
    """Homography of a flat scene turned about its vertical axis, and the size of its picture.

    The picture is cut to the rectangle that the scene fills, so that no border shows.

    Returns
    -------
    (3, 3) float64 and (width, height).
    """
    focal = _FOCAL_WIDTHS * width
    cosine, sine = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    centred = np.array([[1, 0, -(width - 1) / 2], [0, 1, -(height - 1) / 2], [0, 0, 1.0]])
    turned = np.array([[cosine, 0, 0], [0, 1, 0], [sine / focal, 0, 1.0]]) @ centred
    corners = np.array([[-0.5, -0.5], [width - 0.5, -0.5]])
    (left, top), (right, other) = map_points(turned, corners)
    top = max(top, other)
    moved = np.array([[1, 0, -left - 0.5], [0, 1, -top - 0.5], [0, 0, 1.0]])
    return moved @ turned, (int(right - left), int(-2 * top))


def reduction(width: int, height: int, factor: float) -> tuple[Matrix, tuple[int, int]]:
    """Homography of a photograph reduced by `factor`, and the size of its picture."""
    shift = 0.5 / factor - 0.5
    homography = np.array([[1 / factor, 0, shift], [0, 1 / factor, shift], [0, 0, 1.0]])
    return homography, (int(width / factor), int(height / factor))


def resample(rgb: Picture, homography: Matrix, size: tuple[int, int]) -> Picture:
    """Show a photograph through a homography, each pixel the mean of 16 cubic samples.

    Parameters
    ----------
    homography : (3, 3), photograph -> result. size : (width, height) of the result.
    """
    n = _SUPERSAMPLING
    shift = (n - 1) / 2
    finer = np.array([[n, 0, shift], [0, n, shift], [0, 0, 1.0]])
    fine = cv2.warpPerspective(
        rgb,
        finer @ homography,
        (n * size[0], n * size[1]),
        flags=cv2.INTER_CUBIC,
        borderMode=cv2.BORDER_REPLICATE,
    )
    return np.asarray(cv2.resize(fine, size, interpolation=cv2.INTER_AREA), np.uint8)


def faded_print(rgb: Picture) -> Picture:
    """A print of low contrast and hardly any colour, scanned with noise (6) and grain (5)."""
    rng = np.random.default_rng(0)
    height, width = rgb.shape[:2]
    grey = rgb.mean(axis=2, keepdims=True)
    print_ = 95.0 + 0.4 * (0.15 * rgb + 0.85 * grey) + np.array([12.0, 4.0, -12.0])
    grain = cv2.GaussianBlur(rng.normal(0.0, 1.0, (height, width)), (0, 0), 1.0)
    print_ = print_ + (5.0 / grain.std()) * grain[:, :, None] + rng.normal(0.0, 6.0, rgb.shape)
    return np.asarray(np.clip(np.rint(print_), 0, 255), np.uint8)


def map_points(homography: Matrix, xy: Matrix) -> Matrix:
    """Map points (n, 2) by a homography."""
    mapped = xy @ homography[:, :2].T + homography[:, 2]
    return np.asarray(mapped[:, :2] / mapped[:, 2:], np.float64)


def _recompressed(rgb: Picture, quality: int) -> Picture:
    _, coded = cv2.imencode(".jpg", rgb[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, quality])
    decoded = np.asarray(cv2.imdecode(coded, cv2.IMREAD_COLOR), np.uint8)
    return np.ascontiguousarray(decoded[:, :, ::-1])
