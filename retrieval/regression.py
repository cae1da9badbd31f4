"""Regressions of a candidate's AP on what is known of it: Eq. 1 of Bhowmik et al. and variants.

mAP' = b1 Kp + b2 CSDi + b3 CSCo + b4 CSCl, one equation per k, no intercept (JURSE 2017). METHOD
section 4 says what is reconstructed: a row for each query and pair, with that query's AP.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from contracts.config import VariantName
from retrieval.candidates import (
    COMPLEMENTARITY,
    CROWDING,
    FEATURES,
    LOOK,
    Candidate,
    Pair,
)
from retrieval.trials import Trials

_RIDGE = 0.03
"""Of the variants with many constants, on standardised columns."""

_ROUNDING = 1e-9

_Rows = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Variant:
    """One form of the regression; `fixed` looks at nothing and chooses the same for all.

    terms : features that it looks at. per_k : each k has its own coefficients.
    constants : none, one a k, or one a candidate. within : features and AP are differences from
    their mean over a photo's candidates, since only what differs between them can decide.
    averaged : one row a candidate, averaged over queries, as the paper says.
    """

    name: VariantName
    terms: tuple[str, ...]
    per_k: bool
    constants: Literal["none", "k", "candidate"]
    within: bool = False
    averaged: bool = False
    ridge: float = 0.0

    @property
    def needs_look(self) -> bool:
        """Whether rankings by every candidate must be made first."""
        return bool(set(self.terms) & set(LOOK))


VARIANTS: dict[VariantName, Variant] = {
    variant.name: variant
    for variant in (
        Variant("fixed", (), per_k=False, constants="candidate", within=True),
        Variant("eq1", COMPLEMENTARITY, per_k=True, constants="none"),
        Variant("paper", COMPLEMENTARITY, per_k=True, constants="none", averaged=True),
        Variant("kp_only", ("Kp",), per_k=True, constants="none"),
        Variant("intercept", COMPLEMENTARITY, per_k=True, constants="k"),
        Variant("offsets", COMPLEMENTARITY, per_k=False, constants="candidate", ridge=_RIDGE),
        Variant(
            "gain",
            COMPLEMENTARITY,
            per_k=False,
            constants="candidate",
            within=True,
            ridge=_RIDGE,
        ),
        Variant(
            "crowding",
            COMPLEMENTARITY + CROWDING,
            per_k=False,
            constants="candidate",
            within=True,
            ridge=_RIDGE,
        ),
        Variant(
            "look",
            FEATURES,
            per_k=False,
            constants="candidate",
            within=True,
            ridge=_RIDGE,
        ),
    )
}


@dataclass(frozen=True, slots=True)
class Column:
    """What a coefficient belongs to: a term or `constant`, of one k or pair or of all (None)."""

    term: str
    k: int | None
    pair: Pair | None


@dataclass(frozen=True, slots=True)
class Regression:
    """A fitted variant. coefficients : (p,) in the order of `columns`.

    level : mean AP where only differences are fitted, or coefficients shrink towards it; else 0.
    """

    variant: Variant
    candidates: tuple[Candidate, ...]
    coefficients: NDArray[np.float64]
    level: float

    def predict(self, features: NDArray[np.float64]) -> NDArray[np.float64]:
        """Predict mAP' of every candidate of every query: (n, c, f) -> (n, c) float64."""
        rows = _design(self.variant, self.candidates, features)
        return np.asarray(rows @ self.coefficients + self.level, dtype=np.float64)


def columns(variant: Variant, candidates: Sequence[Candidate]) -> list[Column]:
    """Name the coefficients of a variant in order."""
    ks = sorted({k for _, k in candidates})
    terms = [
        Column(term, k, None) for term in variant.terms for k in (ks if variant.per_k else [None])
    ]
    if variant.constants == "k":
        terms += [Column("constant", k, None) for k in ks]
    if variant.constants == "candidate":
        terms += [Column("constant", k, pair) for pair, k in candidates]
    return terms


