"""From described frames to figures: one score a pair of pictures, and tables over many."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.features.overlap import View, repeated
from benchmarks.features.pairs import WidePair
from benchmarks.features.warps import Picture, Warped
from benchmarks.features.wide_baseline import agreeing, predict, scattered_within
from benchmarks.table import print_table
from contracts.records import Frames

_MIN_SHARE, _MIN_RIGHT = 0.02, 5
"""A pair of photographs counts as matched with so many right neighbours; chance gives 0.1 %."""


@dataclass(frozen=True, slots=True)
class Described:
    """What one detector finds in one picture; descriptors (n, D) by name."""

    frames: Frames
    descriptors: Mapping[str, NDArray[np.generic]]


@dataclass(frozen=True, slots=True)
class WarpScore:
    """Figures of one detector on one warped photograph; matching scores by descriptor."""

    detector: str
    family: str
    n_frames: int
    repeatability: float
    chance: float
    own_size: float
    matching: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class WideScore:
    """Counts of one detector on one pair of photographs.

    n_predicted : frames of the first with truth; of these, found again: n_repeated, and by
    chance: n_lucky. right : nearest neighbours that are right, by descriptor.
    """

    detector: str
    n_predicted: int
    n_repeated: int
    n_lucky: int
    right: Mapping[str, int]


def squared_distances(
    first: NDArray[np.generic], second: NDArray[np.generic]
) -> NDArray[np.float32]:
    """Squared L2 distances (n, m) float32 of descriptors; exact where they are uint8."""
    one, other = first.astype(np.float32), second.astype(np.float32)
    squares = (one**2).sum(axis=1)[:, None] + (other**2).sum(axis=1)[None]
    return np.asarray(squares - 2 * one @ other.T, np.float32)


def score_warp(
    detector: str, rgb: Picture, warped: Warped, one: Described, other: Described
) -> WarpScore:
    """Judge what was found in a photograph and in its warped version."""
    found = repeated(
        View(one.frames, rgb.shape), View(other.frames, warped.rgb.shape), warped.homography
    )
    matching = {}
    for name in one.descriptors:
        here, there = one.descriptors[name][found.first], other.descriptors[name][found.second]
        matching[name] = found.matched(squared_distances(here, there))
    return WarpScore(
        detector,
        warped.family,
        len(other.frames),
        found.share,
        found.chance,
        found.own_size,
        matching,
    )


def score_wide(detector: str, pair: WidePair, one: Described, other: Described) -> WideScore:
    """Judge what was found in two photographs of one place."""
    predicted = predict(pair, one.frames)
    agree = agreeing(predicted, other.frames)
    lucky = agreeing(predicted, scattered_within(other.frames, predicted))
    right = {}
    for name in one.descriptors:
        here = one.descriptors[name][predicted.rows]
        nearest = squared_distances(here, other.descriptors[name]).argmin(axis=1)
        right[name] = int(agree[np.arange(len(nearest)), nearest].sum())
    return WideScore(
        detector,
        len(predicted.rows),
        int(agree.any(axis=1).sum()),
        int(lucky.any(axis=1).sum()),
        right,
    )


def print_warp_scores(scores: Sequence[WarpScore]) -> None:
    """Print two tables: repeatability by family, and matching scores."""
    detectors = list(dict.fromkeys(score.detector for score in scores))
    families = list(dict.fromkeys(score.family for score in scores))
    names = list(dict.fromkeys(name for score in scores for name in score.matching))
    repeats, matches = [], []
    for detector in detectors:
        mine = [score for score in scores if score.detector == detector]
        row = []
        for family in families:
            of_family = [score for score in mine if score.family == family]
            row.append(_with_chance(of_family))
        own = np.mean([score.own_size for score in mine])
        frames = np.mean([score.n_frames for score in mine])
        repeats.append((detector, *row, _with_chance(mine), f"{own:.3f}", f"{frames:.0f}"))
        means = [
            f"{np.mean([score.matching[name] for score in mine]):.3f}"
            if name in mine[0].matching
            else ""
            for name in names
        ]
        matches.append((detector, *means))
    print("Repeatability at 0.4 (by chance), means over pairs\n")
    print_table(("", *families, "all", "all, own size", "frames"), repeats)
    print("\nMatching score, means over all warps\n")
    print_table(("", *names), matches)


def _with_chance(scores: Sequence[WarpScore]) -> str:
    share = np.mean([score.repeatability for score in scores])
    chance = np.mean([score.chance for score in scores])
    return f"{share:.3f} ({chance:.2f})"


def print_wide_scores(scores: Sequence[WideScore]) -> None:
    """Print repeatability, chance and right neighbours, pooled over pairs of photographs."""
    names = list(dict.fromkeys(name for score in scores for name in score.right))
    rows = []
    for detector in dict.fromkeys(score.detector for score in scores):
        mine = [score for score in scores if score.detector == detector]
        n = sum(score.n_predicted for score in mine)
        shares = [
            f"{sum(score.n_repeated for score in mine) / n:.3f}",
            f"{sum(score.n_lucky for score in mine) / n:.3f}",
        ]
        for name in names:
            if name not in mine[0].right:
                shares.append("")
                continue
            right = sum(score.right[name] for score in mine)
            pairs = sum(is_matched(score, name) for score in mine)
            shares.append(f"{right / n:.4f}, {pairs}/{len(mine)}")
        rows.append((detector, str(n), *shares))
    print("Wide baselines: share found again; share of right neighbours, pairs matched\n")
    print_table(("", "frames with truth", "repeatability", "by chance", *names), rows)


def is_matched(score: WideScore, name: str) -> bool:
    """Tell whether a pair of photographs has clearly more right neighbours than chance gives."""
    return score.right[name] >= max(_MIN_RIGHT, _MIN_SHARE * score.n_predicted)
