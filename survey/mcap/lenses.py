"""Which calibration belongs to a camera, and the field of view it gives."""

import math
from collections.abc import Mapping

from survey.mcap.messages import Calibration
from survey.mcap.recording import CameraKey

_BY_ANGLE = frozenset({"equidistant", "fisheye", "kannala_brandt"})
"""Distortion models in which the radius grows with the angle and not with its tangent."""


def calibration_of(
    camera: CameraKey, calibrations: Mapping[str, Calibration]
) -> Calibration | None:
    """The calibration of the same frame, and of several the one whose topic is nearest; else the
    one beside the images, such as `/front/camera_info` beside `/front/image/compressed`."""
    same_frame = {
        topic: found
        for topic, found in calibrations.items()
        if camera.frame and found.frame == camera.frame
    }
    beside = {
        topic: found
        for topic, found in calibrations.items()
        if camera.topic.startswith(topic.rpartition("/")[0] + "/") and topic.count("/") > 1
    }
    candidates = same_frame or beside
    if not candidates:
        return None
    return candidates[min(candidates, key=lambda topic: (-_shared(topic, camera.topic), topic))]


def _shared(topic: str, other: str) -> int:
    """How many leading characters are the same."""
    pairs = zip(topic, other, strict=False)
    return next((at for at, (a, b) in enumerate(pairs) if a != b), min(len(topic), len(other)))


def hfov_deg(calibration: Calibration) -> float | None:
    """Horizontal field of view from the focal length and the width, without the distortion.

    2 atan(w / 2f) for lenses that keep lines straight up to small distortions (plumb_bob,
    rational_polynomial), w / f for fisheyes, whose angle grows with the radius. None: the
    calibration is not filled in, as ROS says with a focal length of 0.
    """
    focal, width = calibration.focal_px, calibration.width_px
    if not (math.isfinite(focal) and focal > 0.0 and width > 0):
        return None
    if calibration.model.lower() in _BY_ANGLE:
        return min(360.0, math.degrees(width / focal))
    return 2.0 * math.degrees(math.atan(width / (2.0 * focal)))
