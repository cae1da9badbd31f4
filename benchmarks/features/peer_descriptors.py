"""Our descriptors beside programs that no one here wrote, on the same frames.

Round frames of a photograph are mapped exactly into a mildly changed version of it, so that the
right neighbour of each descriptor is known, and only the descriptors differ.
"""

from collections import defaultdict
from collections.abc import Mapping
from pathlib import Path

import cv2
import numpy as np
from mahotas.features import surf as mahotas_surf
from numpy.typing import NDArray

from benchmarks.features.float_descriptors import describe_in_floats
from benchmarks.features.overlap import in_common_part, map_frames
from benchmarks.features.pairs import read_photographs
from benchmarks.features.peer_detectors import rooted
from benchmarks.features.scores import squared_distances
from benchmarks.features.warps import warped_versions
from benchmarks.table import print_table
from contracts.config import DESCRIPTORS, DETECTORS
from contracts.records import Frames
from retrieval.descriptors import describe
from retrieval.detectors import detect
from retrieval.patches import MAGNIFICATION, PATCH_SIDE
from retrieval.pyramid import Pyramid, build_pyramid
from retrieval.selection import mean_radius, round_frames, take

_PER_DETECTOR = 200
_MILD = {
    ("scale", "1/1.5"),
    ("blur", "1.5 px"),
    ("light", "gamma 0.5"),
    ("light", "gamma 2"),
    ("light", "contrast 0.4"),
    ("JPEG", "quality 30"),
    ("JPEG", "quality 10"),
}
_FIRST_SIGMA = 1.6
_LAYERS = 3
_SPAN = MAGNIFICATION * PATCH_SIDE / (PATCH_SIDE - 1)
"""Half the side of what our cells cover, in radii."""
_COMPARED_WITH = {
    "OpenCV SIFT, its level": "sift",
    "OpenCV SIFT, our level": "sift",
    "mahotas SURF": "surf",
    **{f"{name} in {kind}": name for name in DESCRIPTORS for kind in ("float32", "float16")},
}

Vectors = Mapping[str, NDArray[np.generic]]


def run(data: Path) -> None:
    """Print right neighbours by descriptor and change."""
    right: dict[tuple[str, str], list[float]] = defaultdict(list)
    same: dict[str, list[float]] = defaultdict(list)
    for photograph in read_photographs(data):
        pyramid = build_pyramid(photograph.rgb)
        frames = round_frames_of_all(pyramid)
        for warped in warped_versions(photograph.rgb):
            if (warped.family, warped.degree) not in _MILD:
                continue
            seen = in_common_part(frames, warped.homography, warped.rgb.shape)
            here = take(frames, seen)
            there = map_frames(here, warped.homography)
            other = build_pyramid(warped.rgb)
            nearest = _nearest(_all_vectors(pyramid, here), _all_vectors(other, there))
            truth = np.arange(len(next(iter(nearest.values()))))
            for name, found in nearest.items():
                right[name, warped.family].append(float((found == truth).mean()))
                if name in _COMPARED_WITH:
                    same[name].append(float((found == nearest[_COMPARED_WITH[name]]).mean()))
    families = list(dict.fromkeys(family for _, family in right))
    rows = [
        (
            name,
            *(f"{np.mean(right[name, family]):.4f}" for family in families),
            f"{np.mean(same[name]):.4f}" if same[name] else "",
        )
        for name in dict.fromkeys(name for name, _ in right)
    ]
    print("Right nearest neighbours; the last column: the same neighbour as ours of that kind\n")
    print_table(("", *families, "as ours"), rows)


def round_frames_of_all(pyramid: Pyramid) -> Frames:
    """The best 200 frames of each detector, made round."""
    found = [detect(pyramid, detector, _PER_DETECTOR) for detector in DETECTORS]
    xy = np.concatenate([frames.xy for frames in found])
    radius = np.concatenate([mean_radius(frames.shape) for frames in found])
    return round_frames(xy, radius, np.zeros(len(xy), np.float32))


def _nearest(here: Vectors, there: Vectors) -> dict[str, NDArray[np.intp]]:
    """Nearest neighbours, by descriptor, among the frames that every program describes."""
    kept = np.ones(len(next(iter(here.values()))), np.bool_)
    for vectors in (*here.values(), *there.values()):
        kept &= np.isfinite(vectors.astype(np.float32)).all(axis=1)
    return {
        name: squared_distances(here[name][kept], there[name][kept]).argmin(axis=1) for name in here
    }


def _all_vectors(pyramid: Pyramid, frames: Frames) -> dict[str, NDArray[np.generic]]:
    vectors: dict[str, NDArray[np.generic]] = {}
    radius = mean_radius(frames.shape)
    ours = describe(pyramid, frames, DESCRIPTORS)
    floats = describe_in_floats(pyramid, frames)
    vectors["sift"] = ours["sift"]
    vectors["OpenCV SIFT, its level"] = opencv_sift(pyramid, frames.xy, radius, 0.5)
    vectors["OpenCV SIFT, our level"] = opencv_sift(
        pyramid, frames.xy, radius, 2 * MAGNIFICATION / (PATCH_SIDE - 1)
    )
    vectors["surf"] = ours["surf"]
    vectors["mahotas SURF"] = mahotas_vectors(pyramid, frames.xy, radius)
    vectors["sc"] = ours["sc"]
    for name in DESCRIPTORS:
        # About zero, as half floats are finest there.
        centred = (floats[name] - (128 if name == "surf" else 0)) / 256
        vectors[f"{name} in float32"] = centred
        vectors[f"{name} in float16"] = centred.astype(np.float16)
    return vectors


def opencv_sift(
    pyramid: Pyramid,
    xy: NDArray[np.float32],
    radius: NDArray[np.float32],
    sigma_per_radius: float,
) -> NDArray[np.float32]:
    """OpenCV's SIFT, square-rooted, upright, its 4 x 4 cells over the same square as ours.

    Parameters
    ----------
    sigma_per_radius : which blur to read gradients from; OpenCV's own detector gives 0.5.
    """
    program = cv2.SIFT.create(nOctaveLayers=_LAYERS, enable_precise_upscale=True)
    keypoints = []
    for (x, y), r in zip(xy.tolist(), radius.tolist(), strict=True):
        # A cell is 1.5 times the size wide, and there are four.
        steps = round(_LAYERS * np.log2(max(sigma_per_radius * r / _FIRST_SIGMA, 0.5)))
        octave, layer = divmod(steps, _LAYERS)
        packed = (octave & 255) | (layer << 8)
        size = 2 * _SPAN * r / (4 * 1.5)
        keypoints.append(cv2.KeyPoint(x, y, size, 0, 0, packed))
    _, vectors = program.compute(pyramid.grey8, keypoints)
    return rooted(np.asarray(vectors, np.float32).reshape(-1, 128))


def mahotas_vectors(
    pyramid: Pyramid, xy: NDArray[np.float32], radius: NDArray[np.float32]
) -> NDArray[np.float64]:
    """SURF of mahotas, turned to each frame's dominant direction; NaN where it gives none."""
    points = np.zeros((len(xy), 5))
    points[:, 0], points[:, 1] = xy[:, 1], xy[:, 0]
    points[:, 2] = 2 * _SPAN * radius / 20  # SURF's window is 20 scales wide.
    points[:, 3] = np.arange(len(xy))
    found = mahotas_surf.descriptors(pyramid.grey8, points)
    vectors = np.full((len(xy), 64), np.nan)
    vectors[found[:, 3].astype(np.intp)] = found[:, 6:]
    return vectors
