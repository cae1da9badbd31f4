"""Which candidate frames are kept: inside the usable picture, spread over it, best first."""

import numpy as np
from numpy.typing import NDArray

from contracts.records import Frames

_RIM_POINTS = 16
_MAX_RIM_OUTSIDE = 0.125
_POOL = 5
_CELLS = 49


def no_frames() -> Frames:
    """Return an empty set of frames."""
    return Frames(
        np.empty((0, 2), np.float32), np.empty((0, 2, 2), np.float32), np.empty(0, np.float32)
    )


def round_frames(
    xy: NDArray[np.float32], radius: NDArray[np.float32], response: NDArray[np.float32]
) -> Frames:
    """Make frames of circular regions: xy (n, 2) and radius (n,) in pixels."""
    shape = np.eye(2, dtype=np.float32) * radius.astype(np.float32)[:, None, None]
    return Frames(xy.astype(np.float32), shape, response.astype(np.float32))


def mean_radius(shape: NDArray[np.float32]) -> NDArray[np.float32]:
    """Radius of the circle of the same area, of shapes (n, 2, 2); pixels."""
    area = shape[:, 0, 0] * shape[:, 1, 1] - shape[:, 0, 1] * shape[:, 1, 0]
    return np.sqrt(np.abs(area)).astype(np.float32)


def take(frames: Frames, rows: NDArray[np.intp] | NDArray[np.bool_]) -> Frames:
    """Return the frames of the given rows, in that order."""
    return Frames(frames.xy[rows], frames.shape[rows], frames.response[rows])


def favour_large(frames: Frames) -> Frames:
    """Multiply responses by the regions' areas; best first no more.

    Of two regions that stand out equally the larger is found again more often, above all in a
    smaller, blurred or grainy photo (docs/decisions/0009).
    """
    area = mean_radius(frames.shape) ** 2
    return Frames(frames.xy, frames.shape, (frames.response * area).astype(np.float32))


def sort_frames(frames: Frames) -> Frames:
    """Sort by descending response; ties by y, then x, then the shape's entries."""
    flat = frames.shape.reshape(-1, 4)
    keys = (*(flat[:, i] for i in range(4)), frames.xy[:, 0], frames.xy[:, 1], -frames.response)
    return take(frames, np.lexsort(keys))


def inside(
    frames: Frames, image_shape: tuple[int, int], usable: NDArray[np.bool_] | None
) -> NDArray[np.bool_]:
    """Tell which frames look at the picture and not at its border or its mask.

    A frame passes if its centre is usable and at most an eighth of its region's rim is not; the
    mask's own outline, which detectors love, fails the second condition. Outside the picture
    nothing is usable.

    Parameters
    ----------
    image_shape : (height, width) of the detection image.
    usable : (h, w) bool, True = scenery; None = everywhere.

    Returns
    -------
    (n,) bool.
    """
    if usable is not None and usable.shape != image_shape:
        raise ValueError(
            f"mask: found shape {usable.shape}, expected that of the image, {image_shape}; "
            "resize the mask with the image"
        )
    turn = 2 * np.pi * np.arange(_RIM_POINTS) / _RIM_POINTS
    circle = np.stack((np.cos(turn), np.sin(turn))).astype(np.float32)
    rim = frames.xy[:, :, None] + frames.shape @ circle
    rim_bad = ~_is_usable(rim[:, 0], rim[:, 1], image_shape, usable)
    centre_good = _is_usable(frames.xy[:, 0], frames.xy[:, 1], image_shape, usable)
    kept: NDArray[np.bool_] = centre_good & (rim_bad.mean(axis=1) <= _MAX_RIM_OUTSIDE)
    return kept


def _is_usable(
    x: NDArray[np.float32],
    y: NDArray[np.float32],
    image_shape: tuple[int, int],
    usable: NDArray[np.bool_] | None,
) -> NDArray[np.bool_]:
    columns, rows = np.rint(x).astype(np.int64), np.rint(y).astype(np.int64)
    height, width = image_shape
    good: NDArray[np.bool_] = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
    if usable is not None:
        good[good] = usable[rows[good], columns[good]]
    return good


def spread(frames: Frames, image_shape: tuple[int, int], max_frames: int) -> Frames:
    """Keep at most `max_frames`, best first and spread over the picture.

    The strongest 5 * max_frames compete. The picture is cut into about 49 square cells, and a
    cell may fill its quota with its best frames; the quota is the largest that keeps within
    `max_frames`, and what is left goes to the strongest of those refused. So a cluttered corner
    cannot take all, and a sky's noise does not displace a facade.
    """
    frames = take(sort_frames(frames), np.arange(min(len(frames), _POOL * max_frames)))
    if len(frames) <= max_frames:
        return frames
    height, width = image_shape
    side = max((height * width / _CELLS) ** 0.5, 1.0)
    columns = int(np.ceil(width / side))
    cell = (frames.xy[:, 1] // side).astype(np.int64) * columns
    cell += (frames.xy[:, 0] // side).astype(np.int64)
    rank = _rank_within(cell)
    cumulative = np.cumsum(np.bincount(rank))
    quota = int(np.searchsorted(cumulative, max_frames, side="right"))
    filling = np.flatnonzero(rank == quota)[: max_frames - int((rank < quota).sum())]
    return take(frames, np.sort(np.concatenate((np.flatnonzero(rank < quota), filling))))


def _rank_within(group: NDArray[np.int64]) -> NDArray[np.int64]:
    """Number each row among the rows of its group, in order of appearance."""
    order = np.argsort(group, kind="stable")
    _, starts, counts = np.unique(group[order], return_index=True, return_counts=True)
    rank = np.empty(len(group), np.int64)
    rank[order] = np.arange(len(group)) - np.repeat(starts, counts)
    return rank
