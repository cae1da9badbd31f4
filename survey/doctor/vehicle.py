"""Parts of the vehicle in the picture: edges that stay while the street goes by."""

from collections.abc import Iterator, Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from contracts.errors import UnusableImage
from contracts.records import PosedImage
from survey.decode import decode_image
from survey.doctor.findings import Finding
from survey.doctor.mountings import looks_level
from survey.doctor.pictures import evenly
from survey.doctor.track import Track

_SAMPLE, _MIN_IMAGES, _MOST_CAMERAS = 24, 12, 8
_SIDE_PX = 128
_BLUR_PX = 0.8
_STAYING, _MIN_SHARE = 0.9, 0.01
"""How far gradients must agree, and on what share of the picture. Measured on 24 images a camera:
the two of Stereopolis that show the vehicle have 4.9 and 5.5 %, the others 0.0 %, and the kerbs of
a rendered town, straighter than any, 0.3 %. At 0.75 those kerbs would have 3.4 %."""
_FAINT_LEVELS = 1.0


def check_vehicle(track: Track) -> Iterator[Finding]:
    """Each camera without masks, by some 24 of its images taken at different places."""
    samples = {
        name: evenly(images, _SAMPLE)
        for number, name in enumerate(track.cameras)
        if len(images := _moving_without_mask(track, number)) >= _MIN_IMAGES
    }
    for name in sorted(samples)[:_MOST_CAMERAS]:
        still = staying_edges(samples[name])
        if still is not None and still.mean() > _MIN_SHARE:
            yield Finding(
                "vehicle",
                "warning",
                f"{name or 'the camera'} shows the same edges in {still.mean():.0%} of the picture "
                f"wherever it is, {_where(still)}: parts of the vehicle, or a caption, whose "
                "keypoints match everywhere",
                mend="a mask for the camera where the format has one (without --no-masks), or crop",
            )
    if not samples and not any(image.mask_path for image in track.images):
        yield Finding(
            "vehicle",
            "note",
            f"whether a vehicle shows cannot be told: no camera has {_MIN_IMAGES} images without "
            "mask at different places",
        )


def staying_edges(images: Sequence[PosedImage]) -> NDArray[np.bool_] | None:
    """Pixels of the lower half whose brightness rises the same way in all pictures.

    The length of the mean gradient over the mean length of the gradients: 1 where an edge stays,
    about 1 / sqrt(n) where edges of a street come and go. Unlike a small variance it neither
    takes asphalt and white sky for a vehicle, nor is it misled by shadows on one.

    Returns
    -------
    staying : (h, w) bool of the reduced picture; None: too few images of one shape can be read.
    """
    greys = [grey for image in images if (grey := _grey(image)) is not None]
    shapes = [grey.shape for grey in greys]
    usual = max(sorted(set(shapes)), key=shapes.count) if shapes else None
    stack = np.stack([grey for grey in greys if grey.shape == usual]) if shapes else np.zeros(0)
    if len(stack) < _MIN_IMAGES or min(stack.shape) < 2:
        return None
    down, right = np.gradient(stack, axis=(1, 2))
    mean_length = np.hypot(down, right).mean(axis=0)
    length_of_mean = np.hypot(down.mean(axis=0), right.mean(axis=0))
    staying = length_of_mean > _STAYING * (mean_length + _FAINT_LEVELS)
    staying[: staying.shape[0] // 2] = False
    return np.asarray(staying)


def _grey(image: PosedImage) -> NDArray[np.float32] | None:
    try:
        decoded = decode_image(
            image.path,
            fragment=image.fragment,
            quarter_turns=image.quarter_turns,
            max_side_px=_SIDE_PX,
        )
    except UnusableImage:  # the check of files says so
        return None
    grey = cv2.cvtColor(decoded.rgb, cv2.COLOR_RGB2GRAY).astype(np.float32)
    return np.asarray(cv2.GaussianBlur(grey, (0, 0), _BLUR_PX), np.float32)


def _moving_without_mask(track: Track, camera: int) -> list[PosedImage]:
    """One image a square metre, for at a red light all are one. None of a sky camera."""
    members = track.order[track.camera[track.order] == camera]
    if not looks_level(track.pitch_deg[members]):
        return []
    cells = np.floor(np.column_stack([track.x_m[members], track.y_m[members]]))
    first_of_cell = np.unique(cells, axis=0, return_index=True)[1]
    images = [track.images[at] for at in members[np.sort(first_of_cell)]]
    return [image for image in images if image.mask_path is None]


def _where(staying: NDArray[np.bool_]) -> str:
    rows, columns = (at / size for at, size in zip(np.nonzero(staying), staying.shape, strict=True))
    return (
        f"most of it {np.quantile(rows, 0.05):.0%} to {np.quantile(rows, 0.95):.0%} down and "
        f"{np.quantile(columns, 0.05):.0%} to {np.quantile(columns, 0.95):.0%} from the left"
    )
