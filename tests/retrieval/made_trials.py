"""Trials made up to order: what every candidate achieved is known, and why."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from retrieval.candidates import FEATURES, Candidate, Pair
from retrieval.regression import VARIANTS, Column, Variant, columns
from retrieval.trials import Trials

PAIRS: tuple[Pair, ...] = (("hesaff", "mser"), ("hesaff", "star"), ("mser", "star"))
CANDIDATES: tuple[Candidate, ...] = tuple((pair, k) for k in (2, 5) for pair in PAIRS)
KS = np.array([k for _, k in CANDIDATES])


def some_features(n: int, seed: int = 0) -> NDArray[np.float64]:
    return np.random.default_rng(seed).uniform(0.1, 0.9, (n, len(CANDIDATES), len(FEATURES)))


def trials(
    ap: NDArray[np.float64],
    features: NDArray[np.float64] | None = None,
    places: list[str] | None = None,
    sets: list[str] | None = None,
) -> Trials:
    """Trials of `CANDIDATES`, as a rule every query at a place of its own, all in one set.

    Two joined are worth the mean of the two.
    """
    n = len(ap)
    together = (ap[:, :, np.newaxis] + ap[:, np.newaxis, :]) / 2
    together[:, KS[:, np.newaxis] != KS] = np.nan
    return Trials(
        tuple(f"q{number}" for number in range(n)),
        np.array(places or [f"p{number}" for number in range(n)]),
        np.array(sets or ["town"] * n),
        CANDIDATES,
        ap,
        together,
        some_features(n) if features is None else features,
    )


def without_ridge(variant: Variant) -> Variant:
    return replace(variant, ridge=0.0)


def term(features: NDArray[np.float64], name: str) -> NDArray[np.float64]:
    """One feature of every query and candidate, (n, c)."""
    return features[:, :, FEATURES.index(name)]


def made_by(
    variant: Variant, coefficients: NDArray[np.float64], features: NDArray[np.float64]
) -> NDArray[np.float64]:
    """AP that obeys a variant, summed up column by column as `Column` says; (n, c)."""
    seen = features - features.mean(axis=1, keepdims=True) if variant.within else features
    ap = np.zeros(features.shape[:2])
    for column, value in zip(columns(variant, CANDIDATES), coefficients, strict=True):
        applies = np.array([belongs(column, each) for each in CANDIDATES], dtype=np.float64)
        if column.term == "constant":
            ap += value * (applies - applies.mean() if variant.within else applies)
        else:
            ap += value * applies * term(seen, column.term)
    return ap


def belongs(column: Column, candidate: Candidate) -> bool:
    pair, k = candidate
    return column.k in (None, k) and column.pair in (None, pair)


def eq1_trials(n: int = 24, noise: float = 0.0) -> Trials:
    """APs that obey Eq. 1, with other coefficients for each k."""
    features = some_features(n)
    coefficients = np.array([0.1, 0.2, 0.5, 0.1, 0.2, 0.4, 0.1, 0.05])
    ap = made_by(VARIANTS["eq1"], coefficients, features)
    return trials(ap + noise * np.random.default_rng(1).normal(size=ap.shape), features)
