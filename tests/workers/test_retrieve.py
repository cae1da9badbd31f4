"""Who chooses the detectors and k, and what is said about it."""

from pathlib import Path

import pytest

from contracts.config import CodebookConfig, FeatureConfig, IndexConfig, SearchConfig
from index.models import read_model
from retrieval.choice import ChoiceModel, TrainingRow, TrainingSet, fit
from retrieval.complementarity import Complementarity
from workers.stages import retrieve
from workers.stages.retrieve import Photo, choose, read_photo


class _Index:
    """As much of an index as a choice looks at."""

    root = Path("nowhere")
    config = IndexConfig(
        features=FeatureConfig(detectors=("hesaff", "mser", "star"), max_frames=100),
        codebooks=CodebookConfig(max_words=10),
    )


@pytest.fixture
def photo(tmp_path: Path, small_survey: Path) -> Photo:
    return read_photo(_Index(), str(small_survey / "00.jpg"))


def a_model(photo: Photo, *, worth_using: bool) -> ChoiceModel:
    """Star pairs are the better the higher CSDi; queries look like the photo."""
    features = photo.complementarity(("hesaff", "mser", "star"))
    rows = [
        TrainingRow(
            f"q{n}",
            f"p{n}",
            pair,
            k,
            Complementarity(*(value * (0.5 + n / 4) for value in each.as_tuple())),
            0.9 if pair == ("mser", "star") and k == 5 else 0.2,
        )
        for n in range(5)
        for pair, each in features.items()
        for k in (2, 5, 10)
    ]
    model = fit(
        rows,
        detectors=("hesaff", "mser", "star"),
        descriptors=("sift", "surf", "sc"),
        vote="intersection",
        weights=("idf", "norm"),
        trained_on=(TrainingSet(set="made up", n_queries=5, n_places=5),),
    )
    fixed = model.left_out.adaptive - 0.1 if worth_using else model.left_out.adaptive
    scores = model.left_out.model_copy(update={"best_fixed": fixed})
    return model.model_copy(update={"left_out": scores})


def chosen_with(
    model: ChoiceModel | None,
    photo: Photo,
    search: SearchConfig,
    monkeypatch: pytest.MonkeyPatch,
) -> retrieve.Chosen:
    monkeypatch.setattr(retrieve, "read_model", lambda _: model)
    return choose(_Index(), photo, search)


def test_only_frames_that_are_asked_for_are_found(
    photo: Photo, monkeypatch: pytest.MonkeyPatch
) -> None:
    chosen_with(None, photo, SearchConfig(), monkeypatch)
    chosen_with(None, photo, SearchConfig(pair=("star", "mser"), k=2), monkeypatch)
    assert not photo.found
    assert len(photo.frames("star")) > 0
    assert set(photo.found) == {"star"}


def test_a_model_worth_using_chooses_and_predicts(
    photo: Photo, monkeypatch: pytest.MonkeyPatch
) -> None:
    model = a_model(photo, worth_using=True)
    chosen = chosen_with(model, photo, SearchConfig(), monkeypatch)
    assert (set(chosen.detectors), chosen.k) == ({"mser", "star"}, 5)
    assert chosen.predicted_map is not None
    assert chosen.choice.startswith("highest predicted")


@pytest.mark.parametrize(
    ("worth_using", "search", "says"),
    [
        (False, SearchConfig(), "no better than one pair"),
        (True, SearchConfig(vote="union"), "other descriptors, vote or weights"),
    ],
)
def test_otherwise_the_default_pair_is_used_and_says_why(
    photo: Photo,
    monkeypatch: pytest.MonkeyPatch,
    worth_using: bool,
    search: SearchConfig,
    says: str,
) -> None:
    model = a_model(photo, worth_using=worth_using)
    chosen = chosen_with(model, photo, search, monkeypatch)
    assert (chosen.detectors, chosen.k) == (("hesaff", "mser"), 2)
    assert chosen.choice.startswith("default: ")
    assert says in chosen.choice


def test_a_model_does_not_judge_detectors_that_it_was_trained_without(
    photo: Photo, monkeypatch: pytest.MonkeyPatch
) -> None:
    model = a_model(photo, worth_using=True)
    knows = model.model_copy(update={"detectors": ("hesaff", "mser")})
    chosen = chosen_with(knows, photo, SearchConfig(), monkeypatch)
    assert set(chosen.detectors) == {"hesaff", "mser"}
    given = chosen_with(knows, photo, SearchConfig(pair=("mser", "star")), monkeypatch)
    assert given.choice == "default: the model was trained without star"


def test_without_a_model_the_default_pair_is_used_and_says_so(
    photo: Photo, monkeypatch: pytest.MonkeyPatch
) -> None:
    chosen = chosen_with(None, photo, SearchConfig(), monkeypatch)
    assert chosen.choice == "default: no model"


def test_what_the_user_gave_is_used(photo: Photo, monkeypatch: pytest.MonkeyPatch) -> None:
    model = a_model(photo, worth_using=True)
    given = chosen_with(model, photo, SearchConfig(pair=("star", "hesaff"), k=7), monkeypatch)
    assert (given.detectors, given.k, given.choice) == (("star", "hesaff"), 7, "given")
    half = chosen_with(model, photo, SearchConfig(k=10), monkeypatch)
    assert half.k == 10


def test_the_shipped_model_holds_and_says_what_it_was_trained_on(tmp_path: Path) -> None:
    model = read_model(tmp_path)
    assert model is not None
    assert sum(each.n_queries for each in model.trained_on) == 144
    assert all("synthetic town" in each.set for each in model.trained_on)
