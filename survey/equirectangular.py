"""Perspective views of an equirectangular panorama: where their pixels come from.

Angles grow in columns and rows: the middle column looks ahead, the middle row at the panorama's
own horizon. A pixel is the mean over its square, so that the centre of the first one lies half a
pixel inside the picture.
"""

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from geo.attitude import Attitude, enu_from_rdf
from survey.fragments import View

_SEAM_PX = 4
"""Columns repeated beyond either edge: what cubic interpolation reaches, and one more."""


@dataclass(frozen=True, slots=True)
class PanoramaArea:
    """The part of the sphere that a picture shows, as fractions of the whole panorama's sides.

    left, top : from its left (behind) and upper (zenith) edge. width, height : in (0, 1].
    """

    left: float = 0.0
    top: float = 0.0
    width: float = 1.0
    height: float = 1.0

    @property
    def is_all_round(self) -> bool:
        """Whether the right edge continues at the left one."""
        return self.width > 1.0 - 1e-6


def view_side_px(panorama_width_px: float, area: PanoramaArea, fov_deg: float) -> int:
    """Side of a view as fine in its middle as the panorama: one radian is W / 2 pi pixels."""
    per_radian = panorama_width_px / area.width / math.tau
    return max(1, round(2.0 * per_radian * math.tan(math.radians(fov_deg) / 2.0)))


def panorama_width_px(side_px: float, area: PanoramaArea, fov_deg: float) -> float:
    """Width of the panorama that is as fine as a view of `side_px`; inverse of `view_side_px`."""
    per_radian = side_px / 2.0 / math.tan(math.radians(fov_deg) / 2.0)
    return per_radian * math.tau * area.width


def perspective(
    panorama: NDArray[np.uint8], area: PanoramaArea, view: View, side_px: int
) -> NDArray[np.uint8]:
    """Cut a view out, by cubic interpolation.

    The panorama should be about as fine as the view (`panorama_width_px`): a finer one would
    alias. Where the view looks past the edge of a cropped panorama, the edge is drawn out.

    Parameters
    ----------
    panorama : (h, w, 3) or (h, w) uint8, upright.

    Returns
    -------
    (side_px, side_px, 3) or (side_px, side_px) uint8.
    """
    height, width = panorama.shape[:2]
    right, down = np.meshgrid(*[_tangents(side_px, view.fov_deg)] * 2)
    rays = np.stack([right, down, np.ones_like(right)], axis=-1)
    # In the panorama's own frame: x to the right of its middle column, y ahead, z up.
    x, y, z = np.moveaxis(rays @ enu_from_rdf(Attitude(view.yaw_deg, view.pitch_deg, 0.0)).T, -1, 0)
    columns = (np.arctan2(x, y) / math.tau + 0.5 - area.left) / area.width * width - 0.5
    rows = (0.5 - np.arctan2(z, np.hypot(x, y)) / math.pi - area.top) / area.height * height - 0.5
    if area.is_all_round:
        sides = (0, 0, _SEAM_PX, _SEAM_PX)
        panorama = np.asarray(cv2.copyMakeBorder(panorama, *sides, cv2.BORDER_WRAP), np.uint8)
        columns = columns % width + _SEAM_PX
    cut = cv2.remap(
        panorama,
        columns.astype(np.float32),
        rows.astype(np.float32),
        cv2.INTER_CUBIC,
        borderMode=cv2.BORDER_REPLICATE,
    )
    return np.asarray(cut, np.uint8)


def _tangents(side_px: int, fov_deg: float) -> NDArray[np.float64]:
    """(side_px,) tangent of the angle between each pixel's centre and the axis."""
    middle = (np.arange(side_px) + 0.5) / side_px * 2.0 - 1.0
    return np.asarray(middle * math.tan(math.radians(fov_deg) / 2.0))
