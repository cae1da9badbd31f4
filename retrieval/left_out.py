"""What a choice is worth where it was not fitted: every place left out in turn, beside controls."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contracts.errors import WrongInput
from retrieval.regression import Variant, feature_ranges, fit_regression, is_outside
from retrieval.resampling import Interval, bootstrap_ratio, weighted_mean
from retrieval.trials import Trials

_BOOSTING_FOLDS = 10

Predict = Callable[[NDArray[np.float64]], NDArray[np.float64]]
"""Features (n, c, f) to predicted mAP' (n, c)."""


@dataclass(frozen=True, slots=True)
class Worth:
    """A choice on queries whose places it never saw.

    ap : mean AP. gain : over the best fixed candidate of the other places, paired. share : of
    the room between that and the oracle. n_chosen : different candidates chosen.
    """

    ap: Interval
    gain: Interval
    share: Interval
    n_chosen: int


@dataclass(frozen=True, slots=True)
class Controls:
    """AP of every query, (n,) each, by choices that any model must be held against.

    best_fixed, worst_fixed : the candidate best and worst on the other places. random : the
    mean over candidates. oracle : the best candidate of each query, by hindsight.
    """

    best_fixed: NDArray[np.float64]
    worst_fixed: NDArray[np.float64]
    random: NDArray[np.float64]
    oracle: NDArray[np.float64]

    def of(self, rows: NDArray[np.bool_]) -> "Controls":
        """Those of some queries. rows : (n,) bool."""
        return Controls(
            self.best_fixed[rows], self.worst_fixed[rows], self.random[rows], self.oracle[rows]
        )


def left_out_predictions(
    trials: Trials, variant: Variant, groups: NDArray[np.str_]
) -> NDArray[np.float64]:
    """Predict every query's mAP' by a fit without its group; (n, c) float64.

    Where a query's features lie outside those of the fit, what each candidate achieved in
    training is predicted, as `ChoiceModel.choose` falls back to what was best for all.

    groups : (n,) labels, as a rule `trials.places`; `trials.sets` asks more.

    Raises
    ------
    WrongInput : there is only one group.
    """

    def fitted(training: Trials) -> Predict:
        regression = fit_regression(training, variant)
        low, high = feature_ranges(training, variant)

        def predict(features: NDArray[np.float64]) -> NDArray[np.float64]:
            outside = np.asarray(is_outside(variant, features, low, high).any(axis=1))
            predicted = regression.predict(features)
            return np.where(outside[:, np.newaxis], training.mean_ap(), predicted)

        return predict

    return _predictions(trials, groups, fitted)


def boosted_predictions(trials: Trials, places: NDArray[np.str_]) -> NDArray[np.float64]:
    """Do the same by gradient boosting on all features, places dealt to ten folds.

    A control of what a straight line might miss; it is too slow and too large to ship.
    """
    from sklearn.ensemble import HistGradientBoostingRegressor

    def fitted(training: Trials) -> Predict:
        gain = training.ap - training.ap.mean(axis=1, keepdims=True)
        model = HistGradientBoostingRegressor(
            max_iter=60, max_leaf_nodes=8, min_samples_leaf=200, random_state=0
        )
        model.fit(
            _boosting_rows(training.features),
            gain.ravel(),
            sample_weight=np.repeat(training.weights(), len(training.candidates)),
        )

        def predict(features: NDArray[np.float64]) -> NDArray[np.float64]:
            rows = _boosting_rows(features)
            return np.asarray(model.predict(rows)).reshape(features.shape[:2])

        return predict

    named, which = np.unique(places, return_inverse=True)
    folds = np.array([f"{number % _BOOSTING_FOLDS}" for number in range(len(named))])[which]
    return _predictions(trials, folds, fitted)


def controls(trials: Trials, groups: NDArray[np.str_]) -> Controls:
    """Score the choices without a model, the fixed ones picked on the other groups.

    Raises
    ------
    WrongInput : there is only one group.
    """
    best = np.empty(len(trials.queries))
    worst = np.empty(len(trials.queries))
    for out in _folds(groups):
        means = trials.take(~out).mean_ap()
        best[out] = trials.ap[out][:, means.argmax()]
        worst[out] = trials.ap[out][:, means.argmin()]
    return Controls(best, worst, trials.ap.mean(axis=1), trials.ap.max(axis=1))


