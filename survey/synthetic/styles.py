"""Restyling: any photograph as a faded print, a halftone, an engraving, or at night."""

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from contracts.errors import BadConfig
from survey.synthetic.canvas import Rgb
from survey.synthetic.materials import noise

# How hard each style is; larger is harder, except for contrast and light.
SEPIA_BLUR_PX = 0.9
SEPIA_CONTRAST = 0.65
SEPIA_FADING = 0.5
SEPIA_GRAIN = 12.0
SEPIA_GRAIN_PX = 1.3
SEPIA_STAINS = 0.25
SEPIA_PLATE = (0.05, 0.3, 0.65)
HALFTONE_CELL_PX = 5.0
HALFTONE_DEPTH = 0.8
HALFTONE_SCAN_BLUR_PX = 1.1
ENGRAVING_PITCH_PX = 5.0
ENGRAVING_DEPTH = 0.75
ENGRAVING_WASH = 0.45
ENGRAVING_OUTLINE = 9.0
ENGRAVING_SCAN_BLUR_PX = 0.95
NIGHT_LIGHT = 0.34
NIGHT_NOISE = 12.0
NIGHT_BLUR_PX = 0.8
NIGHT_LIT_SHARE = 0.4
PAPER_WARP_PX = 2.5

Plane = NDArray[np.float32]


def restyle(rgb: Rgb, style: str, seed: int) -> Rgb:
    """Restyle a photograph; the same arguments give the same pixels.

    Parameters
    ----------
    rgb : (H, W, 3) uint8, any photograph of at least 64 pixels a side.
    style : one of `STYLES`: sepia, halftone, engraving, night.
    seed : decides scratches, grain, inks, lit windows.

    Returns
    -------
    (H, W, 3) uint8.

    Raises
    ------
    BadConfig : there is no such style.
    """
    if style not in _MAKERS:
        raise BadConfig(f"style: no style is called {style!r}; there are {', '.join(STYLES)}")
    rng = np.random.default_rng([seed, STYLES.index(style)])
    return _MAKERS[style](rgb if style == "night" else _warped(rgb, rng), rng)


def _warped(rgb: Rgb, rng: np.random.Generator) -> Rgb:
    """Paper that does not lie quite flat: every point a little aside, its neighbours alike."""
    rows, cols = np.mgrid[: rgb.shape[0], : rgb.shape[1]].astype(np.float32)
    aside, down = (noise(rgb.shape[:2], 220, rng) * np.float32(PAPER_WARP_PX) for _ in range(2))
    moved = cv2.remap(
        rgb, cols + aside, rows + down, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT
    )
    return np.asarray(moved, dtype=np.uint8)


def _faded(tone: Plane, rng: np.random.Generator) -> Plane:
    """A print that paled from the light of one side, and unevenly."""
    shape = tone.shape
    rows = np.linspace(0, 1, shape[0], dtype=np.float32)[:, None]
    cols = np.linspace(0, 1, shape[1], dtype=np.float32)[None]
    lit = (rows if rng.random() < 0.5 else 1 - rows) * 0.8 + cols * np.float32(
        rng.uniform(-0.2, 0.2)
    )
    lost = np.clip(lit + noise(shape, 150, rng) * 0.12, 0, 1) * np.float32(SEPIA_FADING)
    return np.asarray(tone * (1 - lost) + 0.8 * lost, np.float32)


def _stains(shape: tuple[int, int], rng: np.random.Generator) -> Plane:
    """Light that damp and foxing take, 0 to 1: broad blotches with dark rims, and specks."""
    broad = noise(shape, 130, rng)
    rims = np.exp(-(((broad - 1.0) / 0.12) ** 2)) * 0.5 + np.clip(broad - 1.0, 0, 1) * 0.6
    specks = np.clip(cv2.GaussianBlur(noise(shape, 9, rng), (0, 0), 2.5) - 1.0, 0, 1) * 1.2
    return np.asarray(np.clip(rims + specks, 0, 1), np.float32)


def _grey(rgb: Rgb) -> Plane:
    grey = cv2.createCLAHE(1.2, (4, 4)).apply(cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY))
    return np.asarray(grey, dtype=np.float32) / np.float32(255)


def _inked(ink: Plane, paper: tuple[int, int, int], colour: tuple[int, int, int]) -> Rgb:
    """Ink coverage (0 to 1) as a colour on paper."""
    share = np.clip(ink, 0, 1)[..., None]
    mixed = np.array(paper, np.float32) * (1 - share) + np.array(colour, np.float32) * share
    return np.asarray(np.rint(mixed), dtype=np.uint8)


def _scanned(rgb: Rgb, blur_px: float) -> Rgb:
    """What a scanner's optics make of a print's dots and lines."""
    return np.asarray(cv2.GaussianBlur(rgb, (0, 0), blur_px), dtype=np.uint8)


