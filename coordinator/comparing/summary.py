"""One line a set: the best single detector, late fusion, every rule of fusion, the choices."""

import numpy as np

from contracts.config import Vote
from coordinator.comparing.choices import ADAPTIVE, PICKED, Choices
from coordinator.comparing.results import Results
from coordinator.comparing.tables import best_way, difference
from coordinator.export.figures import Panel, Share
from coordinator.export.tables import Cell, Table
from retrieval.late_fusion import LATE_FUSIONS
from retrieval.ways import Method, Way

_METHODS = ("single", "fii", *LATE_FUSIONS)


def summary_tables(results: Results, choices: Choices) -> list[Table]:
    """Every set, a line a way; and who beats whom."""
    votes = tuple(dict.fromkeys(way.vote for way in results.ways))
    lines: list[tuple[Cell, ...]] = []
    differences: list[tuple[Cell, ...]] = []
    for name in sorted(set(results.trials.sets)):
        rows = results.of_set(str(name))
        single = best_way(results, _ways(results, "single"), rows)
        late = best_way(results, _late(results), rows)
        fused = {vote: best_way(results, _ways(results, "fii", vote), rows) for vote in votes}
        own = fused[results.rule[0]]
        ways = [
            ("best single detector", single),
            ("best late fusion", late),
            *((f"best FII, {vote}", fused[vote]) for vote in votes),
        ]
        for label, n_detectors in (("best FII of three", 3), ("FII of all", None)):
            wider = _ways(results, "fii", None, n_detectors)
            if wider:
                ways.append((label, best_way(results, wider, rows)))
        for label, way in ways:
            mean = results.mean(results.ap[:, results.ways.index(way)], rows)
            lines.append((str(name), label, _name(way), mean))
        for label, other in (("FII - best single detector", single), ("FII - best LF", late)):
            differences.append((str(name), label, difference(results, own, other, rows)))
        for label, values in (
            ("best fixed on other places", choices.controls.best_fixed),
            ("adaptive (Eq. 1)", choices.ap(results.trials, ADAPTIVE)),
            ("best choice on other places", choices.ap(results.trials, PICKED)),
            ("oracle pair and k", choices.controls.oracle),
        ):
            lines.append((str(name), label, "", results.mean(values, rows)))
        for label, gained in (
            ("adaptive (Eq. 1) - best fixed", choices.ap(results.trials, ADAPTIVE)),
            ("best choice - best fixed", choices.ap(results.trials, PICKED)),
        ):
            gain = gained - choices.controls.best_fixed
            differences.append((str(name), label, results.mean(gain, rows)))
    hindsight = (
        "The best single detector, late fusion (LF) and fusion of inverted indices (FII, by the "
        "search's own vote) are picked by hindsight on the set itself; the choices, which of them "
        "is used, and the best fixed pair without the query's place."
    )
    return [
        Table("sets", "All sets", ("set", "way", "which", "mAP"), tuple(lines), hindsight),
        Table(
            "differences",
            "Who beats whom",
            ("set", "difference", "mAP"),
            tuple(differences),
            f"Paired by query. {hindsight}",
        ),
    ]


def rules_table(results: Results) -> Table:
    """Every vote with every weighting, over all pairs and k: what should be the default."""
    sets = [str(name) for name in sorted(set(results.trials.sets))]
    weights = results.trials.weights()
    everything = np.ones(len(results.trials.queries), dtype=np.bool_)
    rules = dict.fromkeys((way.method, way.vote, way.weights) for way in results.ways)
    lines: list[tuple[Cell, ...]] = []
    for method, vote, weighting in rules:
        at = [
            number
            for number, way in enumerate(results.ways)
            if (way.method, way.vote, way.weights) == (method, vote, weighting)
            and len(way.detectors) <= 2
        ]
        mean = results.ap[:, at].mean(axis=1)
        best = np.average(results.ap[:, at], axis=0, weights=weights)
        lines.append(
            (
                method,
                vote,
                ", ".join(weighting) or "none",
                *(float(mean[results.of_set(name)].mean()) for name in sets),
                results.mean(mean, everything),
                float(best.max()),
                _name(results.ways[at[int(best.argmax())]]),
            )
        )
    lines.sort(key=lambda line: _METHODS.index(str(line[0])))
    return Table(
        "rules",
        "Rules of fusion",
        ("method", "vote", "weights", *sets, "all sets", "best pair and k", "which"),
        tuple(lines),
        "mAP averaged over all pairs (of `single`: detectors) and k, so that none is picked; late "
        "fusion is of single detectors by the search's own rule. The last two columns are the "
        "best by hindsight. Sets count by the root of their size.",
    )


def chosen_shares(results: Results, choices: Choices, paper_k_2: float | None) -> list[Panel]:
    """How often each pair and each k is chosen by Eq. 1, as in the paper's Fig. 2."""
    made = choices.made[ADAPTIVE][:, 0]
    candidates = results.trials.candidates
    pairs = [pair for pair, k in candidates if k == candidates[0][1]]
    of_pair = [float(np.mean([candidates[at][0] == pair for at in made])) for pair in pairs]
    ks = sorted({k for _, k in candidates})
    of_k = [float(np.mean([candidates[at][1] == k for at in made])) for k in ks]
    return [
        Panel(
            "pair of detectors",
            tuple(Share("-".join(pair), share) for pair, share in zip(pairs, of_pair, strict=True)),
        ),
        Panel(
            "k",
            tuple(
                Share(str(k), share, paper_k_2 if k == ks[0] else None)
                for k, share in zip(ks, of_k, strict=True)
            ),
        ),
    ]


def _ways(
    results: Results, method: Method, vote: Vote | None = None, n_detectors: int | None = 2
) -> list[Way]:
    """Ways by the search's own weights; a single detector, or so many; None: more than three."""
    own_vote, weights = results.rule
    return [
        way
        for way in results.ways
        if (way.method, way.vote, way.weights) == (method, vote or own_vote, weights)
        and (
            method == "single"
            or (
                len(way.detectors) > 3 if n_detectors is None else len(way.detectors) == n_detectors
            )
        )
    ]


def _late(results: Results) -> list[Way]:
    return [way for method in LATE_FUSIONS for way in _ways(results, method)]


def _name(way: Way) -> str:
    method = "" if way.method in ("single", "fii") else f"{way.method} "
    return f"{method}{'-'.join(way.detectors)}, k = {way.k}"
