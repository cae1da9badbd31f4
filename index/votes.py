"""What rehearsing one query leaves on disk for comparing: votes, and outcomes of all ways."""

from collections.abc import Sequence
from pathlib import Path
from zipfile import BadZipFile

import numpy as np
from numpy.lib.npyio import NpzFile
from pydantic import TypeAdapter, ValidationError

from contracts.config import Detector
from contracts.errors import BadIndex
from index.files import write_arrays, write_bytes
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
    try:
        with path.open("rb") as stream, NpzFile(stream, allow_pickle=False) as content:
            arrays = {
                (name, k): content[f"{name}-{k}"].astype(np.float64)
                for name in detectors
                for k in ks
            }
    except (OSError, ValueError, KeyError, EOFError, BadZipFile) as error:
        raise BadIndex(f"{path} does not hold the votes of a query ({error}).") from error
    return {
        key: Scores(np.nan_to_num(values, nan=0.0), ~np.isnan(values))
        for key, values in arrays.items()
    }


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
        return _OUTCOMES.validate_json(path.read_bytes())
    except (OSError, ValidationError) as error:
        raise BadIndex(f"{path} does not hold the outcomes of a query ({error}).") from error
