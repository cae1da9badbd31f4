"""How sure an estimate is: whether the photo is of this survey at all, and how far off it may be.

RECONSTRUCTION; decision 13 has what was measured.

- *Prominence*: how many standard deviations the best score stands above the median of all images,
  over ln n. The best of n unrelated images reaches about ln n where tails are exponential
  (Gumbel's law of the largest value), so 1 is what photos of other cities get, for any n. The more
  images a word is in, the more chance votes an image's score adds up, and the sooner the tail
  falls, as a sum's does; a power of the density makes up for it.
- *Confidence*: a logistic function of it: the probability that the photo is of the survey, when
  as many are as are not.
- *Radii*: of a photo of the survey the estimate is right, within a street's reach, or it is not;
  the more weight agrees, the likelier it is. If right, its error is distributed as in training,
  the smaller the more prominent the answer; if not, the photographer stood near any of the
  survey's cameras. A radius holds its share of that mixture, so that an uncertain answer has the
  radius of the survey, whatever its size.
"""

import math
from dataclasses import dataclass
from typing import Annotated, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from contracts.errors import BadIndex, WrongInput
from contracts.faults import first_fault

LEAST_IMAGES = 30
"""A ranking of fewer has no bulk that anything could stand out from."""
DENSITY, CROWDING = 0.0356, 0.21
"""Mean share of the images that a word is in, in the towns of the fit; and by which power of it
the prominence of strangers fell in the same towns with an index of fewer, more crowded words."""
_NORMAL_95_OF_68 = math.sqrt(math.log(0.05) / math.log(0.32))
"""The radius of 95 % over that of 68 %, of a round two-dimensional normal distribution."""

_ROUNDING = 1e-9
"""Of a sum of weights, so that it does not decide which radius is the first to hold enough."""

Share = Annotated[float, Field(ge=0.0, le=1.0)]


@dataclass(frozen=True, slots=True)
class Evidence:
    """What speaks for an estimate.

    prominence : see the module; None: too few images to say. share : of the weight of the matches
    that supports the place (`geo.estimate.Consensus`).
    """

    prominence: float | None
    share: float


@dataclass(frozen=True, slots=True)
class Certainty:
    """How sure an estimate is; the radii are those of a photo that is of the survey.

    confidence, in_survey : None: the survey is too small to say.
    """

    radius_68_m: float
    radius_95_m: float
    confidence: float | None
    in_survey: bool | None


