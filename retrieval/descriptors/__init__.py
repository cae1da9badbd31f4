"""Descriptors of frames, one module each, computed on one shared patch per frame."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from contracts.config import Descriptor
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
    patches = cut_patches(pyramid, frames)
    described: dict[Descriptor, NDArray[np.uint8]] = {}
    if "surf" in descriptors:
        described["surf"] = describe_surf(patches)
    if "sift" in descriptors or "sc" in descriptors:
        magnitude, angle = patch_gradients(patches)
        if "sift" in descriptors:
            described["sift"] = describe_sift(magnitude, angle)
        if "sc" in descriptors:
            described["sc"] = describe_shape_context(magnitude, angle)
    return {name: described[name] for name in descriptors}
