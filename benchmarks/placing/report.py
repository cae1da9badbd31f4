"""Tables and plots: do radii hold what they say, and are photos of elsewhere told apart."""

from collections.abc import Sequence
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from benchmarks.placing.answers import Placed, Standing
from benchmarks.table import print_table
from geo.confidence import Evidence, PlacingModel
from retrieval.resampling import bootstrap_mean

Tested = tuple[str, Sequence[Placed], PlacingModel]
"""What is tested, its answers, and a model that was fitted without any of them."""
_LEVELS = np.array([0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.68, 0.8, 0.9, 0.95, 0.99])
_COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00")
"""Of Okabe & Ito (2008), which differ to every eye."""
_STYLES = ("--", "-.", ":")


def print_coverage(tests: Sequence[Tested]) -> None:
    """How often the truth lies inside the radii, of each test and of all towns together."""
    towns = [test for test in tests if test[0].removeprefix("town ").isdigit()]
    rows = [_coverage(test[0], [test]) for test in tests]
    rows.insert(len(towns), _coverage("all towns", towns))
    header = ("photos of", "n", "inside 68 %", "inside 95 %")
    print_table((*header, "median radius 68 %, m", "95 %, m", "median error, m"), rows)


def _coverage(name: str, tests: Sequence[Tested]) -> tuple[object, ...]:
    own = [(_of_survey(answers), model) for _, answers, model in tests]
    groups = [answer.group for answers, _ in own for answer in answers]
    errors = [answer.error_m for answers, _ in own for answer in answers]
    shares = (0.68, 0.95)
    inside = [np.concatenate([_inside(*each, share) for each in own]) for share in shares]
    radii = [np.concatenate([_radii(*each, share) for each in own]) for share in shares]
    return (
        name,
        len(groups),
        *(_share(each, groups) for each in inside),
        *(f"{np.median(each):.1f}" for each in radii),
        f"{np.median(errors):.1f}",
    )


def print_telling_apart(tests: Sequence[Tested]) -> None:
    """How well confidence tells photos of the survey from those of elsewhere."""
    rows = []
    for name, answers, model in tests:
        own, strangers = _of_survey(answers), _strangers(answers)
        for label, some in (("all", strangers), *_by_set(strangers)):
            rows.append(
                (
                    name,
                    label,
                    f"{len(own)} / {len(some)}",
                    _auc(_prominences(own), _prominences(some), [one.group for one in own]),
                    _share(_said_in(own, model), [one.group for one in own]),
                    _share(_said_in(some, model), [one.group for one in some]),
                )
            )
    header = ("survey", "photos of elsewhere", "n", "ROC AUC")
    print_table((*header, "said to be in, of it", "said to be in, of elsewhere"), rows)


def print_with_and_without(standings: Sequence[Standing], model: PlacingModel) -> None:
    """The same photos asked of an index with their place and of one without."""
    rows = []
    for name in dict.fromkeys(each.set for each in standings):
        of_set = [each for each in standings if each.set == name]
        with_place = np.array([each.with_place for each in of_set])
        without = np.array([each.without_place for each in of_set])
        places = [str(n) for n in range(len(of_set))]
        rows.append(
            (
                name,
                len(of_set),
                f"{np.mean([each.found for each in of_set]):.2f}",
                _auc(with_place, without, places),
                *(_share(_in(values, model), places) for values in (with_place, without)),
            )
        )
    header = ("set", "n", "first match right", "ROC AUC", "said to be in, with its place")
    print_table((*header, "said to be in, without"), rows)


def print_targets(tests: Sequence[Tested]) -> None:
    """How often a target is given, and how far it is from the middle of the wall it should be.

    As in results, only to photos that are said to be of the survey.
    """
    rows = []
    for name, answers, model in tests:
        own = _of_survey(answers)
        said_in = _said_in(own, model)
        given = [
            answer
            for answer, is_in in zip(own, said_in, strict=True)
            if is_in and answer.target_radius_m is not None
        ]
        known = [answer for answer in given if answer.target_error_m is not None]
        errors = np.array([answer.target_error_m for answer in known], dtype=np.float64)
        radii = np.array([answer.target_radius_m for answer in known], dtype=np.float64)
        groups = [answer.group for answer in known]
        measured = (
            (f"{np.median(errors):.1f}", f"{np.median(radii):.1f}", _share(errors <= radii, groups))
            if known
            else ("-", "-", "-")
        )
        rows.append((name, len(own), len(given), *measured))
    header = ("photos of", "n", "targets", "median error, m", "median radius, m")
    print_table((*header, "inside its radius"), rows)


