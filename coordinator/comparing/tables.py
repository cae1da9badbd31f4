"""The paper's tables for our queries: a mean with its interval each, the paper's figure beside."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from contracts.config import Detector
from coordinator.comparing import paper
from coordinator.comparing.choices import ADAPTIVE, PICKED, Choices
from coordinator.comparing.results import Results
from coordinator.export.tables import Cell, Table
from retrieval.late_fusion import LATE_FUSIONS, LateFusion
from retrieval.left_out import worth
from retrieval.resampling import bootstrap_difference
from retrieval.ways import Method, Way

Rows = NDArray[np.bool_]
_PAPER = (paper.PARIS, paper.CROSS_DOMAIN)
_NONE = (None, None)
_TABLE_K = 2
"""The k of the paper's Tables I to III."""


def paper_tables(results: Results, choices: Choices, rows: Rows) -> list[Table]:
    """Tables I to IV and the controls, of some queries. rows : (n,) bool."""
    ranked = _by_prediction(results, choices, rows)
    return [
        _predicted(results, choices, rows, ranked),
        _fused_and_late(results, rows, ranked),
        _single(results, rows),
        _by_k(results, choices, rows, ranked),
        controls_table(results, choices, rows),
    ]


def _by_prediction(
    results: Results, choices: Choices, rows: Rows
) -> list[tuple[tuple[Detector, Detector], float]]:
    """Pairs by their mean mAP' at k = 2, best first."""
    weights = results.trials.take(rows).weights()
    means = np.average(choices.predicted[rows], axis=0, weights=weights)
    found = [
        (pair, float(means[at]))
        for at, (pair, k) in enumerate(results.trials.candidates)
        if k == _TABLE_K
    ]
    return sorted(found, key=lambda each: -each[1])


def _predicted(
    results: Results,
    choices: Choices,
    rows: Rows,
    ranked: Sequence[tuple[tuple[Detector, Detector], float]],
) -> Table:
    lines: list[tuple[Cell, ...]] = []
    for pair, predicted in ranked:
        measured = results.mean(ap_of(results, "fii", pair, _TABLE_K), rows)
        lines.append(("-".join(pair), predicted, measured, *paper.PREDICTED.get(pair, _NONE)))
    return Table(
        "table-1",
        "Table I: predicted mAP' of detector pairs",
        ("pair", "mAP' (Eq. 1)", "measured mAP", *(f"mAP' {name} [paper]" for name in _PAPER)),
        tuple(lines),
        f"k = {_TABLE_K}, vote {results.rule[0]}. Predicted without the query's place.",
    )


def _fused_and_late(
    results: Results, rows: Rows, ranked: Sequence[tuple[tuple[Detector, Detector], float]]
) -> Table:
    lines: list[tuple[Cell, ...]] = []
    shown = dict(zip(("best predicted", "second"), ranked, strict=False))
    if len(ranked) > len(shown):
        shown["worst predicted"] = ranked[-1]
    for label, (pair, _) in shown.items():
        late = best_late(results, pair, _TABLE_K, rows)
        lines.append(_fusion_line(results, "fii", label, pair, rows, paper.FUSED))
        lines.append(_fusion_line(results, late, label, pair, rows, paper.LATE))
    return Table(
        "table-2",
        "Table II: fusion of inverted indices (FII) and late fusion (LF)",
        ("fusion", "prediction", "pair", "mAP", "mAP@10", *(f"{name} [paper]" for name in _PAPER)),
        tuple(lines),
        f"k = {_TABLE_K}. LF is the best of {', '.join(LATE_FUSIONS)} by hindsight, which favours "
        "it. Paper's top ten of PCD DB: hesaff-star FII 0.656, LF 0.420.",
    )


def _fusion_line(
    results: Results,
    method: Method,
    label: str,
    pair: tuple[Detector, Detector],
    rows: Rows,
    printed: paper.ByPair,
) -> tuple[Cell, ...]:
    name = "FII" if method == "fii" else f"LF {method}"
    ap = results.mean(ap_of(results, method, pair, _TABLE_K), rows)
    at_10 = results.mean(ap_of(results, method, pair, _TABLE_K, at_10=True), rows)
    return (name, label, "-".join(pair), ap, at_10, *printed.get(pair, _NONE))


def _single(results: Results, rows: Rows) -> Table:
    lines = [
        (
            name,
            *(results.mean(ap_of(results, "single", (name,), k), rows) for k in _ks(results)),
            *paper.SINGLE.get(name, _NONE),
        )
        for name in _detectors(results)
    ]
    return Table(
        "table-3",
        "Table III: single detectors",
        ("detector", *(f"k = {k}" for k in _ks(results)), *(f"{n} [paper]" for n in _PAPER)),
        tuple(lines),
        "mAP. The paper's figures are for k = 2.",
    )


