"""Our detectors beside programs that no one here wrote, on the same pictures."""

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from pyhesaff import _hesaff

from benchmarks.features.pairs import read_photographs
from benchmarks.features.quality import MAX_FRAMES, measure_warps, measure_wide_baselines
from benchmarks.features.scores import Described
from benchmarks.features.warps import Picture
from contracts.records import Frames
from retrieval.descriptors import describe
from retrieval.detectors import detect
from retrieval.pyramid import Pyramid, build_pyramid
from retrieval.selection import round_frames, sort_frames, spread, take

_THRESHOLD = 16 / 3
"""pyhesaff's default."""
_MAGNIFICATION = 3.0
"""pyhesaff gives the ellipse that it describes: 3 times the region."""
_TRIALS = 6
_NO_LIMIT = 20_000
_HARRIS_RADIUS_PER_SIZE = 0.7
"""Makes the median region of OpenCV's Harris-Laplace as large as that of ours."""


def run(data: Path) -> None:
    """Print hesaff beside pyhesaff and har beside OpenCV's, at equal numbers of frames."""
    photographs = read_photographs(data)
    for title, find in (("hesaff and pyhesaff", find_hessian), ("har and OpenCV", find_harris)):
        print(f"\n### {title}\n")
        measure_warps(photographs, find)
        print()
        measure_wide_baselines(data, find)


def find_hessian(rgb: Picture) -> dict[str, Described]:
    """Ours beside pyhesaff 2.2 (Perdoch's program), which reports no response.

    Once with all that its default threshold finds, once with its threshold raised until at most
    1000 are left, each beside as many of ours: spread over the picture, as Flaneur uses them, and
    the strongest, as pyhesaff's are.
    """
    grey = np.asarray(cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY), np.uint8)
    pyramid = build_pyramid(rgb)
    every = detect(pyramid, "hesaff", _NO_LIMIT)
    found = {}
    for title, threshold in (("best", _threshold_for(grey)), ("all", _THRESHOLD)):
        ellipses, vectors = _hesaff.detect_image(grey, threshold=threshold)
        theirs = _frames_of(ellipses)
        number = max(len(theirs), 1)
        strongest = take(every, np.arange(min(number, len(every))))
        for kind, ours in (("spread", detect(pyramid, "hesaff", number)), ("strongest", strongest)):
            found[f"ours, {title}, {kind}"] = Described(ours, _our_sift(pyramid, ours))
        names = {"its sift": vectors, "its sift, rooted": rooted(vectors)}
        both = Described(theirs, {**_our_sift(pyramid, theirs), **names})
        found[f"pyhesaff, {title}"] = both
    return found


def _threshold_for(grey: Picture) -> float:
    """Threshold that leaves at most 1000 frames and nearly so many."""
    low, high = 0.2, 60.0
    for _ in range(_TRIALS):
        middle = float(np.sqrt(low * high))
        if _hesaff.count_image(grey, threshold=middle) > MAX_FRAMES:
            low = middle
        else:
            high = middle
    return high


def _frames_of(ellipses: NDArray[np.float32]) -> Frames:
    """Frames of pyhesaff's rows x, y, a, b, c: [[a, 0], [b, c]] maps the unit circle."""
    shape = np.zeros((len(ellipses), 2, 2), np.float32)
    shape[:, 0, 0], shape[:, 1, 0], shape[:, 1, 1] = ellipses[:, 2:5].T / _MAGNIFICATION
    return Frames(np.ascontiguousarray(ellipses[:, :2]), shape, np.zeros(len(ellipses), np.float32))


def find_harris(rgb: Picture) -> dict[str, Described]:
    """Ours beside OpenCV's Harris-Laplace, its best by response and spread as ours are."""
    grey = np.asarray(cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY), np.uint8)
    program = cv2.xfeatures2d.HarrisLaplaceFeatureDetector.create(
        corn_thresh=1e-4, DOG_thresh=0.003, maxCorners=20_000
    )
    rows = [(k.pt[0], k.pt[1], k.size, k.response) for k in program.detect(grey)]
    table = np.array(rows, np.float32).reshape(-1, 4)
    radius = _HARRIS_RADIUS_PER_SIZE * table[:, 2]
    theirs = sort_frames(round_frames(table[:, :2], radius, table[:, 3]))
    strongest = take(theirs, np.arange(min(len(theirs), MAX_FRAMES)))
    pyramid = build_pyramid(rgb)
    found = {
        "ours": detect(pyramid, "har", MAX_FRAMES),
        "OpenCV, strongest": strongest,
        "OpenCV, spread": spread(theirs, (grey.shape[0], grey.shape[1]), MAX_FRAMES),
    }
    return {name: Described(frames, _our_sift(pyramid, frames)) for name, frames in found.items()}


def _our_sift(pyramid: Pyramid, frames: Frames) -> dict[str, NDArray[np.generic]]:
    return {"our sift": describe(pyramid, frames, ["sift"])["sift"]}


def rooted(vectors: NDArray[np.generic]) -> NDArray[np.float32]:
    """RootSIFT of SIFT vectors (n, 128): square root after dividing by their sum."""
    wide = vectors.astype(np.float32)
    return np.asarray(np.sqrt(wide / np.maximum(wide.sum(axis=1, keepdims=True), 1e-9)), np.float32)
