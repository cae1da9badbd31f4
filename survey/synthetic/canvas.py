"""A drawing surface measured in metres, for facades: right and up from the bottom-left corner."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

PX_PER_M = 56.0
"""Resolution of every facade texture: about what a camera 10 m away resolves."""

Colour = tuple[int, int, int]
Rgb = NDArray[np.uint8]


def shaded(colour: Colour, factor: float) -> Colour:
    """The colour made brighter (factor > 1) or darker, clipped to 0-255."""
    red, green, blue = (max(0, min(255, round(channel * factor))) for channel in colour)
    return red, green, blue


def px(length_m: float) -> int:
    """A length in metres as whole pixels, at least one."""
    return max(1, round(length_m * PX_PER_M))


@dataclass(slots=True)
class Canvas:
    """Pixels (H, W, 3 or 4) uint8 that are drawn on in place; light falls from the upper left."""

    pixels: Rgb

    @property
    def height_m(self) -> float:
        return float(self.pixels.shape[0] / PX_PER_M)

    @property
    def width_m(self) -> float:
        return float(self.pixels.shape[1] / PX_PER_M)

    def point(self, x_m: float, y_m: float) -> tuple[int, int]:
        """Column and row of a place in metres."""
        return round(x_m * PX_PER_M), self.pixels.shape[0] - round(y_m * PX_PER_M)

    def view(self, x0: float, y0: float, x1: float, y1: float) -> Rgb:
        """The pixels of a rectangle, clipped to the canvas; writing to them draws."""
        left, bottom = self.point(x0, y0)
        right, top = self.point(x1, y1)
        return self.pixels[max(0, top) : max(0, bottom), max(0, left) : max(0, right)]

    def rect(self, x0: float, y0: float, x1: float, y1: float, colour: Colour) -> None:
        """Fill a rectangle."""
        area = self.view(x0, y0, x1, y1)
        area[..., :3] = colour
        if area.shape[2] == 4:
            area[..., 3] = 255

    def shade(self, x0: float, y0: float, x1: float, y1: float, factor: float) -> None:
        """Darken (factor < 1) or brighten what is there."""
        area = self.view(x0, y0, x1, y1)
        if area.size:
            area[..., :3] = cv2.convertScaleAbs(np.ascontiguousarray(area[..., :3]), alpha=factor)

    def raised(self, x0: float, y0: float, x1: float, y1: float, colour: Colour) -> None:
        """A slab that stands out: lit above, shadow below."""
        edge = min(0.06, 0.3 * (y1 - y0))
        self.shade(x0 + 0.04, y0 - 2.2 * edge, x1 + 0.06, y0, 0.62)
        self.rect(x0, y0, x1, y1, colour)
        self.rect(x0, y1 - edge, x1, y1, shaded(colour, 1.18))
        self.rect(x0, y0, x1, y0 + edge, shaded(colour, 0.72))

    def line(
        self, start: tuple[float, float], end: tuple[float, float], width_m: float, colour: Colour
    ) -> None:
        """A straight stroke between two places."""
        ink = (*colour, 255)
        cv2.line(self.pixels, self.point(*start), self.point(*end), ink, px(width_m), cv2.LINE_AA)

    def polygon(self, corners: list[tuple[float, float]], colour: Colour) -> None:
        """Fill a polygon."""
        outline = np.array([self.point(x, y) for x, y in corners], dtype=np.int32)
        cv2.fillPoly(self.pixels, [outline], (*colour, 255), cv2.LINE_AA)

    def disc(
        self,
        x_m: float,
        y_m: float,
        radii_m: tuple[float, float],
        colour: Colour,
        arc: bool = False,
    ) -> None:
        """Fill an ellipse, or with `arc` its upper half."""
        axes = (px(radii_m[0]), px(radii_m[1]))
        start = 180 if arc else 0
        cv2.ellipse(
            self.pixels, self.point(x_m, y_m), axes, 0, start, 360, (*colour, 255), -1, cv2.LINE_AA
        )

    def text(self, words: str, box: tuple[float, float, float, float], colour: Colour) -> None:
        """Write words centred in a box (x0, y0, x1, y1), as large as they fit."""
        font, weight = cv2.FONT_HERSHEY_DUPLEX, 1
        (width, height), _ = cv2.getTextSize(words, font, 1.0, weight)
        x0, y0, x1, y1 = box
        scale = min((x1 - x0) * PX_PER_M / width, (y1 - y0) * PX_PER_M / (height * 1.1))
        left = (x0 + x1) / 2 * PX_PER_M - width * scale / 2
        base = self.pixels.shape[0] - (y0 + y1) / 2 * PX_PER_M + height * scale / 2
        place = (round(left), round(base))
        thick = max(1, round(scale * 1.6))
        cv2.putText(self.pixels, words, place, font, scale, (*colour, 255), thick, cv2.LINE_AA)
