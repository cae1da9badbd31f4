"""From a ground truth on disk to judged rankings, through real workers."""

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from contracts.config import (
    CodebookConfig,
    Detector,
    FeatureConfig,
    IndexConfig,
    SearchConfig,
    Where,
)
from contracts.errors import BadTruth
from coordinator.cli.show import Bars
from coordinator.engine.running import Engine
from coordinator.export.stac_folder import write_stac
from coordinator.querying import Json, Rules, judge_queries, rehearse_queries, votes_file
from coordinator.removing import remove_images
from coordinator.truth import read_truth, truth_of_index
from index.opened import OpenedIndex
from index.votes import read_outcomes, read_votes
from retrieval.ways import Way

CONFIG = IndexConfig(
    features=FeatureConfig(detectors=("hesaff", "mser"), max_frames=200),
    codebooks=CodebookConfig(max_words=300),
)
SEARCH = SearchConfig(pair=("hesaff", "mser"), k=2)
ALL = [f"{number:02d}" for number in range(10)]


@pytest.fixture(scope="module")
def opened(indexed: Callable[[IndexConfig], OpenedIndex]) -> OpenedIndex:
    return indexed(CONFIG)


def write_truth(folder: Path, query: str, good: list[str], junk: list[str]) -> Path:
    """One Oxford query; `query` is the line of its query file."""
    folder.mkdir(exist_ok=True)
    contents = {"query": query, "good": "\n".join(good), "ok": "", "junk": "\n".join(junk)}
    for kind, content in contents.items():
        (folder / f"place_1_{kind}.txt").write_text(content)
    return folder


def judged(truth: Path, root: Path | None, opened: OpenedIndex, engine: Engine) -> Json:
    queries = read_truth(
        truth, root, opened.catalogue.column("uri"), opened.catalogue.column("path")
    )
    (answer,) = judge_queries(opened, queries, SEARCH, engine.follower, lambda: None)
    return answer


