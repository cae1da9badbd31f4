"""What every detector sees in one photo: found and measured."""

import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from contracts.config import Detector, FeatureConfig, IndexConfig, SearchConfig
from contracts.errors import UnusableImage, WrongInput
from contracts.records import Frames
from retrieval.pyramid import build_pyramid
from retrieval.selection import mean_radius
from survey import DecodedImage, decode_image, decode_mask
from workers.stages.choose import choose
from workers.stages.retrieve import Chosen, Configured, Photo

_GRID = 10


@dataclass(frozen=True, slots=True)
class Seen:
    """What one detector found.

    coverage : share of the cells of a 10 x 10 grid over the photo that hold a frame's centre.
    median_radius_px : of the regions (of the circle of equal area), pixels of the full photo;
    None without frames. seconds : to detect, on one core.
    """

    detector: Detector
    frames: Frames
    coverage: float
    median_radius_px: float | None
    seconds: float


@dataclass(frozen=True, slots=True)
class Inspection:
    """A photo, what every detector found in it, and what it is searched with.

    usable : (h, w) bool of the decoded photo, True = scenery; None = all of it.
    """

    name: str
    decoded: DecodedImage
    usable: NDArray[np.bool_] | None
    seen: tuple[Seen, ...]
    chosen: Chosen


@dataclass(frozen=True, slots=True)
class NoIndex:
    """The defaults in place of an index: the model is the one that Flaneur ships."""

    config: IndexConfig
    root: None = None


def inspect_photo(path: Path, mask: Path | None, index: Configured) -> Inspection:
    """Find the frames of every detector, and choose among them as `flaneur locate` does.

    Parameters
    ----------
    mask : bright where the photo shows no scenery, stored turned like it; None: all is scenery.

    Raises
    ------
    WrongInput : the photo or the mask cannot be read; names it.
    """
    config = index.config.features
    decoded, usable = _decode(path, mask, config)
    photo = Photo(decoded, build_pyramid(decoded.rgb), config, usable)
    seen = []
    for detector in config.detectors:
        started = time.perf_counter()
        frames = photo.frames(detector)
        seconds = time.perf_counter() - started
        seen.append(_measured(detector, frames, decoded, seconds))
    return Inspection(path.name, decoded, usable, tuple(seen), choose(index, photo, SearchConfig()))


def coverage(xy: NDArray[np.float32], width_px: int, height_px: int) -> float:
    """Share of the cells of a 10 x 10 grid over a picture that hold a point; 0 to 1.

    xy : (n, 2) float32, pixels, centre of the top-left pixel is (0, 0).
    """
    cell = ((xy + 0.5) * _GRID / (width_px, height_px)).astype(np.int64).clip(0, _GRID - 1)
    return len(np.unique(cell, axis=0)) / _GRID**2


def _decode(
    path: Path, mask: Path | None, config: FeatureConfig
) -> tuple[DecodedImage, NDArray[np.bool_] | None]:
    reading = path
    try:
        decoded = decode_image(path, max_side_px=config.max_side_px, max_pixels=config.max_pixels)
        if mask is None:
            return decoded, None
        reading = mask
        height, width = decoded.rgb.shape[:2]
        return decoded, decode_mask(mask, quarter_turns=0, width=width, height=height)
    except UnusableImage as error:
        raise WrongInput(f"{reading}: {error}") from error


def _measured(detector: Detector, frames: Frames, decoded: DecodedImage, seconds: float) -> Seen:
    height, width = decoded.rgb.shape[:2]
    radii = mean_radius(frames.shape)
    median = float(np.median(radii)) * decoded.scale if len(radii) else None
    return Seen(detector, frames, coverage(frames.xy, width, height), median, seconds)