def _vignette(shape: tuple[int, int], depth: float) -> Plane:
    rows = np.linspace(-1, 1, shape[0], dtype=np.float32)[:, None]
    cols = np.linspace(-1, 1, shape[1], dtype=np.float32)[None]
    return np.asarray(1 - depth * np.clip((rows**2 + cols**2) / 2, 0, 1) ** 1.5, np.float32)


def _sepia(rgb: Rgb, rng: np.random.Generator) -> Rgb:
    shape = rgb.shape[:2]
    # Old plates see blue as bright and red as dark.
    plate = rgb.astype(np.float32) @ np.array(list(SEPIA_PLATE), np.float32) / 255
    blurred = cv2.GaussianBlur(plate, (0, 0), SEPIA_BLUR_PX)
    tone = _faded(0.5 + (blurred - 0.5) * SEPIA_CONTRAST + 0.1, rng)
    tone = tone * _vignette(shape, 0.3) * (1 - SEPIA_STAINS * _stains(shape, rng))
    tone = tone + noise(shape, SEPIA_GRAIN_PX, rng) * np.float32(SEPIA_GRAIN / 255)
    aged = _inked(np.asarray(1 - tone, dtype=np.float32), (252, 236, 202), (42, 24, 10))
    for _ in range(int(rng.integers(5, 12))):
        x, y = rng.uniform(0, shape[1]), rng.uniform(0, shape[0])
        end = (int(x + rng.normal(0, 25)), int(y + rng.normal(0, 130)))
        cv2.line(aged, (int(x), int(y)), end, (240, 226, 196), 1, cv2.LINE_AA)
    for _ in range(int(rng.integers(10, 25))):
        spot = (int(rng.uniform(0, shape[1])), int(rng.uniform(0, shape[0])))
        cv2.circle(aged, spot, int(rng.integers(1, 4)), (236, 222, 192), -1, cv2.LINE_AA)
    return aged


def _screen(shape: tuple[int, int], cell_px: float, angle_deg: float) -> Plane:
    """A dot screen: the ink share, 0 to 1, from which each pixel is inked."""
    rows, cols = np.mgrid[: shape[0], : shape[1]].astype(np.float32)
    angle = np.radians(angle_deg)
    turned = (
        cols * np.cos(angle) + rows * np.sin(angle),
        rows * np.cos(angle) - cols * np.sin(angle),
    )
    across, down = (np.cos(2 * np.pi / cell_px * axis) for axis in turned)
    return np.asarray(0.5 - 0.25 * (across + down), dtype=np.float32)


def _dots(ink: Plane, cell_px: float, angle_deg: float) -> Plane:
    soft = cv2.GaussianBlur(ink, (0, 0), cell_px * 0.22)
    dots = np.clip((soft - _screen(ink.shape, cell_px, angle_deg)) * 3.5 + 0.5, 0, 1)
    return np.asarray(dots * HALFTONE_DEPTH + soft * (1 - HALFTONE_DEPTH), dtype=np.float32)


def _halftone(rgb: Rgb, rng: np.random.Generator) -> Rgb:
    paper = (240, 232, 214)
    if rng.random() < 0.5:
        ink = (26, 24, 34) if rng.random() < 0.5 else (64, 36, 26)
        single = _inked(_dots(1 - _grey(rgb), HALFTONE_CELL_PX, 45.0), paper, ink)
        return _scanned(single, HALFTONE_SCAN_BLUR_PX)
    share = 1 - rgb.astype(np.float32) / 255
    black = np.asarray(share.min(axis=2) * 0.8, dtype=np.float32)
    printed = np.full(rgb.shape, paper, dtype=np.float32)
    inks = ((15.0, (0, 150, 205)), (75.0, (205, 30, 120)), (0.0, (250, 220, 40)))
    for channel, (angle, colour) in enumerate(inks):
        plane = np.asarray(np.clip((share[..., channel] - black) * 1.25, 0, 1), np.float32)
        dots = _dots(plane, HALFTONE_CELL_PX, angle)[..., None]
        printed *= 1 - dots * (1 - np.array(colour, np.float32) / 255)
    printed *= 1 - 0.85 * _dots(black, HALFTONE_CELL_PX, 45.0)[..., None]
    return _scanned(np.asarray(printed, dtype=np.uint8), HALFTONE_SCAN_BLUR_PX)


