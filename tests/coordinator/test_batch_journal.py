"""The journal of a batch, cut off anywhere."""

from pathlib import Path

import pytest

from coordinator.batches.journal import AnswerReader, Answers, Journal
from geo.geojson import PlacedTarget, error_feature, target_feature

BYTES = ["a" * 64, "b" * 64]


def written(path: Path) -> None:
    """Photos 0 and 2 are of the same bytes, photo 1 of no photo, photo 3 is missing."""
    with Journal(path) as journal:
        journal.digested(0, BYTES[0])
        journal.digested(1, BYTES[1])
        journal.answered(BYTES[0], [target_feature(PlacedTarget("0.jpg", 2.0, 48.0, 3.0, 4))], 0.5)
        journal.digested(2, BYTES[0])
        journal.failed(3, "missing")
        journal.answered(BYTES[1], [error_feature("1.jpg", "no photo")], 0.0)


def test_every_photo_has_its_answer_by_its_own_name(tmp_path: Path) -> None:
    path = tmp_path / "answers.jsonl"
    written(path)
    answers = Answers.read(path)
    assert answers.count() == (4, 2)
    with path.open("rb") as file:
        reader = AnswerReader(answers, file)
        (first,), seconds = reader.answer(0, "0.jpg")
        (same,), _ = reader.answer(2, "copy.jpg")
        (missing,), _ = reader.answer(3, "3.jpg")
    assert first == target_feature(PlacedTarget("0.jpg", 2.0, 48.0, 3.0, 4))
    assert same == target_feature(PlacedTarget("copy.jpg", 2.0, 48.0, 3.0, 4))
    assert missing == error_feature("3.jpg", "missing")
    assert seconds == 0.5


def test_cut_off_anywhere_what_is_whole_counts_and_the_rest_can_be_added_again(
    tmp_path: Path,
) -> None:
    path = tmp_path / "answers.jsonl"
    written(path)
    whole = path.read_bytes()
    counts = [(0, 0), (0, 0), (0, 0), (0, 0), (1, 0), (2, 0), (3, 1), (4, 2)]
    for length in range(len(whole)):
        path.write_bytes(whole[:length])
        assert Answers.read(path).count() == counts[whole[:length].count(b"\n")]
    path.write_bytes(whole[: len(whole) // 2])
    written(path)
    assert Answers.read(path).count() == (4, 2)


def test_what_is_forgotten_is_asked_again(tmp_path: Path) -> None:
    path = tmp_path / "answers.jsonl"
    written(path)
    with Journal(path) as journal:
        journal.forget(BYTES[1])
        journal.ask_again(1)
        journal.ask_again(3)
    answers = Answers.read(path)
    assert answers.count() == (2, 0)
    assert [answers.is_done(number) for number in range(4)] == [True, False, True, False]


def test_a_batch_not_begun_has_no_answers(tmp_path: Path) -> None:
    assert Answers.read(tmp_path / "answers.jsonl").count() == (0, 0)


def test_a_full_disk_is_named() -> None:
    with (
        pytest.raises(OSError, match="No space left on device: '/dev/full'"),
        Journal(Path("/dev/full")),
    ):
        pass
