"""Verifying finds every damaged file and everything that does not agree, and names it."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from made_index import FEATURES, made_index, named_anew
from numpy.typing import NDArray

from contracts.errors import BadIndex
from coordinator.cli.show import Bars
from index.catalogue import Catalogue, write_catalogue
from index.codebooks import codebook_paths, write_codebook
from index.files import write_array, write_arrays
from index.manifest import Generation
from index.segments import SegmentPaths, segment_paths
from index.verifying import Verdict, verify
from retrieval.codebooks import train_codebook


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Generation]:
    root = tmp_path_factory.mktemp("made")
    return root, made_index(root, removed=(1, 4))


@pytest.fixture
def index(made: tuple[Path, Generation], tmp_path: Path) -> tuple[Path, Generation]:
    return shutil.copytree(made[0], tmp_path / "index"), made[1]


def verified(root: Path, every: bool = False) -> Verdict:
    return verify(root, every, Bars(None))


def the_fault(root: Path) -> str:
    (told,) = verified(root).faults
    return told


def test_an_index_as_written_is_sound(index: tuple[Path, Generation]) -> None:
    verdict = verified(index[0])
    assert verdict.faults == {}
    assert verdict.sound == (1,)
    assert verdict.files == len(index[1].files)
    assert verdict.bytes == sum(entry.size for entry in index[1].files.values())


def test_a_flipped_byte_of_any_file_is_found_and_named(index: tuple[Path, Generation]) -> None:
    root, generation = index
    for name in generation.files:
        path = root / name
        content = path.read_bytes()
        path.write_bytes(content[:-1] + bytes([content[-1] ^ 1]))
        assert str(path) in the_fault(root)
        path.write_bytes(content)


def test_a_missing_or_a_cut_file_is_named_with_the_size_expected(
    index: tuple[Path, Generation],
) -> None:
    root, generation = index
    name, entry = next(iter(generation.files.items()))
    (root / name).write_bytes(b"")
    assert f"{root / name} is 0 bytes long, expected a file of {entry.size} bytes" in the_fault(
        root
    )
    (root / name).unlink()
    assert f"{root / name} is missing" in the_fault(root)


def test_all_says_which_generation_is_sound_yet(index: tuple[Path, Generation]) -> None:
    root, generation = index
    added = root / "models" / "note.json"
    added.parent.mkdir()
    added.write_text("{}")
    files = {**generation.files, "models/note.json": next(iter(generation.files.values()))}
    named_anew(root, generation.model_copy(update={"files": files}))
    added.write_text("[]")
    verdict = verified(root, every=True)
    assert verdict.generations == (1, 2)
    assert verdict.sound == (1,)
    assert verified(root).sound == ()


def test_what_two_generations_share_is_read_once_and_told_once(
    index: tuple[Path, Generation],
) -> None:
    root, generation = index
    named_anew(root, generation)
    name = next(iter(generation.files))
    (root / name).write_bytes(b"")
    verdict = verified(root, every=True)
    assert list(verdict.faults.values()) == [(1, 2)]
    assert verdict.files == len(generation.files)


def test_a_damaged_current_is_told_and_everything_read(index: tuple[Path, Generation]) -> None:
    root, _ = index
    (root / "CURRENT").write_text("../../etc")
    verdict = verified(root)
    assert "CURRENT holds" in next(iter(verdict.faults))
    assert verdict.sound == (1,)


def test_a_folder_that_is_no_index_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadIndex, match="not a Flaneur index"):
        verified(tmp_path)


def edit(path: Path, **changes: object) -> None:
    path.write_text(json.dumps({**json.loads(path.read_text()), **changes}))


@pytest.mark.parametrize("field", ["config_digest", "codebooks_digest"])
def test_a_digest_within_a_generation_must_be_its_own(
    index: tuple[Path, Generation], field: str
) -> None:
    edit(index[0] / "generations" / "000001.json", **{field: "0" * 16})
    assert f"000001.json: {field} is 0000000000000000" in the_fault(index[0])


def test_a_generation_has_the_number_of_its_file(index: tuple[Path, Generation]) -> None:
    edit(index[0] / "generations" / "000001.json", number=9)
    assert "000001.json" in the_fault(index[0])
    assert "9" in the_fault(index[0])


def test_a_generation_must_name_all_that_it_reads(index: tuple[Path, Generation]) -> None:
    root, generation = index
    files = {name: entry for name, entry in generation.files.items() if "packed" not in name}
    named_anew(root, generation.model_copy(update={"files": files}))
    faults = list(verified(root).faults)
    assert len(faults) == 2 * len(FEATURES.channels())
    assert all("000002.json does not name segments/" in told for told in faults)


# From here on the digests are right, and what was written is wrong.


def paths_of(root: Path) -> SegmentPaths:
    return segment_paths(root, "0001", "hesaff-sift")


def test_counts_must_be_those_of_the_lists(index: tuple[Path, Generation]) -> None:
    root, generation = index
    paths = segment_paths(root, "0002", "hesaff-sift")
    counts = np.load(paths.counts)
    counts[counts.argmax()] //= 2
    write_array(paths.counts, counts)
    named_anew(root, generation)
    lists, total = verified(root).faults
    assert "cannot be unpacked" in lists or f"{paths.words_per_image} gives image" in lists
    assert "segments/0002 has" in total


def test_an_image_beyond_the_segment_is_found(index: tuple[Path, Generation]) -> None:
    root, generation = index
    packed = np.load(paths_of(root).packed)
    offsets = np.load(paths_of(root).offsets)
    packed[offsets[3] + 1 : offsets[4]] = 255
    write_array(paths_of(root).packed, packed)
    named_anew(root, generation)
    assert "cannot be unpacked" in the_fault(root)


def test_words_of_each_image_are_counted_again(index: tuple[Path, Generation]) -> None:
    root, generation = index
    words = np.load(paths_of(root).words_per_image)
    words[2] += 1
    write_array(paths_of(root).words_per_image, words)
    named_anew(root, generation)
    assert f"words_per_image.npy gives image 2 another number of words than the {words[2] - 1}" in (
        the_fault(root)
    )


def test_postings_of_a_segment_are_added_up(index: tuple[Path, Generation]) -> None:
    root, generation = index
    first, second = generation.segments
    segments = (first, second.model_copy(update={"n_postings": second.n_postings + 1}))
    named_anew(root, generation, segments=segments)
    assert f"{second.n_postings} postings, its generation says {second.n_postings + 1}" in (
        the_fault(root)
    )


def test_the_number_removed_must_be_that_of_the_tombstones(
    index: tuple[Path, Generation],
) -> None:
    root, generation = index
    first, second = generation.segments
    named_anew(root, generation, segments=(first.model_copy(update={"n_removed": 3}), second))
    assert "removed.npy removes 2 images, the generation says 3" in the_fault(root)


def test_what_removing_left_of_a_word_is_counted_again(index: tuple[Path, Generation]) -> None:
    root, generation = index
    path = root / "tombstones" / "000001" / "0001" / "hesaff-sc.npy"
    left = np.load(path)
    left[7] += 1
    write_array(path, left)
    named_anew(root, generation)
    assert f"{path} leaves {left[7]} images of word 7, its list {left[7] - 1}" in the_fault(root)


def test_uris_must_ascend(index: tuple[Path, Generation]) -> None:
    root, generation = index
    path = root / "catalogue" / "0002.parquet"
    rows = Catalogue([path], [4]).rows([0, 1, 3, 2])
    write_catalogue(path, rows, None)
    named_anew(root, generation)
    assert f"{path}: image_id is not the number of the row" in the_fault(root)


def test_a_catalogue_of_another_number_of_images_is_found(
    index: tuple[Path, Generation],
) -> None:
    root, generation = index
    path = root / "catalogue" / "0002.parquet"
    write_catalogue(path, Catalogue([path], [4]).rows([0, 1, 2]), None)
    named_anew(root, generation)
    assert "has 3 rows; its segment has 4 images" in the_fault(root)


@pytest.mark.parametrize(
    ("word_ids", "said"),
    [
        (np.random.default_rng(8).permutation(2000), "of its own words, expected 90% or more"),
        (np.arange(2000) // 2, "does not list each of 2000 words once"),
    ],
)
def test_lists_that_hold_the_wrong_words_are_found(
    index: tuple[Path, Generation], word_ids: NDArray[np.int64], said: str
) -> None:
    root, generation = index
    paths = codebook_paths(root, "0001", "hesaff-sift")
    words = np.random.default_rng(9).integers(0, 256, (2000, 128), dtype=np.uint8)
    write_array(paths["words"], words)
    lists = {
        "centres": words[:200],
        "starts": np.arange(0, 2001, 10, dtype=np.int64),
        "word_ids": word_ids.astype(np.int32),
    }
    write_arrays(paths["search"], lists)
    named_anew(root, generation)
    assert any(said in told for told in verified(root).faults)


def test_words_of_another_descriptor_are_found(index: tuple[Path, Generation]) -> None:
    root, generation = index
    sample = np.random.default_rng(9).integers(0, 256, (200, 40), dtype=np.uint8)
    write_codebook(codebook_paths(root, "0001", "hesaff-sift"), train_codebook(sample, 20, 0))
    generation = named_anew(root, generation)
    told = " ".join(verified(root).faults)
    assert "hesaff-sift.npy has 40 dimensions, expected 128 for hesaff-sift" in told
