"""Star keypoints: centre-surround extrema by star-shaped box filters (CenSurE).

Agrawal, Konolige & Blas, ECCV 2008; the detector is OpenCV's.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from contracts.records import Frames
from retrieval.pyramid import Pyramid
from retrieval.selection import favour_large, inside, no_frames, round_frames, spread, take

_MAX_SIZE = 45
_THRESHOLDS = (5, 2)
_LINE_PROJECTED, _LINE_BINARIZED = 10, 8
_SUPPRESSION = 5
_MIN_SIDE = 16
_PAD = 64
"""OpenCV leaves out as wide a border as its largest filter; padding gives it back."""
_ENOUGH = 1.5
_RADIUS_PER_SIZE = 0.85
"""OpenCV's size is 1.4 times a disc's radius, measured on discs; a region is 1.2 times the disc."""


def detect_star(
    pyramid: Pyramid, max_frames: int, usable: NDArray[np.bool_] | None = None
) -> Frames:
    """Find Star frames, round; the threshold is lowered until there are enough. See `detect`."""
    shape = (pyramid.grey8.shape[0], pyramid.grey8.shape[1])
    frames = no_frames()
    if min(shape) < _MIN_SIDE:
        return frames
    grey = cv2.copyMakeBorder(pyramid.grey8, _PAD, _PAD, _PAD, _PAD, cv2.BORDER_REPLICATE)
    for threshold in _THRESHOLDS:
        detector = cv2.xfeatures2d.StarDetector.create(
            _MAX_SIZE, threshold, _LINE_PROJECTED, _LINE_BINARIZED, _SUPPRESSION
        )
        found = detector.detect(grey)
        if not found:
            continue
        rows = [(k.pt[0] - _PAD, k.pt[1] - _PAD, k.size, abs(k.response)) for k in found]
        table = np.array(rows, np.float32)
        frames = favour_large(
            round_frames(table[:, :2], _RADIUS_PER_SIZE * table[:, 2], table[:, 3])
        )
        frames = take(frames, inside(frames, shape, usable))
        if len(frames) >= _ENOUGH * max_frames:
            break
    return spread(frames, shape, max_frames)
