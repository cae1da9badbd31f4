"""The adaptive choice: which pair of detectors, and which k, a photo is searched with."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from contracts.config import MAX_NEIGHBOURS, Descriptor, Detector, VariantName, Vote, Weight
from contracts.errors import BadIndex, WrongInput
from contracts.faults import first_fault
from retrieval.candidates import FEATURES, Candidate, Pair
from retrieval.regression import (
    VARIANTS,
    Column,
    Regression,
    columns,
    is_outside,
    used_features,
)

N_JOINED: tuple[Literal[1, 2], ...] = (1, 2)
"""How many rankings, of pairs of one k, are joined."""

K = Annotated[int, Field(ge=1, le=MAX_NEIGHBOURS)]


@dataclass(frozen=True, slots=True)
class Choice:
    """What a photo is to be searched with, what is expected of it, and why.

    pairs : one, or two whose rankings are joined.
    """

    pairs: tuple[Pair, ...]
    k: int
    predicted_map: float
    reason: str


class Record(BaseModel):
    """A part of a model's JSON: no unknown key, no wrong type, no infinity."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


class TrainingSet(Record):
    """One set of queries that a model was fitted on."""

    set: str
    n_queries: Annotated[int, Field(ge=1)]
    n_places: Annotated[int, Field(ge=1)]


class Range(Record):
    """A mean and its bootstrap 95 % interval; None where it cannot be told."""

    mean: float | None
    low: float | None
    high: float | None


class LeftOutScores(Record):
    """Mean AP on places left out of the fit.

    The variant, too, is picked on the other places: the score of the one that turned out best
    would flatter it.
    gain : of adaptive over best_fixed, the pair and k best on the other places; share : of the
    room between that and the oracle; random : the mean over all pairs and k.
    """

    adaptive: Range
    gain: Range
    share: Range
    best_fixed: float
    worst_fixed: float
    random: float
    oracle: float
    n_chosen: int


class Coefficient(Record):
    """One coefficient and its bootstrap interval: of a term, for one k or pair or for all."""

    term: str
    k: K | None
    pair: Pair | None
    value: float
    low: float
    high: float

    def column(self) -> Column:
        return Column(self.term, self.k, self.pair)


class TermRange(Record):
    """Lowest and highest value of a feature in training, as the variant sees it."""

    term: str
    low: float
    high: float


class FixedScore(Record):
    """Mean AP over the training queries of one pair and k for all of them."""

    pair: Pair
    k: K
    mean_ap: float


