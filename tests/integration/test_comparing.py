"""Training and the paper's tables, from photos to files, through real workers."""

import csv
import json
from collections.abc import Callable
from pathlib import Path

import flaneur_command
import numpy as np
import pytest
from PIL import Image

from contracts.config import CodebookConfig, FeatureConfig, IndexConfig, SearchConfig
from contracts.errors import WrongInput
from coordinator.cli.show import Bars
from coordinator.comparing.report import check_comparable, compare
from coordinator.engine.running import Engine
from coordinator.querying import WEIGHTINGS, Rules, judge_queries
from coordinator.truth import JudgedQuery, read_truth
from index.opened import OpenedIndex
from retrieval.choice import ChoiceModel

CONFIG = IndexConfig(
    features=FeatureConfig(detectors=("hesaff", "mser", "star"), max_frames=150),
    codebooks=CodebookConfig(max_words=200),
)
N_QUERIES = 5


@pytest.fixture(scope="module")
def opened(indexed: Callable[[IndexConfig], OpenedIndex]) -> OpenedIndex:
    return indexed(CONFIG)


@pytest.fixture(scope="module")
def truth(small_survey: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Noisy parts of five images; the image and the one after it are relevant."""
    folder = tmp_path_factory.mktemp("queries")
    rng = np.random.default_rng(0)
    relevant = {}
    for number in range(N_QUERIES):
        photo = np.asarray(Image.open(small_survey / f"{2 * number:02d}.jpg"), dtype=np.float64)
        part = photo[20:200, 30:260] + rng.normal(0, 25, (180, 230, 3))
        Image.fromarray(part.clip(0, 255).astype(np.uint8)).save(folder / f"q{number}.png")
        relevant[f"q{number}.png"] = [f"{2 * number:02d}.jpg", f"{2 * number + 1:02d}.jpg"]
    (folder / "ground_truth.json").write_text(json.dumps(relevant))
    return folder / "ground_truth.json"


@pytest.fixture(scope="module")
def queries(truth: Path, opened: OpenedIndex) -> list[JudgedQuery]:
    return read_truth(truth, None, opened.catalogue.column("uri"))


@pytest.fixture(scope="module")
def report(
    opened: OpenedIndex,
    queries: list[JudgedQuery],
    engine: Engine,
    tmp_path_factory: pytest.TempPathFactory,
) -> Path:
    out = tmp_path_factory.mktemp("report")
    compare(opened, queries, SearchConfig(), "parts", out, engine.follower, Bars(None))
    return out


def rows(report: Path, name: str) -> list[dict[str, str]]:
    with (report / f"{name}.csv").open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_tables_and_figures_are_written_and_votes_are_not_left_behind(
    report: Path, opened: OpenedIndex
) -> None:
    text = (report / "tables.md").read_text(encoding="utf-8")
    for title in ("Table I", "Table II", "Table III", "Table IV", "controls", "Rules of fusion"):
        assert title in text
    tables = [f"table-{number}" for number in (1, 2, 3, 4)]
    for name in (*tables, "controls", "sets", "differences", "figure-2"):
        assert (report / f"{name}.png").read_bytes().startswith(b"\x89PNG")
    assert not list((opened.root / "rehearsals").iterdir())


@pytest.mark.parametrize("pair", [("hesaff", "mser"), ("mser", "star")])
def test_a_pair_measures_what_evaluating_it_alone_measures(
    report: Path,
    opened: OpenedIndex,
    queries: list[JudgedQuery],
    engine: Engine,
    pair: tuple[str, str],
) -> None:
    search = SearchConfig.of(pair=pair, k=2)
    answers = judge_queries(opened, queries, search, engine.follower, lambda: None)
    (row,) = [row for row in rows(report, "table-1") if row["pair"] == "-".join(pair)]
    mean = np.mean([answer["ap"] for answer in answers])
    assert float(row["measured mAP"]) == pytest.approx(mean)


def test_controls_bound_every_choice(report: Path) -> None:
    means = {row["choice"]: float(row["mAP"]) for row in rows(report, "controls")}
    assert means["oracle pair and k"] >= means["random pair and k"]
    assert means["fixed"] == means["best fixed pair and k"]
    for name in ("eq1", "kp_only", "gain", "look", "boosted"):
        assert means[name] <= means["oracle pair and k"] + 1e-12
    (fixed,) = [row for row in rows(report, "controls") if row["choice"] == "fixed"]
    assert float(fixed["gain over best fixed"]) == 0


def test_queries_of_one_place_cannot_be_compared(
    opened: OpenedIndex, queries: list[JudgedQuery], engine: Engine, tmp_path: Path
) -> None:
    with pytest.raises(WrongInput, match="at least 2 places"):
        compare(opened, queries[:1], SearchConfig(), "one", tmp_path, engine.follower, Bars(None))
    assert not list((opened.root / "rehearsals").iterdir())


def test_training_writes_a_model_that_says_what_it_is_made_of(
    opened: OpenedIndex, truth: Path, tmp_path: Path, engine: Engine
) -> None:
    out = tmp_path / "choice.json"
    command = ("train", "--index", opened.root, "--truth", truth, "--variant", "gain")
    done = flaneur_command.run(*command, "--out", out, "--broker", engine.app.conf.broker_url)
    assert done.returncode == 0, done.stderr
    model = ChoiceModel.from_json(out.read_text(encoding="utf-8"))
    assert model.variant == "gain"
    assert model.index_digest == opened.generation.digest()
    assert [(one.n_queries, one.n_places) for one in model.trained_on] == [(N_QUERIES, N_QUERIES)]
    assert {each.k for each in model.fixed} == {2, 5, 10}
    assert model.detectors == ("hesaff", "mser", "star")
    assert all(each.low <= each.value <= each.high for each in model.coefficients)


def test_an_unknown_variant_is_refused_by_name_before_the_work(
    opened: OpenedIndex, truth: Path
) -> None:
    command = ("train", "--index", opened.root, "--truth", truth, "--variant", "magic")
    done = flaneur_command.run(*command, "--broker", "redis://127.0.0.1:9")  # nobody is there
    assert done.returncode == 2
    assert "--variant takes auto or one of fixed, eq1," in done.stderr


def test_the_searchs_own_weights_are_among_the_rules_that_are_compared() -> None:
    assert Rules.all_for(3, SearchConfig(weights=("burst",))).weightings[-1] == ("burst",)
    assert Rules.all_for(3, SearchConfig()).weightings == WEIGHTINGS
    assert "pairwise" not in Rules.all_for(1, SearchConfig()).votes


def test_what_cannot_be_compared_is_refused_before_the_work(
    opened: OpenedIndex, queries: list[JudgedQuery], truth: Path, tmp_path: Path
) -> None:
    with pytest.raises(WrongInput, match="at least 2 places"):
        check_comparable(opened, queries[:1])
    check_comparable(opened, queries)
    one = tmp_path / "one.json"
    one.write_text('{"q0.png": ["00.jpg"]}')
    command = ("evaluate", "--index", opened.root, "--truth", one, "--root", truth.parent)
    done = flaneur_command.run(*command, "--tables", "--out", tmp_path / "report")
    assert done.returncode == 2
    assert "at least 2 places" in done.stderr
    assert not (tmp_path / "report").exists()
