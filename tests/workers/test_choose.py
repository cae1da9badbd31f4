"""Who chooses the detectors and k, and what is said about it: by a real index and its model."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import pytest
from made_choices import NAMES, SEARCH, SECOND, WINNER, of_six, trained

from contracts.config import (
    DETECTORS,
    Detector,
    FeatureConfig,
    IndexConfig,
    SearchConfig,
    VariantName,
)
from index import models
from index.models import model_path, read_model, write_model
from index.opened import OpenedIndex
from retrieval.candidates import Candidate, FirstLook, candidate_features
from retrieval.choice import ChoiceModel
from retrieval.score_curves import agreement
from workers.stages.choose import DEFAULT_K, DEFAULT_PAIR, choose, default_pair
from workers.stages.retrieve import (
    Chosen,
    Photo,
    densities,
    detector_votes,
    read_photo,
    search_photo,
    sizes_of,
    words_of,
)

Asked = Callable[[ChoiceModel | None, SearchConfig], Chosen]


@dataclass(frozen=True, slots=True)
class Described:
    """An index of which only its place and its settings are known."""

    root: Path
    config: IndexConfig


@pytest.fixture
def photo(small_index: OpenedIndex, small_survey: Path) -> Photo:
    return read_photo(small_index, str(small_survey / "03.jpg"))


@pytest.fixture
def asked(
    small_index: OpenedIndex, photo: Photo, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Asked]:
    """Choose by an index that has the model given, or by one that has none."""

    def chosen(model: ChoiceModel | None, search: SearchConfig) -> Chosen:
        if model is not None:
            write_model(small_index.root, model)
        return choose(small_index, photo, search)

    monkeypatch.setattr(models, "_SHIPPED", "no such model.json")
    yield chosen
    model_path(small_index.root).unlink(missing_ok=True)


@pytest.fixture(scope="module")
def known(small_index: OpenedIndex, small_survey: Path) -> dict[Candidate, tuple[float, ...]]:
    """All features of every pair and k for photo 03."""
    read = read_photo(small_index, str(small_survey / "03.jpg"))
    words = words_of(small_index, read, NAMES, 5, SEARCH)
    votes = detector_votes(small_index, words, (2, 5), SEARCH)
    return candidate_features(
        read.complementarity(NAMES),
        densities(small_index, NAMES, SEARCH),
        (2, 5),
        FirstLook(votes, sizes_of(small_index, NAMES, SEARCH)),
    )


def test_what_the_user_gave_is_used_and_no_frame_is_looked_for(
    asked: Asked, known: dict[Candidate, tuple[float, ...]], photo: Photo
) -> None:
    search = SearchConfig(pair=("star", "hesaff"), k=7)
    given = asked(trained(known, "gain"), search)
    assert given == Chosen((("star", "hesaff"),), 7, None, "given")
    assert not photo.found


@pytest.mark.parametrize("group", [("star",), ("star", "hesaff", "mser")])
def test_a_model_chooses_no_k_for_other_than_two_detectors(
    asked: Asked, known: dict[Candidate, tuple[float, ...]], group: tuple[Detector, ...]
) -> None:
    chosen = asked(trained(known, "gain"), SearchConfig(pair=group))
    assert (chosen.groups, chosen.k) == ((group,), DEFAULT_K)
    assert chosen.choice == "given; k by default: models choose for pairs"


def test_without_a_model_the_default_is_used_and_says_so(asked: Asked, photo: Photo) -> None:
    assert asked(None, SEARCH) == Chosen((NAMES[:2],), DEFAULT_K, None, "default: no model")
    assert asked(None, SearchConfig(k=9)).k == 9
    half = asked(None, SearchConfig(pair=("star", "mser")))
    assert half == Chosen((("star", "mser"),), DEFAULT_K, None, "default: no model")
    assert not photo.found


def test_the_default_pair_is_taken_where_it_was_indexed(small_index: OpenedIndex) -> None:
    assert default_pair(Described(small_index.root, IndexConfig())) == DEFAULT_PAIR
    for names in (("orb", "hesaff", "star"), ("orb",)):
        few = IndexConfig(features=FeatureConfig(detectors=names))
        assert default_pair(Described(small_index.root, few)) == names[:2]


@pytest.mark.parametrize("variant", ["gain", "crowding", "look", "fixed"])
def test_the_model_of_the_index_chooses(
    asked: Asked, known: dict[Candidate, tuple[float, ...]], variant: VariantName
) -> None:
    chosen = asked(trained(known, variant), SEARCH)
    assert (chosen.groups[0], chosen.k) == WINNER
    assert chosen.predicted_map == pytest.approx(0.9, abs=0.1)
    assert chosen.choice.startswith("best for all" if variant == "fixed" else "highest predicted")


def test_what_is_best_for_all_is_known_without_looking_at_the_photo(
    asked: Asked, known: dict[Candidate, tuple[float, ...]], photo: Photo
) -> None:
    chosen = asked(trained(known, "fixed"), SEARCH)
    assert chosen == Chosen((WINNER[0],), WINNER[1], 0.9, "best for all in training")
    assert not photo.found


def test_of_two_joined_both_pairs_are_searched_with(
    asked: Asked, known: dict[Candidate, tuple[float, ...]]
) -> None:
    model = trained(known, "gain").model_copy(update={"n_joined": 2})
    chosen = asked(model, SearchConfig(k=2))
    assert chosen.k == 2
    assert len(chosen.groups) == 2
    assert chosen.groups[0] == SECOND[0]
    alone = asked(model, SearchConfig(pair=("star", "mser")))
    assert alone.groups == (("mser", "star"),)


@pytest.mark.parametrize("variant", ["gain", "fixed"])
def test_k_alone_may_be_given(
    asked: Asked, known: dict[Candidate, tuple[float, ...]], variant: VariantName
) -> None:
    chosen = asked(trained(known, variant), SearchConfig(k=2))
    assert (chosen.groups, chosen.k) == ((SECOND[0],), 2)
    # No pair was tried with 4: the best with 5 is taken.
    nearest = asked(trained(known, variant), SearchConfig(k=5))
    assert asked(trained(known, variant), SearchConfig(k=4)).groups == nearest.groups
    other = asked(trained(known, variant), SearchConfig(k=4))
    assert (other.k, other.predicted_map) == (4, None)
    assert other.choice.endswith(" with k = 5")


@pytest.mark.parametrize("pair", [("hesaff", "star"), ("star", "hesaff")])
@pytest.mark.parametrize("variant", ["gain", "fixed"])
def test_a_pair_alone_may_be_given_in_either_order(
    asked: Asked,
    known: dict[Candidate, tuple[float, ...]],
    variant: VariantName,
    pair: tuple[Detector, ...],
) -> None:
    chosen = asked(trained(known, variant), SearchConfig(pair=pair))
    assert (chosen.groups, chosen.k) == ((SECOND[0],), 2)


@pytest.mark.parametrize(
    "search",
    [
        SearchConfig(vote="union"),
        SearchConfig(weights=("idf",)),
        SearchConfig(weights=("idf", "norm", "burst")),
        SearchConfig(descriptors=("sift", "surf")),
        SearchConfig(descriptors=("sift",), vote="intersection"),
        SearchConfig(distance_scale="percentile"),
        SearchConfig(vote="union", max_images=5),
    ],
)
def test_a_search_that_the_model_was_not_trained_for_takes_the_default(
    asked: Asked, known: dict[Candidate, tuple[float, ...]], search: SearchConfig
) -> None:
    chosen = asked(trained(known, "gain"), search)
    assert (chosen.groups, chosen.k, chosen.predicted_map) == ((NAMES[:2],), DEFAULT_K, None)
    assert chosen.choice.startswith("default: the model was trained with other descriptors")


def test_the_order_of_weights_and_the_number_of_answers_do_not_matter(
    asked: Asked, known: dict[Candidate, tuple[float, ...]]
) -> None:
    search = SearchConfig(weights=("norm", "idf"), top=3, descriptors=("sift", "surf", "sc"))
    assert (asked(trained(known, "gain"), search).groups[0]) == WINNER[0]


def test_a_model_does_not_judge_detectors_that_it_was_trained_without(
    asked: Asked, known: dict[Candidate, tuple[float, ...]]
) -> None:
    few = {each: row for each, row in known.items() if each[0] == ("hesaff", "mser")}
    model = trained(few, "fixed", ("hesaff", "mser"))
    assert asked(model, SEARCH).groups == (("hesaff", "mser"),)
    given = asked(model, SearchConfig(pair=("mser", "star")))
    assert given.groups == (("mser", "star"),)
    assert given.choice == "default: the model was trained without star"


@pytest.mark.parametrize("variant", ["fixed", "gain"])
def test_of_a_model_of_more_detectors_what_the_index_has_is_taken_as_best_for_all(
    asked: Asked, known: dict[Candidate, tuple[float, ...]], variant: VariantName
) -> None:
    chosen = asked(of_six(known, variant), SEARCH)
    assert (chosen.groups, chosen.k) == ((WINNER[0],), WINNER[1])
    says = "" if variant == "fixed" else ": the model also wants har"
    assert chosen.choice == f"best for all in training{says}"


def test_a_model_of_other_detectors_chooses_nothing(
    small_index: OpenedIndex, photo: Photo, asked: Asked, known: dict[Candidate, tuple[float, ...]]
) -> None:
    asked(trained(known, "gain"), SEARCH)
    config = IndexConfig(features=FeatureConfig(detectors=("orb", "har", "star")))
    chosen = choose(Described(small_index.root, config), photo, SEARCH)
    assert chosen.groups == (("orb", "har"),)
    assert chosen.choice.startswith("default: the model chooses pairs")


def test_where_the_index_cannot_be_asked_the_best_for_all_is_taken(
    small_index: OpenedIndex, photo: Photo, asked: Asked, known: dict[Candidate, tuple[float, ...]]
) -> None:
    asked(trained(known, "look"), SEARCH)
    chosen = choose(Described(small_index.root, small_index.config), photo, SEARCH)
    assert (chosen.groups[0], chosen.k) == WINNER
    assert chosen.choice == "best for all in training: the model also asks the index"


def test_a_model_that_looks_searches_with_every_pair_first(
    small_index: OpenedIndex, photo: Photo, asked: Asked, known: dict[Candidate, tuple[float, ...]]
) -> None:
    model = trained(known, "look")
    agreeing = tuple(
        each.model_copy(update={"value": float(each.term == "consensus")})
        for each in model.coefficients
    )
    chosen = asked(model.model_copy(update={"coefficients": agreeing}), SEARCH)
    found = {}
    for k in (2, 5):
        whole = search_photo(small_index, photo, Chosen((NAMES,), k, None, ""), SEARCH)
        for pair in combinations(NAMES, 2):
            own = search_photo(small_index, photo, Chosen((pair,), k, None, ""), SEARCH)
            found[pair, k] = agreement(own, whole)
    assert len(set(found.values())) > 1
    best = max(found, key=lambda each: found[each])
    assert (chosen.groups[0], chosen.k) == best
    mean = sum(found.values()) / len(found)
    assert chosen.predicted_map == pytest.approx(model.level + found[best] - mean)


def test_a_photo_unlike_the_training_falls_back_and_says_why(
    asked: Asked, known: dict[Candidate, tuple[float, ...]]
) -> None:
    model = trained(known, "eq1")
    narrow = tuple(
        each.model_copy(update={"high": 1e-3}) if each.term == "CSDi" else each
        for each in model.ranges
    )
    chosen = asked(model.model_copy(update={"ranges": narrow}), SEARCH)
    assert (chosen.groups[0], chosen.k) == WINNER
    assert chosen.choice.startswith("fallback to what was best for all: CSDi was")


def test_the_shipped_model_holds_and_chooses_among_all_detectors(tmp_path: Path) -> None:
    model = read_model(tmp_path)
    assert model is not None
    assert model == read_model(None)
    assert set(model.detectors) <= set(DETECTORS)
    assert ChoiceModel.from_json(model.to_json()) == model
    assert (model.vote, set(model.weights)) == (SEARCH.vote, set(SEARCH.weights))
    assert model.index_digest is None