def _by_k(
    results: Results,
    choices: Choices,
    rows: Rows,
    ranked: Sequence[tuple[tuple[Detector, Detector], float]],
) -> Table:
    lines: list[tuple[Cell, ...]] = []
    for pair, _ in ranked[:2]:
        for k in _ks(results):
            mean = results.mean(ap_of(results, "fii", pair, k), rows)
            printed = paper.BY_K.get((*pair, k), _NONE)
            lines.append(("-".join(pair), str(k), mean, *printed))
    adaptive = results.mean(choices.ap(results.trials, ADAPTIVE), rows)
    lines.append(("adaptive (Eq. 1)", "adaptive", adaptive, *paper.ADAPTIVE))
    picked = results.mean(choices.ap(results.trials, PICKED), rows)
    lines.append((PICKED[0], "adaptive", picked, *_NONE))
    return Table(
        "table-4",
        "Table IV: detector pairs and k",
        ("choice", "k", "mAP", *(f"{name} [paper]" for name in _PAPER)),
        tuple(lines),
        "The two pairs of the highest mAP', and choices made for each photo, without its place.",
    )


def controls_table(results: Results, choices: Choices, rows: Rows) -> Table:
    """Every choice beside its controls, of some queries."""
    trials = results.trials.take(rows)
    beside = choices.controls.of(rows)
    lines: list[tuple[Cell, ...]] = [
        (name, results.mean(values, rows), None, None, None)
        for name, values in (
            ("best fixed pair and k", choices.controls.best_fixed),
            ("worst fixed pair and k", choices.controls.worst_fixed),
            ("random pair and k", choices.controls.random),
            ("oracle pair and k", choices.controls.oracle),
            *(
                (f"query-adaptive late fusion of all detectors, k = {k}", values)
                for k, values in results.query_adaptive.items()
            ),
        )
    ]
    for key, made in choices.made.items():
        found = worth(trials, made[rows], beside, choices.groups[rows])
        lines.append((choice_name(key), found.ap, found.gain, found.share, found.n_chosen))
    return Table(
        "controls",
        "The choice beside its controls",
        ("choice", "mAP", "gain over best fixed", "share of the oracle's room", "choices used"),
        tuple(lines),
        "Each made without the query's place, the best fixed pair too. Sets count by the root of "
        "their size. `kp_only` is the regression on the number of keypoints alone; late fusion "
        "after Zheng et al., CVPR 2015. One choice used means that nothing was adapted. The best "
        "of many rows flatters itself; the last does not.",
    )


def choice_name(key: tuple[str, int]) -> str:
    """Name a variant and how many rankings it joins."""
    return key[0] if key[1] == 1 else f"{key[0]}, two best joined"


def ap_of(
    results: Results,
    method: Method,
    detectors: tuple[Detector, ...],
    k: int,
    *,
    at_10: bool = False,
) -> NDArray[np.float64]:
    """AP of every query by one way and the search's own rule; (n,)."""
    at = results.ways.index(Way(method, *results.rule, detectors, k))
    return np.asarray((results.ap_10 if at_10 else results.ap)[:, at], dtype=np.float64)


def best_late(results: Results, detectors: tuple[Detector, ...], k: int, rows: Rows) -> LateFusion:
    """The late fusion of the highest mAP, by hindsight."""
    return max(
        LATE_FUSIONS,
        key=lambda name: results.mean(ap_of(results, name, detectors, k), rows).mean,
    )


def best_way(results: Results, ways: Sequence[Way], rows: Rows) -> Way:
    """The way of the highest mAP on some queries, by hindsight."""
    means = results.ap[rows].mean(axis=0)
    return max(ways, key=lambda way: float(means[results.ways.index(way)]))


def difference(results: Results, a: Way, b: Way, rows: Rows) -> Cell:
    """mAP of a minus that of b, paired, with its interval."""
    at_a, at_b = results.ways.index(a), results.ways.index(b)
    places = results.trials.places[rows]
    return bootstrap_difference(results.ap[rows, at_a], results.ap[rows, at_b], places)


def _detectors(results: Results) -> tuple[Detector, ...]:
    return tuple(dict.fromkeys(name for pair, _ in results.trials.candidates for name in pair))


def _ks(results: Results) -> list[int]:
    return sorted({k for _, k in results.trials.candidates})
