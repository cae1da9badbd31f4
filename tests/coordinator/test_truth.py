"""Ground truth references name one image, or are refused by name."""

import json
import unicodedata
from pathlib import Path

import pytest

from contracts.errors import BadTruth
from coordinator.truth import read_truth

URIS = ["a/1.jpg", "b/1.jpg", "b/2.jpg", "town/references/3.jpg"]


def truth(folder: Path, content: object) -> Path:
    path = folder / "ground_truth.json"
    path.write_text(json.dumps(content))
    return path


def test_references_are_found_by_uri_or_by_either_ending(tmp_path: Path) -> None:
    path = truth(tmp_path, {"q.jpg": ["a/1.jpg", "2.jpg", "set/town/references/3.jpg"]})
    (query,) = read_truth(path, None, URIS)
    assert query.relevant == (0, 2, 3)
    assert query.path == tmp_path / "q.jpg"
    assert (query.junk, query.box) == ((), None)


def test_root_says_where_queries_are(tmp_path: Path) -> None:
    (query,) = read_truth(truth(tmp_path, {"q.jpg": []}), Path("elsewhere"), URIS)
    assert query.path == Path("elsewhere/q.jpg")


def test_an_equal_uri_wins_over_longer_ones(tmp_path: Path) -> None:
    (query,) = read_truth(truth(tmp_path, {"q": ["1.jpg"]}), None, ["x/1.jpg", "1.jpg"])
    assert query.relevant == (1,)


def test_references_are_compared_in_the_unicode_form_of_uris(tmp_path: Path) -> None:
    uri = "Müller Straße.jpg"
    decomposed = unicodedata.normalize("NFD", uri)
    assert decomposed != uri
    (query,) = read_truth(truth(tmp_path, {"q": [decomposed]}), None, [uri])
    assert query.relevant == (0,)


def test_a_byte_order_mark_is_no_matter(tmp_path: Path) -> None:
    path = tmp_path / "truth.json"
    path.write_text('{"q": ["2.jpg"]}', encoding="utf-8-sig")
    (query,) = read_truth(path, None, URIS)
    assert query.relevant == (2,)


@pytest.mark.parametrize(
    ("reference", "words"),
    [("1.jpg", "several images"), ("9.jpg", "no image"), ("eferences/3.jpg", "no image")],
)
def test_a_reference_to_none_or_several_is_named(
    tmp_path: Path, reference: str, words: str
) -> None:
    path = truth(tmp_path, {"q.jpg": [reference]})
    with pytest.raises(BadTruth, match=words) as error:
        read_truth(path, None, URIS)
    assert reference in str(error.value)
    assert "q.jpg" in str(error.value)


def test_a_query_that_is_there_twice_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "truth.json"
    path.write_text('{"q.jpg": ["2.jpg"], "q.jpg": []}')
    with pytest.raises(BadTruth, match=r"'q\.jpg' is there twice"):
        read_truth(path, None, URIS)


@pytest.mark.parametrize("content", [[], {"q": "one.jpg"}, {"q": [1]}, "text", 100000.5])
def test_what_is_no_truth_is_refused(tmp_path: Path, content: object) -> None:
    with pytest.raises(BadTruth, match="not a ground truth"):
        read_truth(truth(tmp_path, content), None, URIS)


@pytest.mark.parametrize("content", [b"", b"q.jpg,1.jpg\n", b"\xff\xd8\xff\xe0", b"{", b"[" * 9999])
def test_an_unknown_format_is_told_the_three_that_are_known(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "truth"
    path.write_bytes(content)
    with pytest.raises(BadTruth, match="not a ground truth") as error:
        read_truth(path, None, URIS)
    assert all(name in str(error.value) for name in ("JSON", "Oxford/Paris", "INRIA Holidays"))


def test_a_missing_truth_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(BadTruth, match=r"none\.json"):
        read_truth(tmp_path / "none.json", None, URIS)