class Record(BaseModel):
    """A part of the model's JSON: no unknown key, no wrong type, no infinity."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


class TrainingSet(Record):
    """Photos that the model was fitted on: of the indexed town, and of other towns."""

    set: str
    n_of_survey: Annotated[int, Field(ge=1)]
    n_of_others: Annotated[int, Field(ge=1)]
    n_places: Annotated[int, Field(ge=1)]


class PlacingModel(Record):
    """What the certainty of estimates is worked out with.

    present : intercept, and weight of prominence: log odds that the photo is of the survey.
    least_confidence : below it a photo is said not to be of the survey.
    right : intercept, and weight of share: log odds that the estimate of a photo of the survey is
    right.
    error_m : m quantiles of the error of a right estimate of prominence 1, at 1 / m, 2 / m, ... 1,
    ascending. error_slope : of the logarithm of the error by prominence. prominences : lowest and
    highest in training; beyond them errors are those at the end.
    """

    form: Literal[1] = 1
    present: tuple[float, float]
    least_confidence: Share
    right: tuple[float, float]
    error_m: Annotated[tuple[float, ...], Field(min_length=1)]
    error_slope: Annotated[float, Field(le=0.0)]
    prominences: tuple[float, float]
    trained_on: Annotated[tuple[TrainingSet, ...], Field(min_length=1)]

    @model_validator(mode="after")
    def _ascends(self) -> Self:
        if self.error_m[0] < 0.0 or list(self.error_m) != sorted(self.error_m):
            raise ValueError("error_m must be ascending distances in metres")
        if self.prominences[0] > self.prominences[1]:
            raise ValueError("prominences must be the lowest and the highest")
        return self

    def to_json(self) -> str:
        """Write all of it; `from_json` reads it back equal."""
        return self.model_dump_json(indent=1)

    @classmethod
    def from_json(cls, text: str) -> "PlacingModel":
        """Read what `to_json` wrote.

        Raises
        ------
        BadIndex : not JSON, an unknown or missing key, a wrong type, or a later form.
        """
        try:
            return cls.model_validate_json(text)
        except ValidationError as error:
            where, what = first_fault(error)
            raise BadIndex(
                f"the model of certainty does not hold at {where or 'its beginning'}: {what}. "
                "Install Flaneur again."
            ) from error

    def confidence(self, evidence: Evidence) -> float | None:
        """The probability that a photo is of the survey, when half of all photos are."""
        if evidence.prominence is None:
            return None
        return _logistic(self.present[0] + self.present[1] * evidence.prominence)

    def probability_right(self, evidence: Evidence) -> float:
        """Of a photo of the survey: that its estimate is right, within a street's reach."""
        return _logistic(self.right[0] + self.right[1] * evidence.share)

    def right_errors_m(self, evidence: Evidence) -> NDArray[np.float64]:
        """(m,) quantiles of the error of a right estimate, as `error_m`."""
        low, high = self.prominences
        # Too small a survey to say: as uncertain as an answer can be.
        shown = low if evidence.prominence is None else min(max(evidence.prominence, low), high)
        return np.array(self.error_m) * math.exp(self.error_slope * (shown - 1.0))

    def radius_m(self, share: float, evidence: Evidence, distances_m: ArrayLike) -> float:
        """Within which the photographer of a photo of the survey stood, with probability `share`.

        Parameters
        ----------
        distances_m : (n,) float64, from the estimate to the survey's cameras, or to an even sample.

        Raises
        ------
        WrongInput : no distance, or one that is negative or not finite.
        """
        elsewhere_m = np.asarray(distances_m, np.float64)
        if elsewhere_m.size == 0 or not (np.isfinite(elsewhere_m) & (elsewhere_m >= 0.0)).all():
            raise WrongInput(
                "a radius takes finite distances in metres to the survey's cameras; got "
                f"{elsewhere_m.size}, of which the least is {elsewhere_m.min(initial=np.inf)}"
            )
        probability = self.probability_right(evidence)
        return _mixture_quantile(share, probability, self.right_errors_m(evidence), elsewhere_m)

    def certainty(
        self, evidence: Evidence, distances_m: ArrayLike, position_error_m: float = 0.0
    ) -> Certainty:
        """How sure an estimate is.

        Parameters
        ----------
        distances_m : as `radius_m`.
        position_error_m : of the survey's own positions, 68 %; adds in quadrature.

        Raises
        ------
        WrongInput : as `radius_m`.
        """
        confidence = self.confidence(evidence)
        radius_68_m, radius_95_m = (
            self.radius_m(share, evidence, distances_m) for share in (0.68, 0.95)
        )
        return Certainty(
            math.hypot(radius_68_m, position_error_m),
            math.hypot(radius_95_m, position_error_m * _NORMAL_95_OF_68),
            confidence,
            None if confidence is None else confidence >= self.least_confidence,
        )


def prominence(z_score: float, n_images: int, density: float) -> float | None:
    """How far the best answer stands out of a ranking; None below `LEAST_IMAGES`.

    Parameters
    ----------
    z_score : (best - median) / standard deviation of the scores of all images of the index.
    n_images : how many they are.
    density : mean share of the images that a word of the channels searched is in, above 0.
    """
    if n_images < LEAST_IMAGES:
        return None
    return z_score / math.log(n_images) * math.pow(density / DENSITY, CROWDING)


def _mixture_quantile(
    share: float,
    probability: float,
    right_m: NDArray[np.float64],
    elsewhere_m: NDArray[np.float64],
) -> float:
    """The least radius that holds `share` of right errors and distances elsewhere, mixed."""
    distances = np.concatenate([right_m, elsewhere_m])
    weights = np.concatenate(
        [
            np.full(right_m.size, probability / right_m.size),
            np.full(elsewhere_m.size, (1.0 - probability) / elsewhere_m.size),
        ]
    )
    order = np.argsort(distances, kind="stable")
    held = np.cumsum(weights[order])
    at = int(np.searchsorted(held, share - _ROUNDING))
    return float(distances[order[min(at, distances.size - 1)]])


def _logistic(log_odds: float) -> float:
    # As a tanh it cannot overflow.
    return 0.5 * (1.0 + math.tanh(log_odds / 2.0))
