"""What was rehearsed of a query comes back from disk as it was written, or not at all."""

import os
from pathlib import Path

import numpy as np
import pytest

from contracts.config import Detector
from contracts.errors import BadIndex
from index.votes import read_outcomes, read_votes, write_outcomes, write_votes
from retrieval.evaluation import Scored
from retrieval.fusion import Scores
from retrieval.ways import Outcome, Votes, Way

NAMES: tuple[Detector, ...] = ("hesaff", "star")


def some_votes() -> Votes:
    rng = np.random.default_rng(0)
    votes: dict[tuple[Detector, int], Scores] = {}
    for name in NAMES:
        for k in (2, 5):
            touched = rng.random(20) < 0.5
            values = np.where(touched, rng.normal(size=20), 0.0)
            values[np.flatnonzero(touched)[0]] = 0.0  # a vote, though of nothing
            votes[name, k] = Scores(values, touched)
    return votes


@pytest.fixture
def written(tmp_path: Path) -> Path:
    path = tmp_path / "000000.npz"
    write_votes(path, some_votes())
    return path


def test_votes_come_back_with_what_was_touched(written: Path) -> None:
    read = read_votes(written, NAMES, (2, 5))
    assert read.keys() == some_votes().keys()
    for key, scores in some_votes().items():
        np.testing.assert_array_equal(read[key].touched, scores.touched)
        assert read[key].touched.dtype == np.bool_
        assert read[key].values.dtype == np.float64
        assert read[key].values == pytest.approx(scores.values, rel=1e-6)
        assert (read[key].values[~scores.touched] == 0).all()


def test_some_of_the_votes_can_be_read_alone(written: Path) -> None:
    assert list(read_votes(written, ("star",), (5,))) == [("star", 5)]


def test_the_same_votes_are_the_same_bytes(written: Path, tmp_path: Path) -> None:
    write_votes(tmp_path / "again.npz", some_votes())
    assert (tmp_path / "again.npz").read_bytes() == written.read_bytes()


def test_votes_that_are_not_there_are_refused_by_name(written: Path) -> None:
    with pytest.raises(BadIndex, match=r"000000\.npz does not hold the votes.*orb-2"):
        read_votes(written, ("orb",), (2,))
    with pytest.raises(BadIndex, match="star-10"):
        read_votes(written, ("star",), (10,))
    with pytest.raises(BadIndex, match=r"missing\.npz does not hold"):
        read_votes(written.with_name("missing.npz"), NAMES, (2,))


@pytest.mark.parametrize("kept", [0, 1, 100, 0.5, 0.99])
def test_a_file_cut_short_is_refused(written: Path, kept: float) -> None:
    content = written.read_bytes()
    written.write_bytes(content[: int(kept if kept >= 1 else kept * len(content))])
    with pytest.raises(BadIndex, match="does not hold the votes"):
        read_votes(written, NAMES, (2, 5))


def test_a_changed_byte_is_noticed(written: Path) -> None:
    content = bytearray(written.read_bytes())
    content[300] ^= 0xFF
    written.write_bytes(content)
    with pytest.raises(BadIndex, match="does not hold the votes"):
        read_votes(written, NAMES, (2, 5))


def test_what_is_no_archive_is_refused(tmp_path: Path) -> None:
    np.save(tmp_path / "one.npy", np.zeros(3))
    (tmp_path / "text").write_text("hesaff")
    os.mkfifo(tmp_path / "pipe")  # which nobody writes to
    for name in ("one.npy", "text", "pipe"):
        with pytest.raises(BadIndex, match="does not hold the votes"):
            read_votes(tmp_path / name, NAMES, (2,))


OUTCOMES = [
    Outcome(
        Way("fii", "pairwise", ("idf", "norm"), ("hesaff", "star"), 5), Scored(0.1 + 0.2, 0, 7)
    ),
    Outcome(Way("single", "union", (), ("star",), 2), Scored(0.0, 0.0, None)),
    Outcome(Way("borda", "union", ("burst",), NAMES, 10), Scored(1 / 3, 1.0, 1)),
]


def test_outcomes_come_back_to_the_last_bit(written: Path) -> None:
    write_outcomes(written, OUTCOMES)
    assert read_outcomes(written) == OUTCOMES
    assert read_votes(written, NAMES, (2, 5)).keys() == some_votes().keys()


def test_outcomes_that_are_missing_or_damaged_are_refused_by_name(written: Path) -> None:
    path = written.with_suffix(".json")
    write_outcomes(written, OUTCOMES)
    whole = path.read_text("utf-8")
    path.unlink()
    with pytest.raises(BadIndex, match=r"000000\.json does not hold the outcomes"):
        read_outcomes(written)
    for damaged in ("", whole[:-5], whole.replace("union", "loudest"), "{}"):
        path.write_text(damaged, "utf-8")
        with pytest.raises(BadIndex, match=r"000000\.json does not hold the outcomes"):
            read_outcomes(written)
