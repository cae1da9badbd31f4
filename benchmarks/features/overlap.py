"""Repeatability and matching score: which frames of two pictures cover the same part of a scene.

Mikolajczyk et al., IJCV 2005, "A comparison of affine region detectors". Frames of the first
picture are mapped into the second. As in their program, both sizes of a pair are multiplied so
that the mapped frame has a radius of 30 px, while centres stay where they are; the overlap error is
1 - intersection / union, and a pair corresponds at an error of at most 0.4. That forgives small
frames some 10 px, so dense frames repeat by luck: the measure is printed beside chance, and
beside the same measure with frames of their own size, which have to lie within 0.4 radii or so.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from benchmarks.features.warps import map_points
from contracts.records import Frames
from retrieval.kernels import kernel
from retrieval.selection import mean_radius, take

MAX_ERROR = 0.4
_NORMAL_RADIUS = 30.0
_SCANLINES = 64


@dataclass(frozen=True, slots=True)
class Correspondences:
    """Pairs of frames that overlap, least error first.

    first, second : (n,) intp, rows of the two sets of frames. error : (n,) float64.
    """

    first: NDArray[np.intp]
    second: NDArray[np.intp]
    error: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class View:
    """The frames of one picture. shape : (height, width, ...) of the picture."""

    frames: Frames
    shape: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Repeated:
    """How two pictures' frames repeat.

    share : one-to-one correspondences over the smaller number of frames in the common part.
    chance : the same with the second picture's frames in random places. own_size : as `share`, of
    frames of their own size. pairs : all correspondences, rows of the frames given.
    first, second : rows of the frames in the common part.
    """

    share: float
    chance: float
    own_size: float
    pairs: Correspondences
    first: NDArray[np.intp]
    second: NDArray[np.intp]

    def matched(self, distances: NDArray[np.float32]) -> float:
        """Matching score: frames whose nearest neighbour corresponds, over the smaller number.

        Parameters
        ----------
        distances : (n, m) float32, between the descriptors of `first` and those of `second`.
        """
        smaller = min(len(self.first), len(self.second))
        if not smaller:
            return 0.0
        nearest = self.second[distances.argmin(axis=1)]
        right = np.zeros((self.first.max() + 1, self.second.max() + 1), np.bool_)
        right[self.pairs.first, self.pairs.second] = True
        return float(right[self.first, nearest].sum() / smaller)


def repeated(one: View, other: View, homography: NDArray[np.float64]) -> Repeated:
    """Compare the frames of two pictures; `homography` maps pixels of `one` to the other's."""
    back = np.asarray(np.linalg.inv(homography), np.float64)
    first = np.flatnonzero(in_common_part(one.frames, homography, other.shape))
    second = np.flatnonzero(in_common_part(other.frames, back, one.shape))
    mapped = map_frames(take(one.frames, first), homography)
    there = take(other.frames, second)
    smaller = max(min(len(first), len(second)), 1)
    pairs = correspondences(mapped, there)
    own = correspondences(mapped, there, normalised=False)
    lucky = correspondences(mapped, _scattered(there, other.shape, back, one.shape))
    return Repeated(
        share=one_to_one(pairs) / smaller,
        chance=one_to_one(lucky) / smaller,
        own_size=one_to_one(own) / smaller,
        pairs=Correspondences(first[pairs.first], second[pairs.second], pairs.error),
        first=first,
        second=second,
    )


def _scattered(
    frames: Frames,
    shape: tuple[int, ...],
    back: NDArray[np.float64],
    other_shape: tuple[int, ...],
) -> Frames:
    """Put the frames in random places of the common part."""
    rng = np.random.default_rng(0)
    xy = np.empty((0, 2), np.float32)
    while len(xy) < len(frames):
        drawn = rng.uniform(-0.5, np.array(shape[1::-1]) - 0.5, (len(frames), 2))
        somewhere = Frames(drawn.astype(np.float32), frames.shape, frames.response)
        xy = np.concatenate((xy, somewhere.xy[in_common_part(somewhere, back, other_shape)]))
    return Frames(xy[: len(frames)], frames.shape, frames.response)


def map_frames(frames: Frames, homography: NDArray[np.float64]) -> Frames:
    """Map frames by a homography: centres exactly, shapes by its derivative there."""
    xy = frames.xy.astype(np.float64)
    depth = xy @ homography[2, :2] + homography[2, 2]
    mapped = map_points(homography, xy)
    derivative = homography[None, :2, :2] - mapped[:, :, None] * homography[None, 2:, :2]
    shape = (derivative / depth[:, None, None]) @ frames.shape
    return Frames(mapped.astype(np.float32), shape.astype(np.float32), frames.response)


