"""ORB's keypoints: FAST corners over a pyramid, ranked by the Harris measure.

Rublee, Rabaud, Konolige & Bradski, ICCV 2011; the detector is OpenCV's.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from contracts.records import Frames
from retrieval.pyramid import Pyramid
from retrieval.selection import favour_large, inside, no_frames, round_frames, spread, take

_FAST_THRESHOLDS = (20, 7)
_EXCESS = 4
_ENOUGH = 1.5
_EDGE = 16
_PATCH = 31
"""OpenCV's size of a keypoint of the first level; the others' are larger by the level's scale."""
_RADIUS_PER_SIZE = 1 / 6
"""Magnified by 3, a region is the square that ORB itself would describe."""


def detect_orb(
    pyramid: Pyramid, max_frames: int, usable: NDArray[np.bool_] | None = None
) -> Frames:
    """Find ORB frames, round; the FAST threshold is lowered if they are few. See `detect`."""
    shape = (pyramid.grey8.shape[0], pyramid.grey8.shape[1])
    frames = no_frames()
    if min(shape) <= 2 * _EDGE:
        return frames
    for threshold in _FAST_THRESHOLDS:
        detector = cv2.ORB.create(
            nfeatures=_EXCESS * max_frames, edgeThreshold=_EDGE, fastThreshold=threshold
        )
        found = detector.detect(pyramid.grey8)
        if not found:
            continue
        table = np.array([(k.pt[0], k.pt[1], k.size, k.response) for k in found], np.float32)
        # OpenCV multiplies positions by the level's scale, but resizes about pixels' corners.
        xy = (table[:, :2] + 0.5 * (table[:, 2:3] / _PATCH - 1.0)).astype(np.float32)
        frames = favour_large(round_frames(xy, _RADIUS_PER_SIZE * table[:, 2], table[:, 3]))
        frames = take(frames, inside(frames, shape, usable))
        if len(frames) >= _ENOUGH * max_frames:
            break
    return spread(frames, shape, max_frames)
