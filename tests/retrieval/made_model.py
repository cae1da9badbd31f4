"""A choice model written by hand: its coefficients, and so its predictions, are known."""

from collections.abc import Mapping

from made_trials import CANDIDATES

from contracts.config import VariantName
from retrieval.candidates import FEATURES, Candidate, Pair
from retrieval.choice import (
    ChoiceModel,
    Coefficient,
    FixedScore,
    LeftOutScores,
    Range,
    TermRange,
    TrainingSet,
)
from retrieval.regression import VARIANTS, Column, columns

_SCORES = (0.30, 0.31, 0.32, 0.33, 0.36, 0.34)
"""Of `CANDIDATES` in training; the best is hesaff-star with k = 5."""


def a_model(
    variant: VariantName = "eq1",
    weights: Mapping[tuple[str, int | None, Pair | None], float] | None = None,
    *,
    n_joined: int = 1,
    **others: object,
) -> ChoiceModel:
    """Every coefficient is 0 but those given; terms were 0 to 1, or within -1 to 1, in training."""
    given = dict(weights or {})
    form = VARIANTS[variant]
    made = [_coefficient(each, given) for each in columns(form, CANDIDATES)]
    ranked = sorted(zip(CANDIDATES, _SCORES, strict=True), key=lambda each: -each[1])
    settings: dict[str, object] = {
        "variant": variant,
        "n_joined": n_joined,
        "detectors": ("hesaff", "mser", "star"),
        "descriptors": ("sift", "surf", "sc"),
        "vote": "pairwise",
        "weights": ("idf", "norm"),
        "coefficients": tuple(made),
        "level": 0.25,
        "ranges": tuple(
            TermRange(term=term, low=-1.0 if form.within else 0.0, high=1.0) for term in form.terms
        ),
        "fixed": tuple(FixedScore(pair=pair, k=k, mean_ap=score) for (pair, k), score in ranked),
        "left_out": LeftOutScores(
            adaptive=Range(mean=0.4, low=0.3, high=0.5),
            gain=Range(mean=0.04, low=-0.01, high=0.09),
            share=Range(mean=0.2, low=None, high=None),
            best_fixed=0.36,
            worst_fixed=0.3,
            random=0.33,
            oracle=0.56,
            n_chosen=4,
        ),
        "trained_on": (
            TrainingSet(set="town", n_queries=12, n_places=4),
            TrainingSet(set="village", n_queries=8, n_places=8),
        ),
        "index_digest": None,
    }
    return ChoiceModel.model_validate(settings | others)


def _coefficient(
    column: Column, given: dict[tuple[str, int | None, Pair | None], float]
) -> Coefficient:
    value = given.get((column.term, column.k, column.pair), 0.0)
    return Coefficient(
        term=column.term, k=column.k, pair=column.pair, value=value, low=value, high=value
    )


def features_where(
    term: str, values: Mapping[Candidate, float], others: float = 0.5, n: int = len(FEATURES)
) -> dict[Candidate, tuple[float, ...]]:
    """Features that are `others` but for one term of some candidates; the first n of them."""
    place = FEATURES.index(term)
    made = {}
    for candidate in CANDIDATES:
        row = [others] * n
        row[place] = values.get(candidate, others)
        made[candidate] = tuple(row)
    return made
