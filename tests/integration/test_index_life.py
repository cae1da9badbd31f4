"""An index that lives: added to, removed from and compacted, through a real engine.

What it is judged by is an index of the same images made in one go with the same words.
"""

import shutil
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from living_index import BARS, CHANNELS, CONFIG, DEGREES, LAMBERT_93, REMOVED, Life, contents

from contracts.config import SearchConfig
from coordinator.engine.running import Engine
from coordinator.indexing import run_job
from coordinator.intake import Intake, read_surveys
from coordinator.plan import make_plan
from coordinator.querying import locate_photos
from index.codebooks import words_of_generation
from index.manifest import read_generation
from index.opened import OpenedIndex


@pytest.fixture(scope="module")
def at_once(
    life: Life,
    small_survey: Path,
    other_survey: Path,
    tmp_path_factory: pytest.TempPathFactory,
    engine: Engine,
) -> dict[str, OpenedIndex]:
    """All images, and those not removed, indexed in one go with the words of `life`."""
    made = {}
    for name, excluded in (("all", ()), ("left", REMOVED)):
        root = tmp_path_factory.mktemp("once") / "index"
        intake = joined(
            read_surveys([("", small_survey)], replace(LAMBERT_93, exclude=excluded)),
            read_surveys([("b", other_survey)], replace(DEGREES, exclude=excluded), "EPSG:2154"),
        )
        words = words_of_generation(life.root, read_generation(life.root))
        job, plan = make_plan(root, intake, CONFIG, 32, words)
        shutil.copytree(life.root / "codebooks", root / "codebooks")
        run_job(job, plan, intake, nullcontext(engine), BARS)
        made[name] = OpenedIndex(root)
    return made


def joined(first: Intake, second: Intake) -> Intake:
    """Two surveys whose uris follow each other."""
    return replace(
        first,
        surveys=first.surveys + second.surveys,
        images=first.images + second.images,
        survey_names=first.survey_names + second.survey_names,
    )


def ranking(index: OpenedIndex, photo: Path, engine: Engine) -> list[tuple[str, float]]:
    search = SearchConfig(pair=("hesaff",), k=2, top=100)
    (answer,) = locate_photos(index, [str(photo)], search, engine.follower, lambda: None)
    assert answer.error is None
    matches = [feature["properties"] for feature in answer.of_kind("match")]
    return sorted((each["image"], each["score"]) for each in matches)


def test_only_images_that_are_not_there_are_extracted(life: Life) -> None:
    assert life.whole.images_extracted == 6
    assert life.more.images_extracted == 4
    assert life.other.images_extracted == 5
    assert [segment.n_images for segment in life.other.generation.segments] == [6, 4, 5]
    uris = life.opened(3).catalogue.column("uri")
    assert uris == [f"{n:02d}.jpg" for n in range(10)] + [f"b/{n}.jpg" for n in range(5)]


def test_words_are_not_trained_again(life: Life) -> None:
    generation = read_generation(life.root)
    assert generation.codebooks == life.whole.generation.codebooks == "0001"
    assert [path.name for path in (life.root / "codebooks").iterdir()] == ["0001"]


def test_a_survey_in_another_system_is_brought_into_that_of_the_index(
    life: Life, at_once: dict[str, OpenedIndex]
) -> None:
    assert read_generation(life.root, 3).crs == "EPSG:2154"
    rows = life.opened(3).catalogue.rows(range(10, 15))
    assert all(651000 < (row.easting or 0) < 653000 for row in rows)
    assert read_generation(life.root, 3).area == at_once["all"].generation.area


@pytest.mark.parametrize(("number", "name"), [(3, "all"), (4, "left"), (5, "left")])
def test_idf_and_norms_are_those_of_an_index_made_in_one_go(
    life: Life, at_once: dict[str, OpenedIndex], number: int, name: str
) -> None:
    lived, once = life.opened(number), at_once[name]
    assert lived.n_live == once.n_images
    kept = np.ones(lived.n_images, bool) if lived.kept is None else lived.kept
    uris = [str(lived.catalogue.column("uri")[row]) for row in np.flatnonzero(kept)]
    order = sorted(range(len(uris)), key=lambda row: uris[row].encode())
    words = lived.distinct_words(CHANNELS)[kept][order]
    np.testing.assert_array_equal(words, once.distinct_words(CHANNELS))
    for channel in CHANNELS:
        np.testing.assert_array_equal(lived.idf(channel), once.idf(channel))
        np.testing.assert_array_equal(
            lived.document_frequency(channel), once.document_frequency(channel)
        )
    assert lived.density(CHANNELS) == once.density(CHANNELS)


def test_a_compacted_index_is_the_same_bytes_as_one_made_in_one_go(
    life: Life, at_once: dict[str, OpenedIndex]
) -> None:
    assert contents(life.opened(5)) == contents(at_once["left"])
    lived, once = read_generation(life.root, 5), at_once["left"].generation
    assert lived.area == once.area
    assert lived.n_postings == once.n_postings
    assert [(each.name, each.n_images) for each in lived.surveys] == [("", 8), ("b", 4)]


@pytest.mark.parametrize(("number", "name"), [(3, "all"), (4, "left"), (5, "left")])
def test_scores_are_those_of_an_index_made_in_one_go(
    life: Life,
    at_once: dict[str, OpenedIndex],
    small_survey: Path,
    engine: Engine,
    number: int,
    name: str,
) -> None:
    photo = small_survey / "03.jpg"
    assert ranking(life.opened(number), photo, engine) == ranking(at_once[name], photo, engine)
