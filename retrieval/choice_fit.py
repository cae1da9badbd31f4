"""Fitting the adaptive choice: every variant judged on places left out, the best one kept."""

from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from contracts.config import Descriptor, Detector, VariantName, Vote, Weight
from retrieval.choice import (
    N_JOINED,
    ChoiceModel,
    Coefficient,
    FixedScore,
    LeftOutScores,
    Range,
    TermRange,
    TrainingSet,
)
from retrieval.left_out import (
    achieved,
    chosen,
    controls,
    left_out_predictions,
    picked_by_others,
    worth,
)
from retrieval.regression import (
    VARIANTS,
    Regression,
    Variant,
    columns,
    feature_ranges,
    fit_regression,
)
from retrieval.resampling import Interval
from retrieval.trials import Trials

_N_RESAMPLES = 200


def fit_choice(
    trials: Trials,
    *,
    detectors: tuple[Detector, ...],
    descriptors: tuple[Descriptor, ...],
    vote: Vote,
    weights: tuple[Weight, ...],
    index_digest: str | None,
    variants: Collection[VariantName] = tuple(VARIANTS),
) -> ChoiceModel:
    """Fit what does best on places left out: a variant, and one ranking or two joined.

    Of equal ones the first and simplest is kept; `fixed` is the first. The scores reported are
    of choices whose variant, too, was picked on other places.

    Parameters
    ----------
    trials : what every candidate achieved on every training query.
    detectors, descriptors, vote, weights, index_digest : the search that the trials were made by.
    variants : to try, at least one.

    Raises
    ------
    WrongInput : queries of fewer than two places.
    """
    beside = controls(trials, trials.places)
    made = {}
    for name in variants:
        predicted = left_out_predictions(trials, VARIANTS[name], trials.places)
        for n_joined in N_JOINED:
            made[name, n_joined] = chosen(trials, predicted, n_joined)
    weights_of = trials.weights()
    name, n_joined = max(
        made, key=lambda key: float(np.average(achieved(trials, made[key]), weights=weights_of))
    )
    picked = picked_by_others(trials, list(made.values()), trials.places)
    found = worth(trials, picked, beside, trials.places)
    regression = fit_regression(trials, VARIANTS[name])
    means = trials.mean_ap()
    order = np.argsort(-means, kind="stable")
    return ChoiceModel(
        variant=name,
        n_joined=n_joined,
        detectors=detectors,
        descriptors=descriptors,
        vote=vote,
        weights=tuple(sorted(weights)),
        coefficients=_coefficients(trials, regression),
        level=regression.level,
        ranges=_ranges(trials, VARIANTS[name]),
        fixed=tuple(
            FixedScore(
                pair=trials.candidates[row][0],
                k=trials.candidates[row][1],
                mean_ap=float(means[row]),
            )
            for row in order
        ),
        left_out=LeftOutScores(
            adaptive=_range(found.ap),
            gain=_range(found.gain),
            share=_range(found.share),
            best_fixed=float(np.average(beside.best_fixed, weights=weights_of)),
            worst_fixed=float(np.average(beside.worst_fixed, weights=weights_of)),
            random=float(np.average(beside.random, weights=weights_of)),
            oracle=float(np.average(beside.oracle, weights=weights_of)),
            n_chosen=found.n_chosen,
        ),
        trained_on=_training_sets(trials),
        index_digest=index_digest,
    )


def _range(interval: Interval) -> Range:
    """What JSON can hold: no infinity, no NaN."""

    def known(value: float) -> float | None:
        return value if np.isfinite(value) else None

    return Range(mean=known(interval.mean), low=known(interval.low), high=known(interval.high))


def _coefficients(trials: Trials, regression: Regression) -> tuple[Coefficient, ...]:
    """Coefficients with their intervals over resampled places."""
    variant = regression.variant
    resampled = np.array(
        [fit_regression(trials, variant, times).coefficients for times in _draws(trials)]
    )
    low, high = np.percentile(resampled, [2.5, 97.5], axis=0)
    return tuple(
        Coefficient(
            term=column.term,
            k=column.k,
            pair=column.pair,
            value=float(value),
            low=float(least),
            high=float(most),
        )
        for column, value, least, most in zip(
            columns(variant, trials.candidates), regression.coefficients, low, high, strict=True
        )
    )


def _draws(trials: Trials) -> Sequence[NDArray[np.float64]]:
    """How often each query counts when places are drawn with replacement."""
    named, which = np.unique(trials.places, return_inverse=True)
    rng = np.random.default_rng(0)
    draws = rng.integers(0, len(named), (_N_RESAMPLES, len(named)))
    return [np.bincount(draw, minlength=len(named))[which].astype(np.float64) for draw in draws]


def _ranges(trials: Trials, variant: Variant) -> tuple[TermRange, ...]:
    low, high = feature_ranges(trials, variant)
    return tuple(
        TermRange(term=term, low=float(least), high=float(most))
        for term, least, most in zip(variant.terms, low, high, strict=True)
    )


def _training_sets(trials: Trials) -> tuple[TrainingSet, ...]:
    return tuple(
        TrainingSet(
            set=str(name),
            n_queries=int(np.count_nonzero(trials.sets == name)),
            n_places=len(np.unique(trials.places[trials.sets == name])),
        )
        for name in np.unique(trials.sets)
    )
