"""What `flaneur plan` works out, against slow and obvious oracles and an index that was made."""

import math
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image
from scipy.stats import binomtest

from contracts.config import CodebookConfig, FeatureConfig, IndexConfig
from contracts.errors import BadSurvey
from contracts.records import PosedImage, Postings
from coordinator.forecast.costs import search_structure_bytes
from coordinator.forecast.foreseeing import Machine, foresee
from coordinator.forecast.postings_bytes import RELATIVE_FREQUENCY, packed_bytes
from coordinator.forecast.ranges import Range, exactly, mean_of, share_of
from coordinator.forecast.sample import Sample, draw, extract_sample
from coordinator.forecast.stages import Stage, Tasks
from coordinator.forecast.vocabulary import foresee_channels
from index.codebooks import codebook_paths, write_codebook
from index.opened import OpenedIndex
from retrieval.codebooks import train_codebook
from retrieval.packing import pack
from survey import ReadOptions, read_survey

CONFIG = IndexConfig(
    features=FeatureConfig(detectors=("mser",), max_frames=60),
    codebooks=CodebookConfig(max_words=50),
)
WAVE = math.erf(math.sqrt(2.0))
"""What lies within two standard errors."""


def images(number: int) -> list[PosedImage]:
    return [PosedImage(f"{at:06d}.jpg", f"/survey/{at:06d}.jpg") for at in range(number)]


def views(n_panoramas: int) -> list[PosedImage]:
    return [
        PosedImage(f"{at:03d}#yaw={yaw}", f"/{at:03d}.jpg", fragment=f"yaw={yaw}&pitch=0&fov=80")
        for at in range(n_panoramas)
        for yaw in (0, 90, 180, 270)
    ]


def sampled(frames: int, image: np.ndarray, n_images: int = 4) -> Sample:
    """Images of the channels mser-sift, -surf and -sc, all the same."""
    return Sample(
        sizes=(1,) * n_images,
        seconds=(0.5,) * n_images,
        waiting=0.0,
        frames={"mser": (frames,) * n_images},
        descriptors=dict.fromkeys(("mser-sift", "mser-surf", "mser-sc"), (image,) * n_images),
        skipped=(),
        memory=None,
    )


