"""The report of a comparison: tables as Markdown and CSV, figures as PNG."""

import shutil
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from contracts.config import SearchConfig
from contracts.errors import WrongInput
from contracts.progress import Progress
from coordinator.comparing import paper
from coordinator.comparing.choices import choices_of
from coordinator.comparing.results import Results, results_of
from coordinator.comparing.summary import chosen_shares, rules_table, summary_tables
from coordinator.comparing.tables import paper_tables
from coordinator.export.figures import draw_intervals, draw_shares
from coordinator.export.files import write_whole
from coordinator.export.tables import write_tables
from coordinator.following.follow import Follower
from coordinator.querying import Rules, rehearse_queries
from coordinator.training import places_of
from coordinator.truth import JudgedQuery
from index.opened import OpenedIndex
from retrieval.left_out import check_groups
from workers.stages.choose import KS

TITLE = "Fusion and the choice of detectors, measured"


def compare(
    index: OpenedIndex,
    queries: Sequence[JudgedQuery],
    search: SearchConfig,
    set_name: str,
    out: Path,
    follower: Follower,
    progress: Progress,
) -> None:
    """Have every query answered in every way, and write the report of it into a folder.

    Raises
    ------
    WrongInput : no query can be judged, all are of one place, or nothing can be written there.
    """
    n_descriptors = len(search.descriptors or index.config.features.descriptors)
    rules = Rules.all_for(n_descriptors, search)
    # Workers elsewhere share the index with us, and not the report's folder.
    votes = _shared_folder(index.root / "rehearsals")
    progress.begin("tables", len(queries), 0)
    try:
        answers = rehearse_queries(
            index, queries, search, rules, KS, follower, lambda: progress.advance("tables"), votes
        )
        sets = [set_name] * len(queries)
        write_comparison(out, results_of(answers, queries, index, search, sets, votes))
    finally:
        shutil.rmtree(votes, ignore_errors=True)


def check_comparable(index: OpenedIndex, queries: Sequence[JudgedQuery]) -> None:
    """Refuse before the work what cannot be compared after it.

    Raises
    ------
    WrongInput : the index has one detector, or all queries lie at one place.
    """
    if len(index.config.features.detectors) < 2:
        raise WrongInput(
            f"pairs of detectors are compared and {index.root} has only one detector; index again "
            "with two or more --detectors"
        )
    check_groups(np.array(sorted(set(places_of(queries).values()))))


def _shared_folder(parent: Path) -> Path:
    """A new folder that workers of other users may write to."""
    try:
        parent.mkdir(exist_ok=True)
        folder = Path(tempfile.mkdtemp(dir=parent))
        folder.chmod(0o777)
    except OSError as error:
        raise WrongInput(
            f"{parent} cannot be written ({error.strerror}), and the votes of queries are kept "
            "there for a while; make the index folder writable"
        ) from error
    return folder


def write_comparison(out: Path, results: Results) -> None:
    """Write `tables.md`, a CSV a table, and the figures into a folder.

    Raises
    ------
    WrongInput : the queries are all of one place, or nothing can be written there.
    """
    made = choices_of(results.trials, results.trials.places)
    everything = np.ones(len(results.trials.queries), dtype=np.bool_)
    tables = [
        *paper_tables(results, made, everything),
        *summary_tables(results, made),
        rules_table(results),
    ]
    sets, counts = np.unique(results.trials.sets, return_counts=True)
    queries = ", ".join(f"{name} {count}" for name, count in zip(sets, counts, strict=True))
    write_tables(
        out,
        TITLE,
        tables,
        f"Queries: {queries}. In brackets bootstrap 95 % intervals, places drawn as a whole. "
        "[paper]: Bhowmik et al., JURSE 2017, on data that we do not have: for proportions.",
    )
    by_name = {table.name: table for table in tables}
    paris = f"{paper.PARIS} [paper]"
    for name, value, label, group, printed in (
        ("table-1", "measured mAP", "pair", None, f"mAP' {paris}"),
        ("table-2", "mAP", "fusion", "pair", paris),
        ("table-3", "k = 2", "detector", None, paris),
        ("table-4", "mAP", "k", "choice", paris),
        ("controls", "mAP", "choice", None, None),
        ("sets", "mAP", "way", "set", None),
        ("differences", "mAP", "difference", "set", None),
    ):
        drawn = draw_intervals(by_name[name], value, label, group, printed)
        write_whole(out / f"{name}.png", drawn)
    panels = chosen_shares(results, made, paper.SHARE_OF_K_2[0])
    write_whole(out / "figure-2.png", draw_shares("Chosen by Eq. 1, place left out", panels))
