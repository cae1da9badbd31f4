"""The fit and the tables of how sure estimates are, on photos made up with a known truth."""

import math
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest
from sklearn.metrics import roc_auc_score

from benchmarks.placing import report
from benchmarks.placing.answers import Placed, Standing
from benchmarks.placing.fit import FALSE_ALARMS, fit_placing
from geo.confidence import Evidence
from index.models import placing_model

N_PHOTOS = 3000
STREET_M = tuple(np.linspace(0.0, 300.0, 61).tolist())


def photos(seed: int) -> list[Placed]:
    """Half of the survey and half strangers; right ones are nearer, lost ones are anywhere."""
    rng = np.random.default_rng(seed)
    found = []
    for number in range(N_PHOTOS):
        stranger = number % 2 == 1
        prominence = float(rng.normal(1.0, 0.15) if stranger else rng.normal(1.6, 0.3))
        share = float(rng.uniform())
        right = rng.uniform() < 1.0 / (1.0 + math.exp(4.0 - 10.0 * share))
        near_m = float(min(rng.rayleigh(5.0) * math.exp(-0.5 * (prominence - 1.0)), 25.0))
        error_m = near_m if right else float(rng.choice(STREET_M[6:]))
        found.append(
            Placed(
                index=f"town {seed}",
                set="elsewhere" if stranger else f"town {seed}",
                group=str(number // 4),
                evidence=Evidence(prominence, share),
                distances_m=STREET_M,
                error_m=None if stranger else error_m,
                target_radius_m=None,
                target_error_m=None,
            )
        )
    return found


@pytest.fixture(scope="module")
def tested() -> list[report.Tested]:
    """Photos that the model was not fitted to."""
    return [("town 1", photos(1), fit_placing(photos(0)))]


@pytest.mark.parametrize("share", [0.68, 0.95])
def test_radii_hold_their_share_of_photos_that_were_not_fitted(
    tested: list[report.Tested], share: float
) -> None:
    ((_, answers, model),) = tested
    own = [answer for answer in answers if answer.error_m is not None]
    inside = [
        answer.error_m <= model.radius_m(share, answer.evidence, answer.distances_m)
        for answer in own
        if answer.error_m is not None
    ]
    assert np.mean(inside) == pytest.approx(share, abs=0.04)


def test_one_stranger_in_ten_is_said_to_be_of_the_survey(tested: list[report.Tested]) -> None:
    ((_, answers, model),) = tested
    said_in = [
        model.certainty(answer.evidence, answer.distances_m).in_survey
        for answer in answers
        if answer.error_m is None
    ]
    assert np.mean(said_in) == pytest.approx(FALSE_ALARMS, abs=0.03)


def test_the_tables_say_what_is_counted_by_hand(
    tested: list[report.Tested], capsys: pytest.CaptureFixture[str]
) -> None:
    ((name, answers, model),) = tested
    some = answers[:40]
    own = [each for each in some if each.error_m is not None]
    inside = [
        each.error_m <= model.radius_m(0.95, each.evidence, STREET_M)
        for each in own
        if each.error_m is not None
    ]
    area = roc_auc_score(
        [each.error_m is not None for each in some], [each.evidence.prominence for each in some]
    )
    report.print_coverage([(name, some, model)])
    assert f"| {np.mean(inside):.2f} [" in capsys.readouterr().out.splitlines()[2]
    report.print_telling_apart([(name, some, model)])
    assert f"| {area:.3f} [" in capsys.readouterr().out.splitlines()[2]


def test_ties_count_half_in_the_area_under_the_curve(capsys: pytest.CaptureFixture[str]) -> None:
    with_place, without = [1.0, 1.5, 1.5, 2.0], [1.0, 1.0, 1.5, 0.5]
    standings = [Standing("set", True, *each) for each in zip(with_place, without, strict=True)]
    area = roc_auc_score([1] * 4 + [0] * 4, with_place + without)
    report.print_with_and_without(standings, fit_placing(photos(0)))
    assert f"| {area:.3f} [" in capsys.readouterr().out


def test_reliability_and_roc_are_drawn_for_every_test(
    tested: list[report.Tested], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(plt, "close", lambda figure: None)
    report.plot(tmp_path / "plot.png", tested, [Standing("real", True, 2.0, 1.0)])
    figure = plt.gcf()
    monkeypatch.undo()
    reliability, roc = figure.axes
    plt.close(figure)
    assert (tmp_path / "plot.png").read_bytes().startswith(b"\x89PNG")
    (held,) = (line for line in reliability.lines if line.get_label().startswith("town 1"))
    levels, seen = held.get_data()
    np.testing.assert_allclose(seen, levels, atol=0.04)
    assert [line.get_label().split(":")[0] for line in roc.lines[:2]] == [
        "town 1",
        "real, place in or not",
    ]


def test_the_shipped_model_was_fitted_to_synthetic_surveys_only() -> None:
    names = [trained.set for trained in placing_model().trained_on]
    assert len(names) >= 3
    assert all(name.startswith("synthetic town ") for name in names)
