"""Descriptors of frames, one module each, computed on one shared patch per frame."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from contracts.config import DESCRIPTOR_SIZES, Descriptor
from contracts.records import Frames
from retrieval.descriptors.shape_context import describe_shape_context
from retrieval.descriptors.sift import describe_sift
from retrieval.descriptors.surf import describe_surf
from retrieval.patches import cut_patches, patch_gradients
from retrieval.pyramid import Pyramid


def describe(
    pyramid: Pyramid, frames: Frames, descriptors: Sequence[Descriptor]
) -> dict[Descriptor, NDArray[np.uint8]]:
    """Describe frames of a photo (METHOD section 1); shapes are used as they are given.

    A frame's descriptor depends on the photo and that frame only. All are uint8, so that squared
    L2 distances are integers below 2**24, exact in float32 whatever the order of summation.

    Returns
    -------
    Descriptor name -> (n, 128) for sift, (n, 64) for surf, (n, 36) for sc; uint8, in the order
    of the frames.
    """
    described = {
        name: np.empty((len(frames), DESCRIPTOR_SIZES[name]), np.uint8) for name in descriptors
    }
    for rows, patches in cut_patches(pyramid, frames):
        if "surf" in described:
            described["surf"][rows] = describe_surf(patches)
        if "sift" in described or "sc" in described:
            magnitude, angle = patch_gradients(patches)
            if "sift" in described:
                described["sift"][rows] = describe_sift(magnitude, angle)
            if "sc" in described:
                described["sc"][rows] = describe_shape_context(magnitude, angle)
    return described