def test_one_image_is_drawn_of_each_equal_part_of_a_survey() -> None:
    drawn = [group[0].uri for group in draw(images(100), 20)]
    assert [int(uri[:6]) // 5 for uri in drawn] == list(range(20))


def test_the_same_images_are_drawn_every_time_and_not_the_first_of_each_part() -> None:
    drawn = draw(images(1000), 20)
    assert drawn == draw(images(1000), 20)
    assert len({int(group[0].uri[:6]) % 50 for group in drawn}) > 5


def test_a_small_survey_is_drawn_whole() -> None:
    assert [image for group in draw(images(7), 20) for image in group] == images(7)


def test_views_of_a_panorama_are_drawn_together() -> None:
    groups = draw(views(50), 20)
    assert [len(group) for group in groups] == [4] * 5
    assert all(len({image.path for image in group}) == 1 for group in groups)


def test_a_mean_of_single_images_is_the_textbooks() -> None:
    values = [1.0, 2.0, 6.0, 7.0]
    found = mean_of(values, [1, 1, 1, 1], n_all=10**9)
    error = np.std(values, ddof=1) / 2.0
    assert found.likely == pytest.approx(4.0)
    assert (found.low, found.high) == pytest.approx((4.0 - 2 * error, 4.0 + 2 * error), rel=1e-6)


def test_a_mean_over_all_images_is_exact() -> None:
    assert mean_of([3.0, 5.0], [1, 3], n_all=4) == exactly(2.0)


@pytest.mark.parametrize(("found", "drawn"), [(0, 20), (1, 20), (7, 20), (20, 20), (1, 1)])
def test_a_share_is_wilsons(found: int, drawn: int) -> None:
    oracle = binomtest(found, drawn).proportion_ci(confidence_level=WAVE, method="wilson")
    share = share_of(found, drawn)
    assert (share.low, share.high) == pytest.approx((oracle.low, oracle.high), abs=1e-9)


@given(
    st.lists(st.tuples(st.integers(0, 30), st.integers(1, 50)), max_size=5),
    st.integers(1, 12),
)
def test_a_stage_lasts_as_long_as_workers_that_take_task_after_task(
    groups: list[tuple[int, int]], n_workers: int
) -> None:
    free_at = [0] * n_workers
    for number, seconds in groups:
        for _ in range(number):
            free_at[free_at.index(min(free_at))] += seconds
    stage = Stage("train", tuple(Tasks(n, exactly(s)) for n, s in groups), None, None)
    rounds_in_turn = sum(seconds for _, seconds in groups)  # what dealing out in rounds may add
    found = stage.wall_s(n_workers)
    assert max(free_at) <= found.likely + rounds_in_turn
    assert found.likely <= max(free_at) + rounds_in_turn
    if len(groups) < 2 or n_workers == 1:
        assert found == exactly(max(free_at))


@pytest.mark.parametrize(("n_images", "a_word"), [(500, 15.0), (5_000, 1.5), (5_000, 400.0)])
def test_packed_bytes_are_those_of_lists_of_that_many_images(n_images: int, a_word: float) -> None:
    rng = np.random.default_rng(1)
    n_words = 20 * len(RELATIVE_FREQUENCY)
    means = np.repeat(RELATIVE_FREQUENCY, 20) * a_word
    lists = [np.flatnonzero(rng.random(n_images) < mean / n_images) for mean in means]
    indptr = np.cumsum([0, *map(len, lists)]).astype(np.int64)
    packed = pack(Postings(indptr, np.concatenate(lists).astype(np.uint32)))
    expected = packed_bytes(float(indptr[-1]), n_words, n_images)
    assert expected == pytest.approx(len(packed.packed), rel=0.06)


def test_images_that_repeat_one_descriptor_have_one_posting_each() -> None:
    channels = foresee_channels(sampled(50, np.full((50, 36), 7, np.uint8)), CONFIG, 1000)
    assert [channel.postings.likely for channel in channels] == pytest.approx([1000.0] * 3)
    assert {channel.postings.high for channel in channels} == {50_000.0}


def test_an_image_repeats_itself_less_in_more_words() -> None:
    rng = np.random.default_rng(0)
    sample = sampled(300, rng.integers(0, 256, (300, 36), dtype=np.uint8), n_images=8)
    postings = []
    for max_words in (10, 100, 1_000):
        config = CONFIG.model_copy(update={"codebooks": CodebookConfig(max_words=max_words)})
        postings.append([one.postings.likely for one in foresee_channels(sample, config, 50)])
    few, more, most = np.array(postings)
    assert np.all(few <= 50 * 10)
    assert np.all(few < more)
    assert np.all(more < most)
    assert np.all(most <= 50 * 300)


@pytest.mark.parametrize("n_words", [300, 5_000])
def test_a_search_structure_takes_the_bytes_predicted(n_words: int, tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    codebook = train_codebook(rng.integers(0, 256, (n_words, 64), dtype=np.uint8), n_words, 0)
    paths = codebook_paths(tmp_path, "0001", "mser-surf")
    write_codebook(paths, codebook)
    n_bytes = paths["search"].stat().st_size
    assert search_structure_bytes(n_words, 64) == pytest.approx(n_bytes, rel=0.02, abs=1_500)


def test_what_is_foreseen_of_a_survey_sampled_whole_is_what_indexing_makes(
    small_survey: Path, indexed: Callable[[IndexConfig], OpenedIndex]
) -> None:
    listed = read_survey(small_survey, ReadOptions(crs="EPSG:2154")).images
    sample = extract_sample(draw(listed, 20), CONFIG.features, lambda: None)
    forecast = foresee(sample, CONFIG, len(listed), 4, [1, 2], Machine(1.0, None))
    index = indexed(CONFIG)

    receipts = [
        path
        for path in (index.root / "jobs").glob("*/receipts/*/*.json")
        if path.parent.name != "catalogue"  # the coordinator's own
    ]
    assert forecast.n_messages == len(receipts)
    n_postings = sum(channel.postings.likely for channel in forecast.channels)
    assert n_postings == pytest.approx(index.generation.n_postings, rel=0.2)
    files = {name: entry.size for name, entry in index.generation.files.items()}
    words = sum(size for name, size in files.items() if name.startswith("codebooks"))
    assert forecast.storage.codebooks.likely == pytest.approx(words, rel=0.35)
    assert all(one.low <= one.likely <= one.high for one in forecast.walls.values())
    assert forecast.walls[2].likely < forecast.walls[1].likely
    assert forecast.seconds_an_image.low == forecast.seconds_an_image.high > 0.0


def test_a_sample_counts_images_that_cannot_be_read(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    listed = []
    for at in range(4):
        path = tmp_path / f"{at}.png"
        Image.fromarray(rng.integers(0, 256, (60, 80, 3), dtype=np.uint8)).save(path)
        if at == 2:
            path.write_bytes(path.read_bytes()[:60])
        listed.append(PosedImage(path.name, str(path)))
    sample = extract_sample([(image,) for image in listed], CONFIG.features, lambda: None)
    assert [skipped.uri for skipped in sample.skipped] == ["2.png"]
    assert sample.frames["mser"][2] == 0
    assert len(sample.descriptors["mser-sift"]) == 3
    forecast = foresee(sample, CONFIG, 4000, 32, [1], Machine(1.0, None))
    assert forecast.unreadable is not None
    assert forecast.unreadable.likely == 1000.0
    assert forecast.unreadable.low < 1000.0 < forecast.unreadable.high

    with pytest.raises(BadSurvey, match=r"2\.png"):
        extract_sample([(listed[2],)], CONFIG.features, lambda: None)


def test_ten_times_the_images_take_ten_times_the_extraction_and_no_larger_words() -> None:
    rng = np.random.default_rng(0)
    sample = sampled(50, rng.integers(0, 256, (50, 64), dtype=np.uint8))
    few, many = (
        foresee(sample, CONFIG, number, 32, [8], Machine(1.0, None)) for number in (6_400, 64_000)
    )
    assert many.stages[0].core_s.likely == pytest.approx(10 * few.stages[0].core_s.likely)
    assert many.storage.codebooks == few.storage.codebooks
    assert many.storage.features.likely == pytest.approx(10 * few.storage.features.likely)


def test_a_survey_in_which_nothing_is_found_is_foreseen_too() -> None:
    sample = sampled(0, np.zeros((0, 36), np.uint8))
    forecast = foresee(sample, CONFIG, 100, 32, [1], Machine(1.0, None))
    assert {channel.n_words for channel in forecast.channels} == {0}
    assert forecast.storage.postings == exactly(0.0)
    assert forecast.walls[1].likely > 50.0


def test_a_slower_machine_takes_longer_for_what_is_modelled() -> None:
    sample = sampled(50, np.zeros((50, 64), np.uint8))
    fast, slow = (foresee(sample, CONFIG, 6_400, 32, [8], Machine(x, None)) for x in (1.0, 3.0))
    for before, after in zip(fast.stages[1:], slow.stages[1:], strict=True):
        assert after.core_s.likely == pytest.approx(3.0 * before.core_s.likely)


def test_ranges_add_and_widen() -> None:
    one = Range(1.0, 2.0, 4.0)
    assert one + one.times(2.0) == Range(3.0, 6.0, 12.0)
    assert one.within(2.0) == Range(0.5, 2.0, 8.0)
    widths = [exactly(1.0).within(factor) for factor in (1.0, 1.5, 2.0)]
    assert all(later.high > former.high for former, later in pairwise(widths))
