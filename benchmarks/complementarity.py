"""Complementarity of all 15 pairs of a photo's detectors, beside SciPy for two of the scores."""

import time
from collections.abc import Callable
from itertools import combinations
from pathlib import Path

import cv2
import numpy as np
from scipy.spatial import KDTree
from scipy.spatial.distance import pdist

from benchmarks.table import print_table
from contracts.config import DETECTORS, Detector, FeatureConfig
from contracts.records import Frames
from retrieval.complementarity import all_pairs
from retrieval.detectors import detect
from retrieval.pyramid import build_pyramid
from survey import decode_image

_ROUNDS = 5
_PHOTO_STEP = 5


def run(data: Path) -> None:
    """Time every fifth query of kth, one thread; the best of five rounds a photo."""
    cv2.setNumThreads(1)
    limit = FeatureConfig().max_frames
    ours, peer = [], []
    for path in sorted((data / "kth-buildings" / "queries").glob("*.jpg"))[::_PHOTO_STEP]:
        rgb = decode_image(path, max_side_px=1024).rgb
        height, width = rgb.shape[:2]
        pyramid = build_pyramid(rgb)
        frames: dict[Detector, Frames] = {
            name: detect(pyramid, name, limit, None) for name in DETECTORS
        }
        ours.append(_best(lambda f=frames, w=width, h=height: all_pairs(f, w, h)))  # type: ignore[misc]
        peer.append(_best(lambda f=frames: _by_scipy(f)))  # type: ignore[misc]
    print_table(
        ("ms a photo", "median", "slowest"),
        [
            (name, f"{1e3 * np.median(times):.0f}", f"{1e3 * max(times):.0f}")
            for name, times in (
                ("Kp, CSDi, CSCo, CSCl of 15 pairs", ours),
                ("SciPy: CSDi (pdist) and CSCo (KDTree) alone", peer),
            )
        ],
    )


def _best(work: Callable[[], object]) -> float:
    seconds = []
    for _ in range(_ROUNDS):
        started = time.perf_counter()
        work()
        seconds.append(time.perf_counter() - started)
    return min(seconds)


def _by_scipy(frames: dict[Detector, Frames]) -> None:
    for a, b in combinations(frames.values(), 2):
        first, second = a.xy.astype(np.float64), b.xy.astype(np.float64)
        distances = pdist(np.concatenate([first, second]))
        (1.0 / distances[distances >= 1]).sum()
        KDTree(second).query(first)
        KDTree(first).query(second)
