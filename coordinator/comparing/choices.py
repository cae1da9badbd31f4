"""The choices that a comparison holds against each other, each made with its place left out."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from retrieval.choice import N_JOINED
from retrieval.left_out import (
    Controls,
    achieved,
    boosted_predictions,
    chosen,
    controls,
    left_out_predictions,
    picked_by_others,
)
from retrieval.regression import VARIANTS
from retrieval.trials import Trials

Key = tuple[str, int]
"""A variant, and how many rankings are joined."""

ADAPTIVE: Key = ("eq1", 1)
"""The paper's own choice."""

PICKED: Key = ("whichever variant is best on other places", 1)
"""What a model is worth, the pick of its variant included."""


@dataclass(frozen=True, slots=True)
class Choices:
    """Candidates chosen for every query. made : variant and number joined -> (n, 1 or 2).

    predicted : (n, c) mAP' by Eq. 1. groups : what was left out, (n,) labels.
    """

    made: Mapping[Key, NDArray[np.int64]]
    controls: Controls
    predicted: NDArray[np.float64]
    groups: NDArray[np.str_]

    def ap(self, trials: Trials, key: Key) -> NDArray[np.float64]:
        """AP of every query by one choice; (n,)."""
        return achieved(trials, self.made[key])


def choices_of(trials: Trials, groups: NDArray[np.str_]) -> Choices:
    """Make every choice for every query without its group.

    groups : (n,) labels, `trials.places` or, which asks more, of whole collections.

    Raises
    ------
    WrongInput : there is only one group.
    """
    predictions: dict[str, NDArray[np.float64]] = {
        name: left_out_predictions(trials, variant, groups) for name, variant in VARIANTS.items()
    }
    predictions["boosted"] = boosted_predictions(trials, groups)
    made: dict[Key, NDArray[np.int64]] = {
        (name, n_joined): chosen(trials, predicted, n_joined)
        for name, predicted in predictions.items()
        for n_joined in N_JOINED
    }
    usable = [each for (name, _), each in made.items() if name in VARIANTS]
    made[PICKED] = picked_by_others(trials, usable, groups)
    return Choices(made, controls(trials, groups), predictions["eq1"], groups)