class ChoiceModel(Record):
    """A fitted choice, the search it was trained for, and what it proved to be worth.

    fixed : every candidate, best first. level : see `Regression`. index_digest : of the one index
    it was trained on; None: of several.
    """

    form: Literal[1] = 1
    variant: VariantName
    n_joined: Literal[1, 2]
    detectors: tuple[Detector, ...]
    descriptors: tuple[Descriptor, ...]
    vote: Vote
    weights: tuple[Weight, ...]
    coefficients: Annotated[tuple[Coefficient, ...], Field(min_length=1)]
    level: float
    ranges: tuple[TermRange, ...]
    fixed: Annotated[tuple[FixedScore, ...], Field(min_length=1)]
    left_out: LeftOutScores
    trained_on: Annotated[tuple[TrainingSet, ...], Field(min_length=1)]
    index_digest: str | None

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        variant = VARIANTS[self.variant]
        wanted = columns(variant, self.candidates())
        if [each.column() for each in self.coefficients] != wanted:
            raise ValueError(f"coefficients are not those of the variant {self.variant}")
        if tuple(each.term for each in self.ranges) != variant.terms:
            raise ValueError(f"ranges are not of the terms of the variant {self.variant}")
        return self

    def to_json(self) -> str:
        """Write all of it; `from_json` reads it back equal."""
        return self.model_dump_json(indent=1)

    @classmethod
    def from_json(cls, text: str) -> "ChoiceModel":
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
                f"the adaptive model does not hold at {where or 'its beginning'}: {what}. "
                "Restore it or run `flaneur train` again."
            ) from error

    def candidates(self) -> tuple[Candidate, ...]:
        """Every pair and k that can be chosen, in the order of their features."""
        known = {(each.pair, each.k) for each in self.fixed}
        return tuple(sorted(known, key=lambda each: (each[1], [*map(self._place, each[0])])))

    def _place(self, detector: Detector) -> int:
        return self.detectors.index(detector)

    @property
    def needs_look(self) -> bool:
        """Whether a photo must be searched with every candidate before one is chosen."""
        return VARIANTS[self.variant].needs_look

    def choose(
        self,
        features: Mapping[Candidate, tuple[float, ...]],
        allowed: Collection[Candidate] | None = None,
    ) -> Choice:
        """Pick the candidate of the highest predicted mAP', the earlier if equal.

        Where two are joined, the next best of the same k goes with it. If any candidate's
        features lie outside those of training, what was best for all is taken instead, and the
        reason says so.

        Parameters
        ----------
        features : of every candidate: of `candidates.FEATURES` as many as the variant needs.
        allowed : candidates that the user left open; None: all.

        Raises
        ------
        WrongInput : features of a candidate are missing, or no candidate is allowed.
        """
        known = self.candidates()
        needed = 1 + max((FEATURES.index(each.term) for each in self.ranges), default=-1)
        if any(each not in features or len(features[each]) < needed for each in known):
            raise WrongInput(
                f"the adaptive choice needs the first {needed} features of every pair and k that "
                "it knows"
            )
        table = np.zeros((1, len(known), len(FEATURES)))
        for row, candidate in enumerate(known):
            table[0, row, : len(features[candidate])] = features[candidate]
        outside = self._outside(table)
        if outside:
            return self.best_fixed(allowed, f"fallback to what was best for all: {outside}")
        predicted = self._regression().predict(table)[0]
        ranked = sorted(
            (row for row, each in enumerate(known) if allowed is None or each in allowed),
            key=lambda row: -predicted[row],
        )
        best = [(known[row], float(predicted[row])) for row in ranked]
        return self._joined(best, f"highest predicted mAP of {len(best)} choices", allowed)

    def best_fixed(self, allowed: Collection[Candidate] | None, reason: str) -> Choice:
        """Take what was best for all training queries.

        Raises
        ------
        WrongInput : no candidate is allowed.
        """
        best = [
            ((each.pair, each.k), each.mean_ap)
            for each in self.fixed
            if allowed is None or (each.pair, each.k) in allowed
        ]
        return self._joined(best, reason, allowed)

    def _joined(
        self,
        best: Sequence[tuple[Candidate, float]],
        reason: str,
        allowed: Collection[Candidate] | None,
    ) -> Choice:
        """Take the first, and if two are joined the next of the same k; best first."""
        if not best:
            raise self._nothing_allowed(allowed)
        (_, k), expected = best[0]
        pairs = [pair for (pair, of_k), _ in best if of_k == k]
        return Choice(tuple(pairs[: self.n_joined]), k, expected, reason)

    def summary(self) -> str:
        """Say in one line what the choice is worth beside its controls."""
        scores, best = self.left_out, self.fixed[0]
        n_queries = sum(one.n_queries for one in self.trained_on)
        return (
            f"{n_queries} queries, each with its place left out: {self._name()} mAP "
            f"{_number(scores.adaptive.mean)}, best fixed pair {scores.best_fixed:.3f} (difference "
            f"{_interval(scores.gain)}), random {scores.random:.3f}, oracle {scores.oracle:.3f}; "
            f"{scores.n_chosen} different choices; best for all: {'-'.join(best.pair)} with "
            f"k = {best.k}"
        )

    def _name(self) -> str:
        joined = "" if self.n_joined == 1 else ", the two best joined"
        return f"chosen ({self.variant}{joined})"

    def _regression(self) -> Regression:
        values = np.array([each.value for each in self.coefficients])
        return Regression(VARIANTS[self.variant], self.candidates(), values, self.level)

    def _outside(self, table: np.ndarray) -> str:
        """Name the terms outside their range in training; empty if none is."""
        variant = VARIANTS[self.variant]
        low = np.array([each.low for each in self.ranges])
        high = np.array([each.high for each in self.ranges])
        beyond = is_outside(variant, table, low, high)[0]
        seen = used_features(variant, table)[0]
        return " and ".join(
            f"{each.term} was {each.low:.3g} to {each.high:.3g} in training, here "
            f"{values.min():.3g} to {values.max():.3g}"
            for each, values, is_beyond in zip(self.ranges, seen.T, beyond, strict=True)
            if is_beyond
        )

    def _nothing_allowed(self, allowed: Collection[Candidate] | None) -> WrongInput:
        known = ", ".join(str(k) for k in sorted({k for _, k in self.candidates()}))
        return WrongInput(
            f"the adaptive model chooses k from {known} and pairs of {', '.join(self.detectors)}; "
            f"{len(allowed or ())} choices were left to it and it knows none of them. Give both "
            "--pair and --k"
        )


def _interval(value: Range) -> str:
    if value.mean is None:
        return "unknown"
    if value.low is None or value.high is None:
        return f"{value.mean:+.3f}"
    return f"{value.mean:+.3f} [{value.low:+.3f}, {value.high:+.3f}]"


def _number(value: float | None) -> str:
    return "unknown" if value is None else f"{value:.3f}"