def fit_regression(
    trials: Trials, variant: Variant, times: NDArray[np.float64] | None = None
) -> Regression:
    """Fit by weighted least squares (ridge where the variant says so).

    times : (n,), how often each query counts, not all 0; None: once.
    """
    weights = trials.weights() if times is None else trials.weights() * times
    features, ap = trials.features, trials.ap
    if variant.averaged:
        features = np.average(features, axis=0, weights=weights)[np.newaxis]
        ap, weights = np.average(ap, axis=0, weights=weights)[np.newaxis], np.ones(1)
    anchored = variant.within or variant.ridge > 0
    level = float(np.average(ap.mean(axis=1), weights=weights)) if anchored else 0.0
    target = ap - (ap.mean(axis=1, keepdims=True) if variant.within else level)
    rows = _design(variant, trials.candidates, features)
    coefficients = _solved(
        rows.reshape(-1, rows.shape[-1]),
        target.ravel(),
        np.repeat(weights, len(trials.candidates)),
        variant.ridge,
    )
    return Regression(variant, trials.candidates, coefficients, level)


def feature_ranges(
    trials: Trials, variant: Variant
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Lowest and highest value of each term in training; (t,) float64 each."""
    seen = used_features(variant, trials.features)
    return seen.min(axis=(0, 1)), seen.max(axis=(0, 1))


def is_outside(
    variant: Variant,
    features: NDArray[np.float64],
    low: NDArray[np.float64],
    high: NDArray[np.float64],
) -> NDArray[np.bool_]:
    """Which terms of which queries leave their range in training; (n, t) bool.

    A rounding error does not: a term that is the same for all candidates differs by one.
    """
    seen = used_features(variant, features)
    beyond = (seen < low - _ROUNDING) | (seen > high + _ROUNDING)
    return np.asarray(beyond.any(axis=1), dtype=np.bool_)


def used_features(variant: Variant, features: NDArray[np.float64]) -> NDArray[np.float64]:
    """The terms as a variant sees them: (n, c, f) -> (n, c, t) float64."""
    seen = features[..., [FEATURES.index(term) for term in variant.terms]]
    if variant.within:
        seen = seen - seen.mean(axis=1, keepdims=True)
    return np.asarray(seen, dtype=np.float64)


def _design(
    variant: Variant, candidates: Sequence[Candidate], features: NDArray[np.float64]
) -> _Rows:
    seen = used_features(variant, features)
    ks = np.array([k for _, k in candidates])
    of_k = (ks[:, np.newaxis] == np.unique(ks)).astype(np.float64)
    if variant.per_k:
        seen = np.einsum("nct,ck->nctk", seen, of_k).reshape(*seen.shape[:2], -1)
    if variant.constants == "none":
        return np.asarray(seen, dtype=np.float64)
    constants = of_k if variant.constants == "k" else np.eye(len(candidates))
    if variant.within:
        constants = constants - constants.mean(axis=0)
    repeated = np.broadcast_to(constants, (len(seen), *constants.shape))
    return np.concatenate([seen, repeated], axis=2)


def _solved(rows: _Rows, target: _Rows, weights: _Rows, ridge: float) -> _Rows:
    """Minimise the weighted squared error; ridge is per unit weight and unit variance."""
    if not ridge:
        root = np.sqrt(weights)
        solution = np.linalg.lstsq(rows * root[:, np.newaxis], target * root, rcond=None)[0]
        return np.asarray(solution, dtype=np.float64)
    scale = np.sqrt(np.average(np.square(rows), axis=0, weights=weights)) + 1e-9
    scaled = rows / scale
    gram = (scaled * weights[:, np.newaxis]).T @ scaled / weights.sum()
    moment = (scaled * weights[:, np.newaxis]).T @ target / weights.sum()
    solution = np.linalg.solve(gram + ridge * np.eye(len(gram)), moment)
    return np.asarray(solution / scale, dtype=np.float64)
