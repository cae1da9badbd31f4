"""What is known of a candidate, a pair of detectors and k, before it is chosen for a photo.

How the detectors complement each other in the photo (METHOD section 4), how crowded the words of
the index are, and what a first look at the rankings shows; none of it needs the truth.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from math import log

import numpy as np
from numpy.typing import NDArray

from contracts.config import Detector
from retrieval.complementarity import Complementarity
from retrieval.fusion import Scores
from retrieval.score_curves import agreement, curve_features
from retrieval.ways import Sizes, Votes, fused_group

Pair = tuple[Detector, Detector]
Candidate = tuple[Pair, int]
"""A pair of detectors and k."""

COMPLEMENTARITY = ("Kp", "CSDi", "CSCo", "CSCl")
CROWDING = ("crowding", "crowding_squared")
CURVE = ("second_gap", "mean_gap", "z_score", "area", "gain")
AGREEMENT = ("agreement", "consensus")
LOOK = CURVE + AGREEMENT
"""What only rankings by the candidates show."""

FEATURES = COMPLEMENTARITY + CROWDING + LOOK

_LEAST_DENSITY = 1e-9


@dataclass(frozen=True, slots=True)
class FirstLook:
    """What the candidates' rankings of one photo are made of.

    votes : of every detector and k. sizes : distinct words of each image, for `norm`.
    junk : images that are not to be seen, such as the photo itself.
    """

    votes: Votes
    sizes: Sizes
    junk: Collection[int] = ()


def candidate_features(
    complementarities: Mapping[Pair, Complementarity],
    density: Mapping[Detector, float],
    ks: Collection[int],
    look: FirstLook | None,
) -> dict[Candidate, tuple[float, ...]]:
    """Describe every pair with every k, in the order of `FEATURES`.

    crowding : ln(k x density), the mean share of the images that a keypoint's k words reach.
    agreement : of the two detectors' own first answers. consensus : of the pair's first answers
    with those of all detectors together. The others: see `Complementarity`, `CurveFeatures`.

    Parameters
    ----------
    complementarities : of the pairs to describe.
    density : by detector, the mean share of the images that have one of its words.
    look : None: the features that need rankings are left out.
    """
    described: dict[Candidate, tuple[float, ...]] = {}
    for k in ks:
        for pair, complementarity in complementarities.items():
            crowding = log(k * max(sum(density[name] for name in pair) / 2, _LEAST_DENSITY))
            described[pair, k] = (*complementarity.as_tuple(), crowding, crowding**2)
    if look is None:
        return described
    detectors = tuple(dict.fromkeys(name for pair in complementarities for name in pair))
    for k in ks:
        everything = _ranked(look, detectors, k)
        alone = {name: _ranked(look, (name,), k) for name in detectors}
        for pair in complementarities:
            together = _ranked(look, pair, k)
            curve = curve_features(together)
            described[pair, k] += (
                curve.second_gap,
                curve.mean_gap,
                curve.z_score,
                curve.area,
                curve.gain,
                agreement(alone[pair[0]], alone[pair[1]]),
                agreement(together, everything),
            )
    return described


def _ranked(look: FirstLook, group: tuple[Detector, ...], k: int) -> Scores:
    scores = fused_group(look.votes, group, k, look.sizes)
    if not look.junk:
        return scores
    touched: NDArray[np.bool_] = scores.touched.copy()
    touched[list(look.junk)] = False
    return Scores(np.where(touched, scores.values, 0.0), touched)
