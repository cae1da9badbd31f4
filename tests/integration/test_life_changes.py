"""Changes that meet one another, or come twice."""

import shutil
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from living_index import (
    BARS,
    CHANNELS,
    CONFIG,
    DEGREES,
    FIRST,
    LAMBERT_93,
    REMOVED,
    Life,
    add,
    contents,
    grown,
    index_first,
    remove,
)

from contracts.errors import BadConfig, BadIndex
from coordinator.adding import find_new, plan_addition, run_addition
from coordinator.cli.show import Bars
from coordinator.compacting import compact
from coordinator.engine.running import Engine
from coordinator.indexing import run_job
from coordinator.intake import read_surveys
from coordinator.plan import make_plan
from index.manifest import read_generation
from index.opened import OpenedIndex


def test_what_was_done_is_not_done_again(
    life: Life, small_survey: Path, tmp_path: Path, engine: Engine
) -> None:
    """Not even after the index was added to, removed from and compacted."""
    root = grown(life, tmp_path, 5)
    again = index_first(small_survey, root, engine)
    assert (again.images_extracted, again.generation.number) == (0, 5)
    assert find_new(OpenedIndex(root), "", small_survey, FIRST).intake.images != ()
    unchanged = replace(LAMBERT_93, exclude=REMOVED)
    new = find_new(OpenedIndex(root), "", small_survey, unchanged)
    assert (new.intake.images, new.n_known) == ((), 8)


def test_removed_images_can_be_added_again(
    life: Life, small_survey: Path, other_survey: Path, tmp_path: Path, engine: Engine
) -> None:
    """Also all images of a job, whose segment is then in the index twice."""
    root = grown(life, tmp_path, 4)
    before = OpenedIndex(root)
    remove(root, *(f"b/{number}.jpg" for number in (0, 1, 3, 4)))
    report = add(root, "b", other_survey, engine, DEGREES)
    assert [each.n_images - each.n_removed for each in report.generation.segments] == [5, 3, 0, 5]
    remove(root, "b/2.jpg")
    for channel in CHANNELS:
        np.testing.assert_array_equal(OpenedIndex(root).idf(channel), before.idf(channel))


def test_an_added_job_that_was_gone_back_from_needs_no_extraction(
    life: Life, small_survey: Path, tmp_path: Path, engine: Engine
) -> None:
    root = grown(life, tmp_path, 1)
    report = add(root, "", small_survey, engine)
    assert report.images_extracted == 0
    assert report.generation.segments == read_generation(life.root, 2).segments


def test_two_surveys_added_at_once_are_both_kept(
    life: Life, small_survey: Path, other_survey: Path, tmp_path: Path, engine: Engine
) -> None:
    root = grown(life, tmp_path, 1)
    opened = OpenedIndex(root)
    plans = []
    for name, path, options in (("b", other_survey, DEGREES), ("", small_survey, LAMBERT_93)):
        intake = find_new(opened, name, path, options).intake
        plans.append((*plan_addition(opened, intake, 3), intake))
    for job, plan, intake in plans:
        run_addition(job, plan, intake, nullcontext(engine), BARS)
    generation = read_generation(root)
    assert [segment.n_images for segment in generation.segments] == [6, 5, 4]
    report = compact(root, nullcontext(engine), BARS)
    assert contents(OpenedIndex(root)).keys() == contents(life.opened(5)).keys()
    assert report.generation.n_live == 15


def test_an_image_that_another_added_meanwhile_is_not_added_twice(
    life: Life, small_survey: Path, tmp_path: Path, engine: Engine
) -> None:
    root = grown(life, tmp_path, 1)
    opened = OpenedIndex(root)
    late = replace(LAMBERT_93, include=("09.jpg",))
    intake = find_new(opened, "", small_survey, late).intake
    job, plan = plan_addition(opened, intake, 3)
    add(root, "", small_survey, engine)
    with pytest.raises(BadIndex, match=r"was given '09\.jpg'.*run the same command again"):
        run_addition(job, plan, intake, nullcontext(engine), BARS)
    assert read_generation(root).n_live == 10
    assert not find_new(OpenedIndex(root), "", small_survey, late).intake.images


def test_images_are_not_added_beside_other_words(
    life: Life, small_survey: Path, other_survey: Path, tmp_path: Path, engine: Engine
) -> None:
    root = grown(life, tmp_path, 1)
    opened = OpenedIndex(root)
    intake = find_new(opened, "b", other_survey, DEGREES).intake
    job, plan = plan_addition(opened, intake, 3)
    everything = read_surveys([("", small_survey)], LAMBERT_93)
    run_job(*make_plan(root, everything, CONFIG, 32), everything, nullcontext(engine), BARS)
    with pytest.raises(BadIndex, match="was given other words"):
        run_addition(job, plan, intake, nullcontext(engine), BARS)


def test_an_index_changed_while_it_was_compacted_stays_as_it_is(
    life: Life, tmp_path: Path, engine: Engine
) -> None:
    root = grown(life, tmp_path, 3)

    class Meddler(Bars):
        """Removes an image while segments are merged."""

        def begin(self, stage: str, total: int, done: int) -> None:
            if stage == "join":
                remove(root, "00.jpg")
            super().begin(stage, total, done)

    with pytest.raises(BadIndex, match=r"was changed \(generation 4\) while generation 3"):
        compact(root, nullcontext(engine), Meddler(None))
    assert read_generation(root).n_live == 14
    assert compact(root, nullcontext(engine), BARS).generation.n_images == 14


def test_an_image_from_elsewhere_needs_a_name(
    life: Life, other_survey: Path, tmp_path: Path
) -> None:
    moved = shutil.copytree(other_survey, tmp_path / "moved")
    with pytest.raises(BadConfig, match=r"has an image 'b/0\.jpg' already.*--name"):
        find_new(life.opened(3), "b", moved, DEGREES)


def test_a_survey_seen_through_a_link_is_the_same(
    life: Life, other_survey: Path, tmp_path: Path
) -> None:
    (tmp_path / "link").symlink_to(other_survey)
    assert find_new(life.opened(3), "b", tmp_path / "link", DEGREES).n_known == 5
