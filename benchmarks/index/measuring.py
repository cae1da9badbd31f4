"""All that is measured of one simulated survey."""

import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.index.asking import (
    VOTES,
    Looked,
    look_up,
    look_up_cold,
    opening_s,
    photos_of,
)
from benchmarks.index.bag_of_words import Bag, measure_bag
from benchmarks.index.build import Built, build
from benchmarks.index.fresh_process import Took, in_fresh_process
from benchmarks.index.survey import Survey
from contracts.config import Vote
from index.opened import OpenedIndex

_ROUNDS = 3


@dataclass(frozen=True, slots=True)
class Asked:
    """Lookups with the lists on disk and in memory, by vote; the best round of each photo."""

    cold: Looked
    warm: dict[Vote, Looked]


@dataclass(frozen=True, slots=True)
class Measured:
    """A survey's figures. open_s, import_s : of a new Python. bag : of a library in memory."""

    survey: Survey
    built: Built
    open_s: float
    import_s: float
    asked: Took[Asked]
    bag: Took[Bag] | None


def measure_survey(survey: Survey, has_peer: bool) -> Measured:
    """Build, open and ask an index, in a temporary folder (TMPDIR says on which disk)."""
    with tempfile.TemporaryDirectory() as scratch:
        root = Path(scratch) / "index"
        built = build(root, survey)
        open_s, import_s = opening_s(root)
        asked = in_fresh_process(_ask, root, survey)
    bag = None
    if has_peer:
        with tempfile.TemporaryDirectory() as scratch:
            bag = in_fresh_process(measure_bag, Path(scratch), survey, photos_of(survey))
    return Measured(survey, built, open_s, import_s, asked, bag)


def _ask(root: Path, survey: Survey) -> Asked:
    photos = photos_of(survey)
    look_up(OpenedIndex(root), survey, photos[:1], VOTES[0])  # compiles
    cold = look_up_cold(root, survey, photos, VOTES[0])
    index = OpenedIndex(root)
    warm = {}
    for vote in VOTES:
        rounds = [look_up(index, survey, photos, vote) for _ in range(1 + _ROUNDS)][1:]
        warm[vote] = Looked(
            np.min([one.seconds for one in rounds], axis=0),
            np.min([one.cpu_s for one in rounds], axis=0),
            np.min([one.reading_cpu_s for one in rounds], axis=0),
            rounds[0].n_postings,
            rounds[0].share_found,
        )
    return Asked(cold, warm)
