"""The adaptive choice: which pair of detectors, and which k, a photo is searched with."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Annotated, Literal, get_args

from pydantic import Field, ValidationError

from contracts.config import Descriptor, Detector, Vote, Weight
from contracts.errors import BadIndex, WrongInput
from retrieval.complementarity import Complementarity
from retrieval.regression import (
    Choice,
    Fitted,
    Pair,
    Record,
    TrainingRow,
    Variant,
    fit_equations,
)

__all__ = ["Choice", "ChoiceModel", "LeftOutScores", "Pair", "TrainingRow", "TrainingSet", "fit"]


class TrainingSet(Record):
    """One set of queries that a model was fitted on."""

    set: str
    n_queries: Annotated[int, Field(ge=1)]
    n_places: Annotated[int, Field(ge=1)]


class LeftOutScores(Record):
    """Mean AP over queries, each chosen for by a fit without its place.

    best_fixed : the pair and k that are best on the other places. oracle : the best pair and k
    of each query, by hindsight. random : the mean over all pairs and k.
    """

    adaptive: float
    best_fixed: float
    oracle: float
    random: float


class ChoiceModel(Record):
    """A fitted choice, the search it was trained for, and what it proved to be worth."""

    form: Literal[1] = 1
    variant: Variant
    detectors: tuple[Detector, ...]
    descriptors: tuple[Descriptor, ...]
    vote: Vote
    weights: tuple[Weight, ...]
    fitted: Fitted
    left_out: LeftOutScores
    trained_on: tuple[TrainingSet, ...]

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
            first = error.errors()[0]
            where = ".".join(str(part) for part in first["loc"]) or "its beginning"
            raise BadIndex(
                f"the adaptive model does not hold at {where}: {first['msg']}. "
                "Restore it or run `flaneur train` again."
            ) from error

    @property
    def is_worth_using(self) -> bool:
        """Whether choosing did better than one fixed pair on places left out."""
        return self.left_out.adaptive > self.left_out.best_fixed

    @property
    def ks(self) -> tuple[int, ...]:
        """Every k that can be chosen, ascending."""
        return tuple(equation.k for equation in self.fitted.equations)

    @property
    def fallback_pair(self) -> Pair:
        """The pair of the best fixed choice."""
        return self.fitted.fixed[0].pair

    @property
    def fallback_k(self) -> int:
        """The k of the best fixed choice."""
        return self.fitted.fixed[0].k

    def choose(self, features: Mapping[Pair, Complementarity], ks: Sequence[int]) -> Choice:
        """Pick a pair and k for a photo: see `Fitted.choose`."""
        return self.fitted.choose(features, ks)

    def summary(self) -> str:
        """Say in one line what the choice is worth beside its controls."""
        scores = self.left_out
        n_queries = sum(one.n_queries for one in self.trained_on)
        return (
            f"{n_queries} queries, each with its place left out: adaptive ({self.variant}) mAP "
            f"{scores.adaptive:.3f}, best fixed {scores.best_fixed:.3f}, random "
            f"{scores.random:.3f}, oracle {scores.oracle:.3f}; fallback "
            f"{'-'.join(self.fallback_pair)} with k = {self.fallback_k}"
        )


def fit(
    rows: Sequence[TrainingRow],
    *,
    detectors: tuple[Detector, ...],
    descriptors: tuple[Descriptor, ...],
    vote: Vote,
    weights: tuple[Weight, ...],
    trained_on: tuple[TrainingSet, ...],
) -> ChoiceModel:
    """Fit Eq. 1 per k by least squares, and score it with each place left out in turn.

    Its two variants are both scored; the one that does better on places left out is kept.

    Parameters
    ----------
    rows : one per query, pair and k.
    detectors, descriptors, vote, weights : the search whose APs the rows hold.
    trained_on : where the queries come from.

    Raises
    ------
    WrongInput : no rows, fewer than two places, or a query that lacks pairs or k that others
        have, or has one twice, or lies in two places.
    """
    queries = _by_query(rows)
    scores = {variant: _left_out(rows, queries, variant) for variant in get_args(Variant)}
    variant: Variant = max(scores, key=lambda name: scores[name].adaptive)
    return ChoiceModel(
        variant=variant,
        detectors=detectors,
        descriptors=descriptors,
        vote=vote,
        weights=weights,
        fitted=fit_equations(rows, variant),
        left_out=scores[variant],
        trained_on=trained_on,
    )


def _by_query(rows: Sequence[TrainingRow]) -> dict[str, list[TrainingRow]]:
    queries: dict[str, list[TrainingRow]] = defaultdict(list)
    for row in rows:
        queries[row.query].append(row)
    wanted = {(row.pair, row.k) for row in rows}
    for query, own in queries.items():
        if len(own) != len(wanted) or {(row.pair, row.k) for row in own} != wanted:
            raise WrongInput(
                f"{query} has {len(own)} training rows, expected one for each of the "
                f"{len(wanted)} pairs and k; search it with all of them"
            )
        if len({row.place for row in own}) > 1:
            raise WrongInput(f"{query} lies in {len({row.place for row in own})} places, not one")
    n_places = len({row.place for row in rows})
    if n_places < 2:
        raise WrongInput(
            f"the adaptive choice is judged with each place left out: queries of at least 2 "
            f"places are needed, got {n_places}"
        )
    return queries


def _left_out(
    rows: Sequence[TrainingRow],
    queries: Mapping[str, Sequence[TrainingRow]],
    variant: Variant,
) -> LeftOutScores:
    adaptive, best_fixed = [], []
    for place in sorted({row.place for row in rows}):
        fitted = fit_equations([row for row in rows if row.place != place], variant)
        ks = [equation.k for equation in fitted.equations]
        for own in queries.values():
            if own[0].place != place:
                continue
            ap = {(row.pair, row.k): row.ap for row in own}
            chosen = fitted.choose({row.pair: row.features for row in own}, ks)
            adaptive.append(ap[chosen.pair, chosen.k])
            best_fixed.append(ap[fitted.fixed[0].pair, fitted.fixed[0].k])
    n_queries = len(queries)
    return LeftOutScores(
        adaptive=sum(adaptive) / n_queries,
        best_fixed=sum(best_fixed) / n_queries,
        oracle=sum(max(row.ap for row in own) for own in queries.values()) / n_queries,
        random=sum(row.ap for row in rows) / len(rows),
    )
