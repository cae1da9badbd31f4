"""All sets in one report, and the shipped choice: `python -m benchmarks sets`.

Indices, answers and the report are left in `benchmarks-out/sets`; what is there is not made again.
The first run takes an hour, the analysis some minutes.
"""

from pathlib import Path

import numpy as np

from benchmarks.sets.collections import Rehearsed, rehearsed_sets
from contracts.config import DESCRIPTORS, DETECTORS, SearchConfig
from coordinator.comparing.choices import Choices, choices_of
from coordinator.comparing.report import write_comparison
from coordinator.comparing.results import Results, joined_results, results_of
from coordinator.comparing.tables import controls_table
from coordinator.engine.running import running_engine
from coordinator.export.tables import markdown, write_tables
from retrieval.choice_fit import fit_choice

OUT = Path(__file__).parents[2] / "benchmarks-out" / "sets"
SHIPPED = Path(__file__).parents[2] / "index" / "default_choice.json"
_TOWN = "synthetic town"


def run(data: Path) -> None:
    """Rehearse all sets, write the report, and fit the choice that Flaneur ships."""
    search = SearchConfig()
    with running_engine(None, None) as engine:
        parts = [_results(each, search) for each in rehearsed_sets(data, OUT, engine)]
    results = joined_results(parts)
    write_comparison(OUT / "report", results)
    print((OUT / "report" / "tables.md").read_text(encoding="utf-8"))
    _other_collections(results)
    model = fit_choice(
        results.trials,
        detectors=DETECTORS,
        descriptors=DESCRIPTORS,
        vote=search.vote,
        weights=search.weights,
        index_digest=None,
    )
    SHIPPED.write_text(model.to_json() + "\n", encoding="utf-8")
    print(f"\nShipped: {model.summary()}")


def _results(each: Rehearsed, search: SearchConfig) -> Results:
    return results_of(
        each.answers, each.queries, each.index, search, each.sets, each.votes, each.prefix
    )


def _other_collections(results: Results) -> None:
    """The same choices where a whole collection is left out, the town as one."""
    styles = ("sepia", "halftone", "engraving", "night")
    groups = np.where(np.isin(results.trials.sets, styles), _TOWN, results.trials.sets)
    choices: Choices = choices_of(results.trials, groups)
    everything = np.ones(len(groups), dtype=np.bool_)
    table = controls_table(results, choices, everything)
    title = "The same with whole collections left out"
    write_tables(OUT / "report" / "collections", title, [table], "The towns are one collection.")
    print(f"\n## {title}\n\n{markdown(table)}")
