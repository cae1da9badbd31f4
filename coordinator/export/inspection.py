"""What every detector sees in one photo, drawn for people."""

import io

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from contracts.records import Frames
from coordinator.inspecting import Inspection, Seen

CHOSEN_RGB = (255, 196, 46)
"""Frames, title and border of the detectors that a photo is searched with."""

_OTHER_RGB = (92, 214, 255)
_PAPER_RGB, _BORDER_RGB = (22, 24, 29), (74, 80, 92)
_TEXT_RGB, _QUIET_RGB = (238, 240, 244), (164, 170, 182)
_MASKED_RGB = (120, 40, 60)
_MIN_PANEL_PX = 360
"""Room for a title, where the photo is smaller."""
_CIRCLE_POINTS = 64
_SUBPIXEL_BITS = 4

_Rgb = NDArray[np.uint8]
_Colour = tuple[int, int, int]
_Font = ImageFont.FreeTypeFont | ImageFont.ImageFont


def picture(inspection: Inspection, suffix: str) -> bytes:
    """Draw a panel a detector under a header, those chosen marked.

    suffix : `.png`, or `.jpg` or `.jpeg`.
    """
    tiles = [_tile(inspection, seen) for seen in inspection.seen]
    width, height = tiles[0].size
    gap = width // 40
    columns = len(tiles) if len(tiles) <= 3 else -(-len(tiles) // 2)
    rows = -(-len(tiles) // columns)
    header = _header(inspection, columns * (width + gap) - gap, _text_px(width))
    top = header.height + 2 * gap
    sheet = Image.new("RGB", (header.width + 2 * gap, top + rows * (height + gap)), _PAPER_RGB)
    sheet.paste(header, (gap, gap))
    for at, tile in enumerate(tiles):
        row, column = divmod(at, columns)
        sheet.paste(tile, (gap + column * (width + gap), top + row * (height + gap)))
    stream = io.BytesIO()
    if suffix == ".png":
        sheet.save(stream, "PNG", compress_level=4)  # half the time of 6, 4 % larger
    else:
        sheet.save(stream, "JPEG", quality=90, subsampling=0)
    return stream.getvalue()


def _tile(inspection: Inspection, seen: Seen) -> Image.Image:
    """A title over the photo with its frames, in a border."""
    is_chosen = seen.detector in inspection.chosen.detectors
    frame_rgb, border_rgb, ink_rgb = (
        (CHOSEN_RGB, CHOSEN_RGB, _PAPER_RGB) if is_chosen else (_OTHER_RGB, _BORDER_RGB, _TEXT_RGB)
    )
    photo = Image.fromarray(_with_frames(_backdrop(inspection), seen.frames, frame_rgb))
    inner = max(photo.width, _MIN_PANEL_PX)
    text_px = _text_px(inner)
    border, bar = text_px // 4, text_px * 9 // 4
    tile = Image.new("RGB", (inner + 2 * border, bar + photo.height + border), border_rgb)
    tile.paste(_PAPER_RGB, (border, bar, border + inner, bar + photo.height))
    tile.paste(photo, (border + (inner - photo.width) // 2, bar))
    draw = ImageDraw.Draw(tile)
    plural = "" if len(seen.frames) == 1 else "s"
    found = f"{len(seen.frames):,} frame{plural} · coverage {seen.coverage:.0%}"
    draw.text((text_px, bar // 2), seen.detector, ink_rgb, _font(text_px * 5 // 4), "lm")
    draw.text((tile.width - text_px, bar // 2), found, ink_rgb, _font(text_px), "rm")
    return tile


def _backdrop(inspection: Inspection) -> _Rgb:
    """The photo in darker greys, so that only frames have colour; what is masked reddish."""
    grey = cv2.cvtColor(inspection.decoded.rgb, cv2.COLOR_RGB2GRAY)
    backdrop = np.repeat((grey * 0.55 + 16).astype(np.uint8)[:, :, None], 3, axis=2)
    if inspection.usable is not None:
        masked = ~inspection.usable
        backdrop[masked] = backdrop[masked] // 2 + np.array(_MASKED_RGB, np.uint8) // 2
    return backdrop


def _with_frames(photo: _Rgb, frames: Frames, colour: _Colour) -> _Rgb:
    """Each frame's ellipse as a thin bright line over a wider shadow, seen on light and dark."""
    angle = np.linspace(0, 2 * np.pi, _CIRCLE_POINTS, endpoint=False)
    circle = np.stack([np.cos(angle), np.sin(angle)])
    outlines = (frames.shape @ circle).transpose(0, 2, 1) + frames.xy[:, None]
    points = list(np.rint(outlines * 2**_SUBPIXEL_BITS).astype(np.int32))
    shade = photo.copy()
    cv2.polylines(shade, points, True, (0, 0, 0), 3, cv2.LINE_AA, _SUBPIXEL_BITS)
    drawn = cv2.addWeighted(photo, 0.35, shade, 0.65, 0)
    cv2.polylines(drawn, points, True, colour, 1, cv2.LINE_AA, _SUBPIXEL_BITS)
    return np.asarray(drawn, np.uint8)


def _header(inspection: Inspection, width: int, text_px: int) -> Image.Image:
    """What was inspected, what it is searched with, and why."""
    decoded, chosen = inspection.decoded, inspection.chosen
    height, wide = decoded.rgb.shape[:2]
    photo = f"{inspection.name} · {decoded.width_px} x {decoded.height_px} pixels"
    pair = f"Searched with {' + '.join(chosen.detectors)}, k = {chosen.k}"
    paragraphs = (
        (f"{photo}, inspected at {wide} x {height}", _QUIET_RGB, text_px),
        (pair, CHOSEN_RGB, text_px * 8 // 5),
        (chosen.choice, _TEXT_RGB, text_px),
    )
    lines = [
        (line, colour, px)
        for text, colour, px in paragraphs
        for line in _wrapped(_showable(text), width, _font(px))
    ]
    header = Image.new("RGB", (width, sum(px * 3 // 2 for _, _, px in lines)), _PAPER_RGB)
    draw, y = ImageDraw.Draw(header), 0
    for line, colour, px in lines:
        draw.text((0, y), line, colour, _font(px))
        y += px * 3 // 2
    return header


def _wrapped(text: str, width: int, font: _Font) -> list[str]:
    lines: list[str] = []
    for word in text.split():
        if lines and font.getlength(f"{lines[-1]} {word}") <= width:
            lines[-1] += f" {word}"
        else:
            lines.append(word)
    return lines


def _showable(text: str) -> str:
    """With a question mark for what Pillow's own font cannot show."""
    return "".join(char if " " <= char <= "~" or char == "·" else "?" for char in text)


def _text_px(panel_px: int) -> int:
    return min(max(panel_px // 34, 14), 30)


def _font(px: int) -> _Font:
    return ImageFont.load_default(px)
