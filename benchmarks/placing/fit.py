"""The model of certainty, fitted to what was found in towns."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from sklearn.linear_model import LogisticRegression

from benchmarks.placing.answers import Placed
from geo.confidence import PlacingModel, TrainingSet
from geo.estimate import REACH_M

FALSE_ALARMS = 0.10
"""Share of the photos of other towns that may be taken for this one."""
N_QUANTILES = 40


def fit_placing(answers: Sequence[Placed]) -> PlacingModel:
    """Fit the model; every answer must have a prominence.

    Right is an estimate within `REACH_M` of the truth. Classes weigh alike in `present`: which
    share of the photos of an archive are of a survey, no town can tell.
    """
    standing = np.array([answer.evidence.prominence for answer in answers], dtype=np.float64)
    of_town = np.array([answer.error_m is not None for answer in answers])
    present = _logistic(standing, of_town, balanced=True)
    own = [answer for answer in answers if answer.error_m is not None]
    error_m = np.array([answer.error_m for answer in own], dtype=np.float64)
    share = np.array([answer.evidence.share for answer in own])
    right = error_m <= REACH_M
    shown, errors_m = standing[of_town][right], error_m[right]
    slope = min(0.0, float(np.polyfit(shown, np.log(errors_m), 1)[0]))
    at_one = errors_m * np.exp(-slope * (shown - 1.0))
    strangers = standing[~of_town]
    threshold = np.quantile(strangers, 1.0 - FALSE_ALARMS, method="higher")
    return PlacingModel(
        present=present,
        least_confidence=_sigmoid(present, float(threshold)),
        right=_logistic(share, right, balanced=False),
        error_m=_upper_quantiles(at_one),
        error_slope=slope,
        prominences=(float(shown.min()), float(shown.max())),
        trained_on=tuple(_training_sets(answers)),
    )


def _upper_quantiles(errors_m: NDArray[np.float64]) -> tuple[float, ...]:
    levels = np.arange(1, N_QUANTILES + 1) / N_QUANTILES
    return tuple(np.quantile(errors_m, levels, method="higher").round(2).tolist())


def _logistic(
    values: NDArray[np.float64], is_so: NDArray[np.bool_], *, balanced: bool
) -> tuple[float, float]:
    """Intercept and weight; barely regularised, so that the weight is free of the value's unit."""
    fitted = LogisticRegression(C=1e6, class_weight="balanced" if balanced else None)
    fitted.fit(values[:, np.newaxis], is_so)
    return float(fitted.intercept_[0]), float(fitted.coef_[0, 0])


def _sigmoid(weights: tuple[float, float], value: float) -> float:
    return float(1.0 / (1.0 + np.exp(-(weights[0] + weights[1] * value))))


def _training_sets(answers: Sequence[Placed]) -> list[TrainingSet]:
    sets = []
    for index in dict.fromkeys(answer.index for answer in answers):
        mine = [answer for answer in answers if answer.index == index]
        n_own = sum(answer.error_m is not None for answer in mine)
        n_places = len({answer.group for answer in mine if answer.error_m is not None})
        sets.append(
            TrainingSet(
                set=f"synthetic {index}",
                n_of_survey=n_own,
                n_of_others=len(mine) - n_own,
                n_places=n_places,
            )
        )
    return sets
