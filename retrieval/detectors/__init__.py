"""Detectors of local affine frames, one module each, behind one function."""

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from contracts.config import Detector
from contracts.records import Frames
from retrieval.detectors.colsym import detect_colsym
from retrieval.detectors.har import detect_har
from retrieval.detectors.hesaff import detect_hesaff
from retrieval.detectors.mser import detect_mser
from retrieval.detectors.orb import detect_orb
from retrieval.detectors.star import detect_star
from retrieval.pyramid import Pyramid

_Detect = Callable[[Pyramid, int, NDArray[np.bool_] | None], Frames]
_DETECTORS: Mapping[Detector, _Detect] = MappingProxyType(
    {
        "hesaff": detect_hesaff,
        "mser": detect_mser,
        "star": detect_star,
        "har": detect_har,
        "orb": detect_orb,
        "colsym": detect_colsym,
    }
)


def detect(
    pyramid: Pyramid,
    detector: Detector,
    max_frames: int,
    usable: NDArray[np.bool_] | None = None,
) -> Frames:
    """Find the local frames of a photo (METHOD section 1).

    Parameters
    ----------
    max_frames : at most this many, spread over the picture (see `retrieval.selection.spread`).
    usable : (h, w) bool of the photo's size, True = scenery; None = all of it.

    Returns
    -------
    Frames in pixels of the photo, best response first, ties by y, then x. Responses compare
    within one detector and photo only. A flat or tiny photo has none.

    Raises
    ------
    ValueError : the mask is not of the photo's size.
    """
    return _DETECTORS[detector](pyramid, max_frames, usable)
