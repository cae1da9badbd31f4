"""Eq. 1 of Bhowmik et al., JURSE 2017: how well a pair of detectors should do on a photo.

mAP' = b1 Kp + b2 CSDi + b3 CSCo + b4 CSCl, one equation per k, no intercept. METHOD section 4
says what is reconstructed: one row per (query, pair), fitted to that query's AP. The variant
`pair_offsets` adds a constant of the pair: Eq. 1 alone cannot say that a detector is good.
"""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from contracts.config import MAX_NEIGHBOURS, Detector
from contracts.errors import WrongInput
from retrieval.complementarity import Complementarity

Pair = tuple[Detector, Detector]
K = Annotated[int, Field(ge=1, le=MAX_NEIGHBOURS)]
Four = tuple[float, float, float, float]
Variant = Literal["eq1", "pair_offsets"]

FEATURES = ("Kp", "CSDi", "CSCo", "CSCl")


@dataclass(frozen=True, slots=True)
class TrainingRow:
    """What one pair and k achieved on one query. place : queries of one are left out together."""

    query: str
    place: str
    pair: Pair
    k: int
    features: Complementarity
    ap: float


@dataclass(frozen=True, slots=True)
class Choice:
    """What a photo is to be searched with, what is expected of it, and why."""

    pair: Pair
    k: int
    predicted_map: float
    reason: str


class Record(BaseModel):
    """A part of a model's JSON: no unknown key, no wrong type, no infinity."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


class Offset(Record):
    """What a pair is worth whatever the photo."""

    pair: Pair
    value: float


class Equation(Record):
    """Eq. 1 for one k. coefficients : of Kp, CSDi, CSCo, CSCl. offsets : none in Eq. 1 itself."""

    k: K
    coefficients: Four
    offsets: tuple[Offset, ...] = ()

    def value(self, pair: Pair, features: Complementarity) -> float:
        """Evaluate it for a pair of a photo; a pair without an offset has 0."""
        offset = sum(each.value for each in self.offsets if set(each.pair) == set(pair))
        return offset + float(np.dot(self.coefficients, features.as_tuple()))


class FixedScore(Record):
    """Mean AP over the training queries of one pair and k for all of them."""

    pair: Pair
    k: K
    mean_ap: float


class Fitted(Record):
    """Eq. 1 as fitted, and what it needs to know its limits.

    equations : ascending k. lowest, highest : of each feature in training. fixed : best first.
    """

    equations: Annotated[tuple[Equation, ...], Field(min_length=1)]
    lowest: Four
    highest: Four
    fixed: Annotated[tuple[FixedScore, ...], Field(min_length=1)]

    def predict(self, pair: Pair, features: Complementarity, k: int) -> float:
        """Evaluate Eq. 1.

        Raises
        ------
        WrongInput : not fitted for this k.
        """
        for equation in self.equations:
            if equation.k == k:
                return equation.value(pair, features)
        known = ", ".join(str(equation.k) for equation in self.equations)
        raise WrongInput(
            f"the adaptive model knows k = {known}, not {k}; choose one of them, or give both "
            "--pair and --k"
        )

    def choose(self, features: Mapping[Pair, Complementarity], ks: Sequence[int]) -> Choice:
        """Pick the candidate of the highest predicted mAP'.

        If its features lie outside those of training, the best fixed choice among the
        candidates is taken instead, and the reason says so. Ties go to the earlier candidate.

        Parameters
        ----------
        features : of the pairs that may be chosen: one if the user fixed it, else all.
        ks : that may be chosen.

        Raises
        ------
        WrongInput : no candidate, a k never fitted, or no fixed score among the candidates.
        """
        if not features or not ks:
            raise WrongInput("the adaptive choice needs at least one pair and one k to choose from")
        candidates = [
            (self.predict(pair, of_pair, k), pair, k)
            for pair, of_pair in features.items()
            for k in ks
        ]
        predicted, pair, k = max(candidates, key=lambda candidate: candidate[0])
        outside = self._outside(features[pair])
        if not outside:
            return Choice(pair, k, predicted, f"highest predicted mAP of {len(candidates)} choices")
        best = self._best_fixed(features, ks)
        return Choice(
            best.pair,
            best.k,
            best.mean_ap,
            f"fallback to the best fixed choice: {'-'.join(pair)} was predicted best, "
            f"but in training {outside}",
        )

    def _outside(self, features: Complementarity) -> str:
        """Name the features outside the training range; empty if none is."""
        ranges = zip(FEATURES, features.as_tuple(), self.lowest, self.highest, strict=True)
        return " and ".join(
            f"{name} was {low:.3g} to {high:.3g}, here {value:.3g}"
            for name, value, low, high in ranges
            if not low <= value <= high
        )

    def _best_fixed(self, pairs: Iterable[Pair], ks: Sequence[int]) -> FixedScore:
        as_asked = {frozenset(pair): pair for pair in pairs}
        for score in self.fixed:
            if frozenset(score.pair) in as_asked and score.k in ks:
                return score.model_copy(update={"pair": as_asked[frozenset(score.pair)]})
        raise WrongInput(
            f"the adaptive model was never trained on "
            f"{', '.join('-'.join(pair) for pair in as_asked.values())}; give both --pair and "
            "--k, or run `flaneur train` on this index"
        )


def fit_equations(rows: Sequence[TrainingRow], variant: Variant = "eq1") -> Fitted:
    """Fit Eq. 1 per k by least squares; rank the fixed choices. At least one row."""
    by_k: dict[int, list[TrainingRow]] = defaultdict(list)
    for row in rows:
        by_k[row.k].append(row)
    features = np.array([row.features.as_tuple() for row in rows])
    return Fitted(
        equations=tuple(_solved(by_k[k], k, variant) for k in sorted(by_k)),
        lowest=_four(features.min(axis=0).tolist()),
        highest=_four(features.max(axis=0).tolist()),
        fixed=_fixed_scores(rows),
    )


def _solved(rows: Sequence[TrainingRow], k: int, variant: Variant) -> Equation:
    pairs = sorted({row.pair for row in rows}) if variant == "pair_offsets" else []
    features = np.array([row.features.as_tuple() for row in rows])
    is_pair = np.array([[row.pair == pair for pair in pairs] for row in rows], dtype=np.float64)
    known = np.hstack([features, is_pair.reshape(len(rows), len(pairs))])
    solution = np.linalg.lstsq(known, np.array([row.ap for row in rows]), rcond=None)[0].tolist()
    offsets = zip(pairs, solution[4:], strict=True)
    return Equation(
        k=k,
        coefficients=_four(solution[:4]),
        offsets=tuple(Offset(pair=pair, value=value) for pair, value in offsets),
    )


def _four(values: Sequence[float]) -> Four:
    a, b, c, d = values
    return a, b, c, d


def _fixed_scores(rows: Sequence[TrainingRow]) -> tuple[FixedScore, ...]:
    """Mean AP of every pair and k, best first; ties keep the rows' order."""
    found: dict[tuple[Pair, int], list[float]] = defaultdict(list)
    for row in rows:
        found[row.pair, row.k].append(row.ap)
    scores = [
        FixedScore(pair=pair, k=k, mean_ap=sum(aps) / len(aps)) for (pair, k), aps in found.items()
    ]
    return tuple(sorted(scores, key=lambda score: -score.mean_ap))
