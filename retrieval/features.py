"""All frames and descriptors of one photo."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contracts.config import Descriptor, Detector, FeatureConfig
from contracts.records import Frames
from retrieval.descriptors import describe
from retrieval.detectors import detect
from retrieval.pyramid import build_pyramid

_WARM_SIDE = 96


@dataclass(frozen=True, slots=True)
class Features:
    """What one photo yields.

    frames : per detector. descriptors : per channel, such as `hesaff-sift`, (n, 128 | 64 | 36)
    uint8, in the order of the detector's frames.
    """

    frames: dict[Detector, Frames]
    descriptors: dict[str, NDArray[np.uint8]]


def extract(
    rgb: NDArray[np.uint8], usable: NDArray[np.bool_] | None, config: FeatureConfig
) -> Features:
    """Detect and describe every channel of the configuration.

    Parameters
    ----------
    rgb : (h, w, 3) uint8, upright, already reduced to the size wanted.
    usable : (h, w) bool, True = scenery; None = all of it.

    Raises
    ------
    ValueError : the photo is not (h, w, 3) uint8, or the mask not of its size.
    """
    pyramid = build_pyramid(rgb)
    frames: dict[Detector, Frames] = {}
    descriptors: dict[str, NDArray[np.uint8]] = {}
    for detector in config.detectors:
        found = detect(pyramid, detector, config.frames_of(detector), usable)
        frames[detector] = found
        described = describe(pyramid, found, config.descriptors)
        for descriptor in config.descriptors:
            descriptors[_channel(detector, descriptor)] = described[descriptor]
    return Features(frames, descriptors)


def compile_kernels() -> None:
    """Run every compiled loop once on a small picture, so that numba's cache is warm."""
    row, column = np.mgrid[:_WARM_SIDE, :_WARM_SIDE]
    blobs = 127.5 + 80.0 * np.sin(row / 5.0) * np.sin(column / 7.0) + row % 3 * 15.0
    grey = np.clip(blobs, 0, 255).astype(np.uint8)
    extract(np.repeat(grey[:, :, None], 3, axis=2), None, FeatureConfig(max_frames=50))


def _channel(detector: Detector, descriptor: Descriptor) -> str:
    return f"{detector}-{descriptor}"
