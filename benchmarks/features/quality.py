"""How well frames repeat and descriptors match, against known truth."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.features.pairs import Photograph, read_photographs, read_wide_pairs
from benchmarks.features.scores import (
    Described,
    print_warp_scores,
    print_wide_scores,
    score_warp,
    score_wide,
)
from benchmarks.features.warps import warped_versions
from contracts.config import DESCRIPTORS, DETECTORS
from retrieval.descriptors import describe
from retrieval.detectors import detect
from retrieval.pyramid import build_pyramid

MAX_FRAMES = 1000


def run(data: Path) -> None:
    """Print the tables of warps and of wide baselines."""
    measure_warps(read_photographs(data), describe_all)
    print()
    measure_wide_baselines(data, describe_all)


def measure_warps(
    photographs: Sequence[Photograph],
    find: Callable[[NDArray[np.uint8]], Mapping[str, Described]],
) -> None:
    """Print how what `find` finds, by name, repeats and matches on every warp."""
    scores = []
    for photograph in photographs:
        here = find(photograph.rgb)
        for warped in warped_versions(photograph.rgb):
            there = find(warped.rgb)
            scores += [
                score_warp(name, photograph.rgb, warped, here[name], there[name]) for name in here
            ]
    print_warp_scores(scores)


def measure_wide_baselines(
    data: Path, find: Callable[[NDArray[np.uint8]], Mapping[str, Described]]
) -> None:
    """Print how what `find` finds, by name, repeats and matches on wide baselines."""
    scores = []
    for pair in read_wide_pairs(data):
        first, second = find(pair.first), find(pair.second)
        scores += [score_wide(name, pair, first[name], second[name]) for name in first]
    print_wide_scores(scores)


def describe_all(rgb: NDArray[np.uint8]) -> dict[str, Described]:
    """Run every detector and descriptor on a picture."""
    pyramid = build_pyramid(rgb)
    found: dict[str, Described] = {}
    for detector in DETECTORS:
        frames = detect(pyramid, detector, MAX_FRAMES)
        described = describe(pyramid, frames, DESCRIPTORS)
        found[detector] = Described(frames, {name: described[name] for name in DESCRIPTORS})
    return found
