"""Milliseconds per detector and per descriptor, with COLMAP's SIFT on CPU in the same run."""

import time
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import TypeVar

import cv2
import numba
import numpy as np
import pycolmap
from numpy.typing import NDArray
from pyhesaff import _hesaff

from benchmarks.table import print_table
from contracts.config import DESCRIPTORS, DETECTORS, FeatureConfig
from retrieval.descriptors import describe
from retrieval.detectors import detect
from retrieval.features import compile_kernels, extract
from retrieval.pyramid import build_pyramid
from survey import decode_image

N_PHOTOS = 12
ROUNDS = 3
COLMAP_FEATURES = 2000
WHOLE = f"whole: decode, {len(DETECTORS)} detectors x {len(DESCRIPTORS)} descriptors"
COLMAP = f"COLMAP {pycolmap.__version__} SIFT, {COLMAP_FEATURES} features"

_T = TypeVar("_T")


def run(data: Path) -> None:
    """Time every step on real photographs of 1024 px, one thread; the best round of each counts.

    Rounds take turns over all steps, so that a noisy minute does not hit one of them alone.
    """
    cv2.setNumThreads(1)
    numba.set_num_threads(1)
    pycolmap.logging.minloglevel = 2  # it tells of every extractor
    compile_kernels()
    every = sorted((data / "kth-buildings" / "references").glob("*.jpg"))
    photos = every[:: max(len(every) // N_PHOTOS, 1)][:N_PHOTOS]
    best = [_best_of_rounds(photo) for photo in photos]
    mean = {step: 1000 * sum(times[step] for times in best) / len(best) for step in best[0]}
    print(
        f"{len(photos)} photographs of 1024 px, {FeatureConfig().max_frames} frames a detector, "
        f"one thread, best of {ROUNDS} rounds, decoding included\n"
    )
    print_table(("step", "ms a photo"), [(step, f"{mean[step]:.0f}") for step in _order(mean)])
    slowest = max(1000 * times[WHOLE] for times in best)
    print(f"\nSlowest photograph {slowest:.0f} ms; whole / COLMAP {mean[WHOLE] / mean[COLMAP]:.2f}")


def _order(steps: Iterable[str]) -> list[str]:
    """Detectors, then descriptors, then the whole, then peers."""
    first = ["decode", "pyramid", *DETECTORS]
    return sorted(steps, key=lambda step: first.index(step) if step in first else len(first))


def _best_of_rounds(photo: Path) -> Mapping[str, float]:
    best: dict[str, float] = defaultdict(lambda: float("inf"))
    for _ in range(ROUNDS):
        for step, seconds in _steps(photo).items():
            best[step] = min(best[step], seconds)
    return best


def _steps(photo: Path) -> dict[str, float]:
    seconds: dict[str, float] = {}

    def timed(step: str, call: Callable[[], _T]) -> _T:
        started = time.perf_counter()
        result = call()
        seconds[step] = seconds.get(step, 0.0) + time.perf_counter() - started
        return result

    config = FeatureConfig()
    rgb = timed("decode", lambda: decode_image(photo).rgb)
    pyramid = timed("pyramid", lambda: build_pyramid(rgb))
    for detector in DETECTORS:
        frames = timed(detector, partial(detect, pyramid, detector, config.frames_of(detector)))
        for descriptor in DESCRIPTORS:
            timed(f"{descriptor}, alone", partial(describe, pyramid, frames, (descriptor,)))
        timed("the three descriptors", partial(describe, pyramid, frames, DESCRIPTORS))
    timed(WHOLE, lambda: extract(decode_image(photo).rgb, None, config))
    timed(COLMAP, partial(_colmap, photo))
    grey = cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY)
    for name, program in _peers().items():
        timed(name, partial(program, grey))
    return seconds


def _peers() -> dict[str, Callable[[NDArray[np.uint8]], object]]:
    """What other programs' detectors take for a grey picture, by their defaults."""
    return {
        "pyhesaff, frames and its SIFT": _hesaff.detect_image,
        "OpenCV Harris-Laplace": cv2.xfeatures2d.HarrisLaplaceFeatureDetector.create().detect,
        "OpenCV MSER": cv2.MSER.create().detectRegions,
    }


def _colmap(photo: Path) -> NDArray[np.float32]:
    options = pycolmap.FeatureExtractionOptions()
    options.num_threads = 1
    options.sift.max_num_features = COLMAP_FEATURES
    grey = cv2.cvtColor(decode_image(photo).rgb, cv2.COLOR_RGB2GRAY)
    _, descriptors = pycolmap.Sift(options, pycolmap.Device.cpu).extract(grey)
    return descriptors
