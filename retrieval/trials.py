"""What every choice achieved on every training query: the table that a choice is learnt from."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contracts.errors import WrongInput
from retrieval.candidates import FEATURES, Candidate


@dataclass(frozen=True, slots=True)
class Trials:
    """All candidates tried on all queries.

    queries, places, sets : (n,) names; queries of one place are left out together.
    candidates : (c,) pairs and k. ap : (n, c) float64. ap_together : (n, c, c) float64, of the
    joined rankings of two candidates; NaN where they differ in k.
    features : (n, c, f) float64, in the order of `candidates.FEATURES`.
    """

    queries: tuple[str, ...]
    places: NDArray[np.str_]
    sets: NDArray[np.str_]
    candidates: tuple[Candidate, ...]
    ap: NDArray[np.float64]
    ap_together: NDArray[np.float64]
    features: NDArray[np.float64]

    def __post_init__(self) -> None:
        n, c = len(self.queries), len(self.candidates)
        arrays = (self.places, self.sets, self.ap, self.ap_together, self.features)
        shapes = tuple(array.shape for array in arrays)
        wanted = ((n,), (n,), (n, c), (n, c, c), (n, c, len(FEATURES)))
        if n == 0 or c == 0 or shapes != wanted:
            raise WrongInput(
                f"trials of {n} queries with {c} candidates have arrays of shapes {shapes}, "
                f"expected {wanted}"
            )
        if not (np.isfinite(self.ap).all() and np.isfinite(self.features).all()):
            raise WrongInput("trials hold a score or feature that is not finite")

    def take(self, rows: NDArray[np.bool_]) -> "Trials":
        """Keep the queries where `rows`, (n,) bool, is true.

        Raises
        ------
        WrongInput : none is left.
        """
        return Trials(
            tuple(query for query, kept in zip(self.queries, rows, strict=True) if kept),
            self.places[rows],
            self.sets[rows],
            self.candidates,
            self.ap[rows],
            self.ap_together[rows],
            self.features[rows],
        )

    def weights(self) -> NDArray[np.float64]:
        """Weigh queries so that a set counts by the root of its size; (n,), mean 1.

        By its size a large set would decide alone. If all sets counted alike, each query of a
        small one would weigh so much that to leave it out turns the choice against it.
        """
        _, which, sizes = np.unique(self.sets, return_inverse=True, return_counts=True)
        weights = 1.0 / np.sqrt(sizes[which])
        return np.asarray(weights * len(weights) / weights.sum(), dtype=np.float64)

    def mean_ap(self) -> NDArray[np.float64]:
        """Mean AP of each candidate, by `weights`; (c,)."""
        return np.asarray(np.average(self.ap, axis=0, weights=self.weights()), dtype=np.float64)


def joined(parts: Sequence[Trials]) -> Trials:
    """Put the queries of several sets into one table.

    Raises
    ------
    WrongInput : no part, or they tried different candidates.
    """
    if not parts or len({part.candidates for part in parts}) > 1:
        raise WrongInput("trials of several sets can be joined if all tried the same pairs and k")
    return Trials(
        tuple(query for part in parts for query in part.queries),
        np.concatenate([part.places for part in parts]),
        np.concatenate([part.sets for part in parts]),
        parts[0].candidates,
        np.concatenate([part.ap for part in parts]),
        np.concatenate([part.ap_together for part in parts]),
        np.concatenate([part.features for part in parts]),
    )
