"""What rehearsing one query leaves on disk for comparing: votes, and outcomes of all ways."""

from collections.abc import Sequence
from itertools import product
from pathlib import Path

import numpy as np
from pydantic import TypeAdapter, ValidationError

from contracts.config import Detector
from contracts.errors import BadIndex
from index.files import read_member, read_text_file, write_arrays, write_bytes
from retrieval.fusion import Scores
from retrieval.ways import Outcome, Votes

_OUTCOMES = TypeAdapter(list[Outcome])


def write_votes(path: Path, votes: Votes) -> None:
    """One float32 array (n_images,) for each detector and k, NaN where nothing voted."""
    arrays = {
        f"{detector}-{k}": np.where(scores.touched, scores.values, np.nan).astype(np.float32)
        for (detector, k), scores in votes.items()
    }
    write_arrays(path, arrays)


def read_votes(path: Path, detectors: tuple[Detector, ...], ks: tuple[int, ...]) -> Votes:
    """Read what `write_votes` wrote.

    Raises
    ------
    BadIndex : the file is missing, damaged, or lacks a detector or k.
    """
    votes = {}
    for detector, k in product(detectors, ks):
        try:
            values = read_member(path, f"{detector}-{k}", np.float32, 1).astype(np.float64)
        except BadIndex as error:
            raise BadIndex(
                f"{path} does not hold the votes of a query ({detector}-{k}). Evaluate again."
            ) from error
        votes[detector, k] = Scores(np.nan_to_num(values, nan=0.0), ~np.isnan(values))
    return votes


def write_outcomes(votes_path: Path, outcomes: Sequence[Outcome]) -> None:
    """Beside the votes, as JSON."""
    write_bytes(votes_path.with_suffix(".json"), _OUTCOMES.dump_json(list(outcomes)))


def read_outcomes(votes_path: Path) -> list[Outcome]:
    """Read what `write_outcomes` wrote.

    Raises
    ------
    BadIndex : the file is missing or damaged.
    """
    path = votes_path.with_suffix(".json")
    try:
        return _OUTCOMES.validate_json(read_text_file(path))
    except (OSError, ValidationError) as error:
        raise BadIndex(
            f"{path} does not hold the outcomes of a query ({error}). Evaluate again."
        ) from error