@pytest.fixture(scope="module")
def two_places(small_survey: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A photo of 3840 x 1440, stored upside down, whose left half is image 03, right half 07."""
    halves = [np.asarray(Image.open(small_survey / f"{name}.jpg")) for name in ("03", "07")]
    wide = Image.fromarray(np.hstack(halves)).resize((3840, 1440), Image.Resampling.BICUBIC)
    exif = Image.Exif()
    exif[0x0112] = 3  # orientation: turn by 180 degrees
    folder = tmp_path_factory.mktemp("photos")
    wide.rotate(180).save(folder / "both.jpg", exif=exif, quality=92)
    return folder


@pytest.mark.parametrize(("box", "found"), [("0 0 1920 1440", "03"), ("1920 0 3840 1440", "07")])
def test_only_the_box_of_the_upright_original_is_searched_for(
    tmp_path: Path, two_places: Path, opened: OpenedIndex, engine: Engine, box: str, found: str
) -> None:
    (other,) = {"03", "07"} - {found}
    right = write_truth(tmp_path / "right", f"both {box}", [found], [])
    wrong = write_truth(tmp_path / "wrong", f"both {box}", [other], [])
    assert judged(right, two_places, opened, engine)["first_hit_rank"] == 1
    assert judged(wrong, two_places, opened, engine)["first_hit_rank"] > 2


def test_a_box_around_the_whole_photo_hides_nothing(
    tmp_path: Path, two_places: Path, opened: OpenedIndex, engine: Engine
) -> None:
    truth = write_truth(tmp_path / "whole", "both 0 0 3840 1440", ["03", "07"], [])
    assert judged(truth, two_places, opened, engine)["ap"] == 1.0


def test_a_box_outside_the_photo_is_that_querys_error(
    tmp_path: Path, two_places: Path, opened: OpenedIndex, engine: Engine
) -> None:
    truth = write_truth(tmp_path / "outside", "both 3840 0 4000 1440", ["03"], [])
    queries = read_truth(truth, two_places, opened.catalogue.column("uri"))
    for answer in (
        judged(truth, two_places, opened, engine),
        *rehearse_queries(
            opened, queries, SEARCH, Rules.of(SEARCH), [2], engine.follower, lambda: None
        ),
    ):
        assert answer["query"] == "place_1"
        assert (
            "box 3840 0 4000 1440 holds no pixel of the photo, which is 3840 x 1440"
            in (answer["error"])
        )


def test_junk_and_the_query_itself_are_neither_right_nor_wrong(
    tmp_path: Path, opened: OpenedIndex, engine: Engine
) -> None:
    query = "oxc1_03 0 0 320 240"
    others = [name for name in ALL if name not in ("03", "08")]
    all_junk = write_truth(tmp_path / "junk", query, ["03", "08"], others)
    answer = judged(all_junk, None, opened, engine)
    assert (answer["ap"], answer["first_hit_rank"], answer["n_relevant"]) == (1.0, 1, 1)
    itself = write_truth(tmp_path / "itself", query, ["03"], [])
    assert judged(itself, None, opened, engine) == {"query": "place_1", "excluded": True}


def test_a_copy_of_an_indexed_image_does_not_find_itself(
    tmp_path: Path, small_survey: Path, opened: OpenedIndex, engine: Engine
) -> None:
    (tmp_path / "copy.jpg").write_bytes((small_survey / "03.jpg").read_bytes())
    truth = tmp_path / "truth.json"
    truth.write_text('{"copy.jpg": ["03.jpg"]}')
    assert judged(truth, None, opened, engine) == {"query": "copy.jpg", "excluded": True}


def test_images_are_found_by_the_digest_of_their_file(opened: OpenedIndex) -> None:
    digests = opened.catalogue.column("sha256")
    assert [opened.images_of_file(digest) for digest in digests] == [(n,) for n in range(10)]
    assert opened.images_of_file("f" * 64) == ()


def test_rehearsing_answers_every_way_as_a_search_of_its_own_does(
    tmp_path: Path, small_survey: Path, opened: OpenedIndex, engine: Engine
) -> None:
    truth = tmp_path / "truth.json"
    photo = np.asarray(Image.open(small_survey / "03.jpg"))
    Image.fromarray(photo[:150, :200]).save(tmp_path / "part.png")
    truth.write_text('{"part.png": ["03.jpg", "08.jpg"]}')
    queries = read_truth(truth, None, opened.catalogue.column("uri"))
    rules = Rules(("pairwise", "union"), (("idf", "norm"), ("idf",), ()))
    (answer,) = rehearse_queries(
        opened, queries, SEARCH, rules, [2, 5], engine.follower, lambda: None, tmp_path / "kept"
    )
    kept = votes_file(tmp_path / "kept", 0)
    groups: tuple[tuple[Detector, ...], ...] = (("mser",), ("hesaff", "mser"))
    answered = {each.way: each.scored for each in read_outcomes(kept)}
    assert len(answered) == len(read_outcomes(kept))
    for vote, weights, pair, k in product(rules.votes, rules.weightings, groups, (2, 5)):
        search = SearchConfig.of(pair=pair, k=k, vote=vote, weights=weights)
        (alone,) = judge_queries(opened, queries, search, engine.follower, lambda: None)
        way = Way("single" if len(pair) == 1 else "fii", vote, weights, pair, k)
        assert answered[way].ap == pytest.approx(alone["ap"])
        assert answered[way].first_hit_rank == alone["first_hit_rank"]
    own = [Way("fii", SEARCH.vote, SEARCH.weights, ("hesaff", "mser"), k) for k in (2, 5)]
    assert [tuple(row[:3]) for row in answer["features"]] == [("hesaff", "mser", k) for k in (2, 5)]
    assert answer["together"] == [[answered[own[0]].ap, None], [None, answered[own[1]].ap]]
    votes = read_votes(kept, ("hesaff", "mser"), (2, 5))
    assert all(len(scores.values) == 10 and scores.touched.any() for scores in votes.values())


def test_rehearsing_for_training_leaves_nothing_on_disk(
    tmp_path: Path, small_survey: Path, opened: OpenedIndex, engine: Engine
) -> None:
    truth = tmp_path / "truth.json"
    photo = np.asarray(Image.open(small_survey / "03.jpg"))
    Image.fromarray(photo[:150, :200]).save(tmp_path / "part.png")
    truth.write_text('{"part.png": ["03.jpg"]}')
    queries = read_truth(truth, None, opened.catalogue.column("uri"))
    before = sorted(opened.root.rglob("*"))
    (answer,) = rehearse_queries(
        opened, queries, SEARCH, Rules.of(SEARCH), [2], engine.follower, lambda: None
    )
    (alone,) = judge_queries(opened, queries, SEARCH, engine.follower, lambda: None)
    assert answer["together"] == [[pytest.approx(alone["ap"])]]
    assert sorted(opened.root.rglob("*")) == before


@pytest.fixture(scope="module")
def without_05(opened: OpenedIndex, tmp_path_factory: pytest.TempPathFactory) -> OpenedIndex:
    """The same index after image 05 was removed."""
    root = tmp_path_factory.mktemp("removed") / "index"
    shutil.copytree(opened.root, root)
    remove_images(root, Where(), ["05.jpg"], [], Bars(None))
    return OpenedIndex(root)


def test_a_removed_image_is_in_no_truth(tmp_path: Path, without_05: OpenedIndex) -> None:
    truth = tmp_path / "truth.json"
    truth.write_text('{"part.png": ["05.jpg"]}')
    with pytest.raises(BadTruth, match=r"names 05\.jpg, which is no image of the index"):
        truth_of_index(without_05, truth, None)
    assert without_05.images_of_file(without_05.catalogue.column("sha256")[5]) == ()


def test_a_removed_image_is_no_item_of_an_export(tmp_path: Path, without_05: OpenedIndex) -> None:
    write_stac(without_05, tmp_path / "stac", lambda: None)
    items = [json.loads(path.read_bytes()) for path in (tmp_path / "stac").glob("*/*.json")]
    titles = [each["properties"]["title"] for each in items if each["type"] == "Feature"]
    assert sorted(titles) == [f"{name}.jpg" for name in ALL if name != "05"]


def test_a_removed_image_is_in_no_ranking_and_the_others_keep_their_ids(
    tmp_path: Path, small_survey: Path, without_05: OpenedIndex, engine: Engine
) -> None:
    photo = np.asarray(Image.open(small_survey / "05.jpg"))
    Image.fromarray(photo[:150, :200]).save(tmp_path / "part.png")
    truth = tmp_path / "truth.json"
    others = [f"{name}.jpg" for name in ALL if name != "05"]
    truth.write_text(json.dumps({"part.png": others}))
    (query,) = truth_of_index(without_05, truth, None)
    assert query.relevant == (0, 1, 2, 3, 4, 6, 7, 8, 9)
    (judged,) = judge_queries(without_05, [query], SEARCH, engine.follower, lambda: None)
    assert sorted(each["image_id"] for each in judged["top"]) == list(query.relevant)
    assert judged["ap"] == pytest.approx(1.0)
    ranked = [each["image_id"] for each in judged["top"]]
    last = replace(query, relevant=(ranked[-1],), junk=(ranked[0], ranked[4]))
    for each in (query, last):
        (alone,) = judge_queries(without_05, [each], SEARCH, engine.follower, lambda: None)
        (answer,) = rehearse_queries(
            without_05, [each], SEARCH, Rules.of(SEARCH), [2], engine.follower, lambda: None
        )
        assert answer["together"] == [[pytest.approx(alone["ap"])]]
        assert alone["first_hit_rank"] == (1 if each is query else 7)
        assert (answer["relevant"], answer["junk"]) == ([*each.relevant], sorted(each.junk))