def in_common_part(
    frames: Frames, homography: NDArray[np.float64], other_shape: tuple[int, ...]
) -> NDArray[np.bool_]:
    """Tell which centres the other picture, of (height, width, ...), shows too."""
    xy = map_points(homography, frames.xy.astype(np.float64)) + 0.5
    within = (xy >= 0) & (xy < (other_shape[1], other_shape[0]))
    return np.asarray(within.all(axis=1))


def correspondences(first: Frames, second: Frames, *, normalised: bool = True) -> Correspondences:
    """Find all pairs with an overlap error of at most 0.4.

    Parameters
    ----------
    first : already mapped into the second picture.
    """
    if not len(first) or not len(second):
        return Correspondences(np.empty(0, np.intp), np.empty(0, np.intp), np.empty(0))
    squares, others = _squared(first.shape), _squared(second.shape)
    radius = mean_radius(first.shape).astype(np.float64)
    factor = _NORMAL_RADIUS / radius if normalised else np.ones(len(first))
    # Ellipses that share more than half of their union contain each other's centres: otherwise a
    # line through one's centre has the other on one side, and with it half of the one at most.
    reach = factor * np.sqrt(np.linalg.eigvalsh(squares)[:, 1])
    near = KDTree(second.xy).query_ball_point(first.xy, reach * (1 + 1e-6))
    rows = np.repeat(np.arange(len(first)), [len(found) for found in near])
    columns = np.concatenate([np.asarray(found, np.intp) for found in near])
    ratio = mean_radius(second.shape)[columns] / radius[rows]
    alike = np.abs(np.log(ratio)) <= -0.5 * np.log(1 - MAX_ERROR) + 1e-6
    rows, columns = rows[alike], columns[alike]
    offset = (second.xy[columns] - first.xy[rows]).astype(np.float64) / factor[rows, None]
    error = overlap_errors(squares[rows], others[columns], offset)
    order = np.lexsort((columns, rows, error))
    order = order[error[order] <= MAX_ERROR]
    return Correspondences(rows[order], columns[order], error[order])


def one_to_one(pairs: Correspondences) -> int:
    """Count pairs, taking the least error first and every frame once at most."""
    return int(_count_greedily(pairs.first.astype(np.int64), pairs.second.astype(np.int64)))


def _squared(shape: NDArray[np.float32]) -> NDArray[np.float64]:
    """S S^T: the ellipse itself, whichever way the frame is turned."""
    wide = shape.astype(np.float64)
    return wide @ wide.transpose(0, 2, 1)


@kernel
def overlap_errors(
    first: NDArray[np.float64], second: NDArray[np.float64], offset: NDArray[np.float64]
) -> NDArray[np.float64]:
    """1 - intersection / union of pairs of ellipses, by 64 scan lines of exact length.

    Parameters
    ----------
    first, second : (n, 2, 2), S S^T of the two shapes. offset : (n, 2), second centre - first.
    """
    errors = np.ones(len(offset))
    for i in range(len(offset)):
        reach, other_reach = np.sqrt(first[i, 1, 1]), np.sqrt(second[i, 1, 1])
        low = max(-reach, offset[i, 1] - other_reach)
        high = min(reach, offset[i, 1] + other_reach)
        if low >= high:
            continue
        shared = 0.0
        for line in range(_SCANLINES):
            y = low + (high - low) * (line + 0.5) / _SCANLINES
            middle, half = _chord(first[i], y)
            other_middle, other_half = _chord(second[i], y - offset[i, 1])
            other_middle += offset[i, 0]
            length = min(middle + half, other_middle + other_half)
            length -= max(middle - half, other_middle - other_half)
            shared += max(length, 0.0)
        shared *= (high - low) / _SCANLINES
        union = np.pi * (_root_determinant(first[i]) + _root_determinant(second[i])) - shared
        errors[i] = 1.0 - shared / union
    return errors


@kernel
def _chord(square: NDArray[np.float64], y: float) -> tuple[float, float]:
    """Middle and half length of the ellipse's chord at height y."""
    inner = max(1.0 - y * y / square[1, 1], 0.0)
    half = _root_determinant(square) / np.sqrt(square[1, 1]) * np.sqrt(inner)
    return y * square[0, 1] / square[1, 1], half


@kernel
def _root_determinant(square: NDArray[np.float64]) -> float:
    return float(np.sqrt(square[0, 0] * square[1, 1] - square[0, 1] * square[1, 0]))


@kernel
def _count_greedily(first: NDArray[np.int64], second: NDArray[np.int64]) -> int:
    if len(first) == 0:
        return 0
    used = np.zeros(first.max() + 1, np.bool_)
    taken = np.zeros(second.max() + 1, np.bool_)
    count = 0
    for i in range(len(first)):
        if not used[first[i]] and not taken[second[i]]:
            used[first[i]] = taken[second[i]] = True
            count += 1
    return count