def chosen(trials: Trials, predicted: NDArray[np.float64], n_joined: int) -> NDArray[np.int64]:
    """Choose for each query by its predictions: (n, n_joined) candidates, the best first.

    n_joined : 1, the candidate predicted best, the earlier if equal; or 2, and the next best of
    the same k (itself where there is no other).
    """
    best = predicted.argmax(axis=1)
    if n_joined == 1:
        return np.asarray(best[:, np.newaxis], dtype=np.int64)
    ks = np.array([k for _, k in trials.candidates])
    others = np.where(ks == ks[best][:, np.newaxis], predicted, -np.inf)
    others[np.arange(len(best)), best] = -np.inf
    partner = np.where(np.isfinite(others.max(axis=1)), others.argmax(axis=1), best)
    return np.stack([best, partner], axis=1)


def achieved(trials: Trials, choices: NDArray[np.int64]) -> NDArray[np.float64]:
    """AP of each query with what was chosen for it, (n, 1) or (n, 2); (n,)."""
    rows = np.arange(len(choices))
    return np.asarray(trials.ap_together[rows, choices[:, 0], choices[:, -1]], dtype=np.float64)


def picked_by_others(
    trials: Trials, choices: Sequence[NDArray[np.int64]], groups: NDArray[np.str_]
) -> NDArray[np.int64]:
    """Pick for each group the way of choosing that does best on the other groups.

    The best of many ways, scored where it was found to be the best, looks better than it is:
    on pure noise one time in four as if it surely gained something. Scored so, it does not.

    Parameters
    ----------
    choices : of each way, (n, 1 or 2), as `chosen` makes them without each query's group.

    Returns
    -------
    (n, 2) : of each query the candidates chosen, the same twice where one ranking is used.
    """
    both = [np.stack([each[:, 0], each[:, -1]], axis=1) for each in choices]
    ap = np.array([achieved(trials, each) for each in both])
    picked = np.empty_like(both[0])
    for out in _folds(groups):
        weights = trials.take(~out).weights()
        best = int(np.average(ap[:, ~out], axis=1, weights=weights).argmax())
        picked[out] = both[best][out]
    return picked


def worth(
    trials: Trials, choices: NDArray[np.int64], beside: Controls, groups: NDArray[np.str_]
) -> Worth:
    """Hold choices against the best fixed candidate, queries weighed as in training.

    groups : what was left out together, and is drawn together for the intervals; (n,) labels.
    """
    weights = trials.weights()
    got = achieved(trials, choices)
    return Worth(
        weighted_mean(got, weights, groups),
        weighted_mean(got - beside.best_fixed, weights, groups),
        bootstrap_ratio(
            (got - beside.best_fixed) * weights,
            (beside.oracle - beside.best_fixed) * weights,
            groups,
        ),
        len(np.unique(choices, axis=0)),
    )


def _predictions(
    trials: Trials, groups: NDArray[np.str_], fitted: Callable[[Trials], Predict]
) -> NDArray[np.float64]:
    predicted = np.empty(trials.ap.shape)
    for out in _folds(groups):
        predicted[out] = fitted(trials.take(~out))(trials.features[out])
    return predicted


def check_groups(groups: NDArray[np.str_]) -> None:
    """Refuse what cannot be left out in turn.

    Raises
    ------
    WrongInput : there are fewer than two groups.
    """
    n_groups = len(np.unique(groups))
    if n_groups < 2:
        raise WrongInput(
            "the adaptive choice is judged with each place left out: queries of at least 2 "
            f"places are needed, got {n_groups}"
        )


def _folds(groups: NDArray[np.str_]) -> list[NDArray[np.bool_]]:
    check_groups(groups)
    return [groups == name for name in np.unique(groups)]


def _boosting_rows(features: NDArray[np.float64]) -> NDArray[np.float64]:
    """Features as they are and within the query, and which candidate it is; (n * c, 2 f + 1)."""
    within = features - features.mean(axis=1, keepdims=True)
    number = np.broadcast_to(
        np.arange(features.shape[1], dtype=np.float64)[:, np.newaxis], (*features.shape[:2], 1)
    )
    rows = np.concatenate([features, within, number], axis=2)
    return rows.reshape(-1, rows.shape[-1])