def plot(path: Path, tests: Sequence[Tested], standings: Sequence[Standing]) -> None:
    """The reliability of the radii, and the ROC of confidence, side by side."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(9.0, 4.2), dpi=110)
    for colour, (name, answers, model) in zip(_COLOURS, tests, strict=False):
        own = _of_survey(answers)
        seen = [float(_inside(own, model, share).mean()) for share in _LEVELS]
        left.plot(_LEVELS, seen, "o-", ms=3, lw=1.2, color=colour, label=f"{name} ({len(own)})")
        strangers = _strangers(answers)
        _draw_roc(right, _prominences(own), _prominences(strangers), name, colour)
    for style, name in zip(_STYLES, dict.fromkeys(each.set for each in standings), strict=False):
        of_set = [each for each in standings if each.set == name]
        _draw_roc(
            right,
            np.array([each.with_place for each in of_set]),
            np.array([each.without_place for each in of_set]),
            f"{name}, place in or not",
            "#22272b",
            style,
        )
    _frame(left, "the radius is to hold", "it holds", "Reliability of the radii")
    left.fill_between([0.94, 0.96], 0.9, 0.99, color="#999999", alpha=0.4, lw=0)
    _frame(right, "photos of elsewhere taken for it", "photos of the survey found", "ROC")
    figure.tight_layout()
    figure.savefig(path, metadata={"Software": None})
    plt.close(figure)


def _frame(axes: Axes, x: str, y: str, title: str) -> None:
    axes.plot([0, 1], [0, 1], color="#999999", lw=0.8)
    axes.set(xlabel=x, ylabel=y, title=title, xlim=(0, 1), ylim=(0, 1.01))
    axes.legend(loc="lower right", fontsize=7, frameon=False)


def _draw_roc(
    axes: Axes,
    own: NDArray[np.float64],
    strangers: NDArray[np.float64],
    name: str,
    colour: str,
    style: str = "-",
) -> None:
    levels = np.concatenate([[np.inf], np.sort(np.concatenate([own, strangers]))[::-1]])
    found = [(own >= level).mean() for level in levels]
    taken = [(strangers >= level).mean() for level in levels]
    label = f"{name}: {_wins(own, strangers).mean():.3f}"
    axes.plot(taken, found, style, lw=1.2, color=colour, label=label)


def _of_survey(answers: Sequence[Placed]) -> list[Placed]:
    return [answer for answer in answers if answer.error_m is not None]


def _strangers(answers: Sequence[Placed]) -> list[Placed]:
    return [answer for answer in answers if answer.error_m is None]


def _by_set(answers: Sequence[Placed]) -> list[tuple[str, list[Placed]]]:
    names = dict.fromkeys(answer.set for answer in answers)
    return [(name, [answer for answer in answers if answer.set == name]) for name in names]


def _radii(answers: Sequence[Placed], model: PlacingModel, share: float) -> NDArray[np.float64]:
    return np.array([model.radius_m(share, one.evidence, one.distances_m) for one in answers])


def _inside(answers: Sequence[Placed], model: PlacingModel, share: float) -> NDArray[np.bool_]:
    errors = np.array([answer.error_m for answer in answers], dtype=np.float64)
    return np.asarray(errors <= _radii(answers, model, share))


def _prominences(answers: Sequence[Placed]) -> NDArray[np.float64]:
    return np.array([answer.evidence.prominence for answer in answers], dtype=np.float64)


def _said_in(answers: Sequence[Placed], model: PlacingModel) -> NDArray[np.bool_]:
    return _in(_prominences(answers), model)


def _in(prominences: NDArray[np.float64], model: PlacingModel) -> NDArray[np.bool_]:
    sure = [model.confidence(Evidence(float(each), 1.0)) or 0.0 for each in prominences]
    return np.array(sure) >= model.least_confidence


def _wins(own: NDArray[np.float64], strangers: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n_own,) share of the strangers that each stands above, ties by half; its mean is the AUC."""
    above = own[:, np.newaxis] > strangers
    return np.asarray(above.mean(axis=1) + (own[:, np.newaxis] == strangers).mean(axis=1) / 2.0)


def _auc(own: NDArray[np.float64], strangers: NDArray[np.float64], groups: Sequence[str]) -> str:
    return _interval(_wins(own, strangers), groups, 3)


def _share(are: NDArray[np.bool_], groups: Sequence[str]) -> str:
    return _interval(are.astype(np.float64), groups, 2)


def _interval(values: NDArray[np.float64], groups: Sequence[str], decimals: int) -> str:
    found = bootstrap_mean(values, groups)
    low, high = (f"{each:.{decimals}f}" for each in (found.low, found.high))
    return f"{found.mean:.{decimals}f} [{low}, {high}]"
