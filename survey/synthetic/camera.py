"""Projection of a flat thing in space into a picture: pinhole cameras and homographies.

World axes: x east, y north, z up, metres. Camera axes: x right, y down, z along the optical axis.
Pixels: the centre of the top-left pixel is (0, 0).
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
NEAR_M = 0.2
"""Nothing closer to the camera than this is drawn."""


@dataclass(frozen=True, slots=True)
class View:
    """A camera in the world.

    Heading clockwise from grid north, pitch up positive, roll right side down positive, of the
    optical axis; `hfov_deg` spans the width of the picture.
    """

    easting: float
    northing: float
    altitude_m: float
    heading_deg: float
    pitch_deg: float
    roll_deg: float
    hfov_deg: float
    width_px: int
    height_px: int

    @property
    def centre(self) -> Floats:
        return np.array([self.easting, self.northing, self.altitude_m])

    def rotation(self) -> Floats:
        """(3, 3): rows are the camera's right, down and forward axes in the world."""
        heading, pitch, roll = np.radians([self.heading_deg, self.pitch_deg, self.roll_deg])
        ahead = np.array([np.sin(heading), np.cos(heading), 0.0])
        level = np.array([np.cos(heading), -np.sin(heading), 0.0])
        forward = ahead * np.cos(pitch) + np.array([0.0, 0.0, np.sin(pitch)])
        up = np.cross(level, forward)
        right = level * np.cos(roll) - up * np.sin(roll)
        return np.stack([right, np.cross(forward, right), forward])

    def intrinsics(self, scale: float = 1.0) -> Floats:
        """(3, 3) matrix from camera axes to pixels of the picture enlarged by `scale`."""
        width, height = self.width_px * scale, self.height_px * scale
        focal = width / 2 / np.tan(np.radians(self.hfov_deg) / 2)
        return np.array([[focal, 0, (width - 1) / 2], [0, focal, (height - 1) / 2], [0, 0, 1.0]])


def project(view: View, points: Floats) -> Floats:
    """Pixels (n, 2) of world points (n, 3); NaN for what lies behind the camera."""
    seen = (points - view.centre) @ view.rotation().T
    with np.errstate(divide="ignore", invalid="ignore"):
        pixels = (seen @ view.intrinsics().T)[:, :2] / seen[:, 2:]
    pixels[seen[:, 2] < NEAR_M] = np.nan
    return np.asarray(pixels, dtype=np.float64)


@dataclass(frozen=True, slots=True)
class Panel:
    """A flat upright (or lying) rectangle in the world.

    origin : (3,) its bottom-left corner. along, up : (3,) unit vectors to the right and upwards
    as its front is seen. Metres.
    """

    origin: Floats
    along: Floats
    up: Floats
    width_m: float
    height_m: float

    def point(self, across_m: float, up_m: float) -> Floats:
        """The world position (3,) of a place on the panel."""
        return np.asarray(self.origin + across_m * self.along + up_m * self.up)


@dataclass(frozen=True, slots=True)
class Lens:
    """A view made ready for many panels: its matrices and the size of the working picture."""

    centre: Floats
    matrix: Floats
    width_px: int
    height_px: int

    @classmethod
    def of(cls, view: View, scale: float = 1.0) -> "Lens":
        matrix = view.intrinsics(scale) @ view.rotation()
        size = round(view.width_px * scale), round(view.height_px * scale)
        return cls(view.centre, matrix, *size)

    def from_panel(self, panel: Panel) -> Floats:
        """Homography (3, 3) from metres on the panel (across, up, 1) to pixels.

        The third homogeneous coordinate is the depth in metres.
        """
        offset = panel.origin - self.centre
        return np.asarray(self.matrix @ np.column_stack([panel.along, panel.up, offset]))

    def outline(self, homography: Floats, span: tuple[float, float, float, float]) -> Floats:
        """Pixels (n, 2) of a rectangle (across0, up0, across1, up1), clipped at the near plane.

        n is 0 where nothing of it lies in front of the camera, else 3 to 5.
        """
        left, bottom, right, top = span
        corners = np.array([[left, bottom, 1], [right, bottom, 1], [right, top, 1], [left, top, 1]])
        rays = corners @ homography.T
        if (rays[:, 2] >= NEAR_M).all():
            return np.asarray(rays[:, :2] / rays[:, 2:])
        if (rays[:, 2] < NEAR_M).all():
            return np.empty((0, 2))
        kept: list[Floats] = []
        for ray, following in zip(rays, np.roll(rays, -1, axis=0), strict=True):
            if ray[2] >= NEAR_M:
                kept.append(ray)
            if (ray[2] >= NEAR_M) != (following[2] >= NEAR_M):
                share = (NEAR_M - ray[2]) / (following[2] - ray[2])
                kept.append(ray + share * (following - ray))
        clipped = np.stack(kept)
        return np.asarray(clipped[:, :2] / clipped[:, 2:])


def fill_mask(outline: Floats, shape: tuple[int, int]) -> NDArray[np.uint8]:
    """A polygon as a mask (H, W) of 0 and 255; far outside corners are no trouble."""
    mask = np.zeros(shape, dtype=np.uint8)
    shift = 4
    fixed = np.clip(np.rint(outline * (1 << shift)), -(2**26), 2**26).astype(np.int32)
    cv2.fillConvexPoly(mask, fixed, 255, cv2.LINE_8, shift)
    return mask