def _engraving(rgb: Rgb, rng: np.random.Generator) -> Rgb:
    grey = cv2.GaussianBlur(_grey(rgb), (0, 0), 1.0)
    shape = grey.shape
    fine, broad = cv2.GaussianBlur(grey, (0, 0), 0.8), cv2.GaussianBlur(grey, (0, 0), 2.4)
    outline = np.clip((broad - fine - 0.02) * ENGRAVING_OUTLINE, 0, 1)
    rows, cols = np.mgrid[: shape[0], : shape[1]].astype(np.float32)
    wave = noise(shape, 70, rng) * 1.6 + noise(shape, 25, rng) * 0.4
    ink = np.maximum(outline, ENGRAVING_WASH * (1 - grey))
    # Each further set of lines, in another direction, begins at a darker tone.
    for angle_deg, begins in ((8.0, 0.15), (-48.0, 0.5), (62.0, 0.72)):
        angle = np.radians(angle_deg)
        phase = (rows * np.cos(angle) + cols * np.sin(angle) + wave) * (2 * np.pi)
        ridge = 0.5 + 0.5 * np.cos(phase / ENGRAVING_PITCH_PX)
        thickness = np.clip((1 - grey - begins) / 0.6, 0, 0.75)
        lines = np.clip((thickness - ridge) * 4 + 0.5, 0, 1) * (thickness > 0)
        ink = np.maximum(ink, lines * ENGRAVING_DEPTH)
    drawn = _inked(np.asarray(ink, dtype=np.float32), (242, 236, 220), (28, 24, 22))
    return _scanned(drawn, ENGRAVING_SCAN_BLUR_PX)


def _night(rgb: Rgb, rng: np.random.Generator) -> Rgb:
    shape = rgb.shape[:2]
    rgb = _scanned(rgb, NIGHT_BLUR_PX)
    light = np.float32(NIGHT_LIGHT) * (1 + 0.25 * noise(shape, 300, rng))
    dark = rgb.astype(np.float32) * np.array([0.72, 0.84, 1.15], np.float32) * light[..., None]
    sky = (rgb[..., 2] > 170) & (rgb[..., 2].astype(np.int16) >= rgb[..., 0] - 4)
    dark[sky] *= 0.45
    lit = _lit_windows(rgb, rng)
    warm = np.array([255, 196, 104], np.float32)
    halo = cv2.GaussianBlur(lit, (0, 0), 9)
    dark += (
        lit[..., None] * warm * (0.55 + 0.45 * _grey(rgb)[..., None])
        + halo[..., None] * warm * 0.25
    )
    for _ in range(int(rng.integers(1, 3))):
        x, y = rng.uniform(0.05, 0.95) * shape[1], rng.uniform(0.25, 0.6) * shape[0]
        dark += _glow(shape, float(x), float(y))[..., None] * warm
    # A lamp lights the wall as well as the lens.
    dark += rng.normal(0, NIGHT_NOISE, rgb.shape)
    return np.asarray(np.clip(dark, 0, 255), dtype=np.uint8)


def _lit_windows(rgb: Rgb, rng: np.random.Generator) -> Plane:
    """Light, 0 to 1, in some of the dark compact patches: they are taken for panes."""
    grey = cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY)
    around = cv2.boxFilter(grey, -1, (61, 61))
    panes = ((grey < 100) & (grey.astype(np.int16) < around - 18)).astype(np.uint8)
    joined = cv2.morphologyEx(panes, cv2.MORPH_CLOSE, np.ones((9, 9), np.uint8))
    n, labels, stats, _ = cv2.connectedComponentsWithStats(joined)
    wide, high, area = (stats[:, column] for column in (2, 3, 4))
    window = (area > 300) & (area > 0.55 * wide * high) & (area < 0.06 * grey.size)
    chosen = window & (rng.random(n) < NIGHT_LIT_SHARE)
    chosen[0] = False
    strength = np.where(chosen, rng.uniform(0.5, 1.0, n), 0).astype(np.float32)
    return np.asarray(strength[labels] * panes, dtype=np.float32)


def _glow(shape: tuple[int, int], x: float, y: float) -> Plane:
    rows = np.arange(shape[0], dtype=np.float32)[:, None] - np.float32(y)
    cols = np.arange(shape[1], dtype=np.float32)[None] - np.float32(x)
    distance = (rows**2 + cols**2) / np.float32((0.035 * shape[1]) ** 2)
    return np.asarray(1.1 / (1 + distance) ** 1.15, dtype=np.float32)


def postcard(rgb: Rgb, caption: str) -> Rgb:
    """The picture on a card with a pale border and a caption below, as large as before."""
    height, width = rgb.shape[:2]
    margin, foot = width // 28, height // 12
    inner = cv2.resize(
        rgb, (width - 2 * margin, height - margin - foot), interpolation=cv2.INTER_AREA
    )
    card = np.full(rgb.shape, (238, 226, 198), dtype=np.uint8)
    card[margin : height - foot, margin : width - margin] = inner
    place, scale = (margin, height - foot // 3), foot / 60
    font = cv2.FONT_HERSHEY_COMPLEX_SMALL | cv2.FONT_ITALIC
    cv2.putText(card, caption, place, font, scale, (74, 48, 36), 1, cv2.LINE_AA)
    return card


_MAKERS: dict[str, Callable[[Rgb, np.random.Generator], Rgb]] = {
    "sepia": _sepia,
    "halftone": _halftone,
    "engraving": _engraving,
    "night": _night,
}
STYLES: tuple[str, ...] = tuple(_MAKERS)
