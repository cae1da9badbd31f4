"""The same harm done to a survey of every format: it is read, or refused with the file's name."""

import json
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from made_surveys import MAKERS, TABLES, TEXTS, images_of, read, root_of

from contracts.errors import WrongInput
from survey import Survey

PROPERTY = settings(
    max_examples=30, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


@pytest.fixture(params=sorted(MAKERS))
def name(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def made(name: str, tmp_path: Path) -> Path:
    """The file of a good survey that says where its images were taken."""
    return MAKERS[name](tmp_path / "survey")


def outcome(name: str, made: Path) -> Survey | str:
    """The survey, with every image read or accounted for; or the refusal, which names the file."""
    found = survey_or_refusal(name, made)
    if isinstance(found, str):
        assert str(made if name in TABLES else root_of(made)) in found
        return found
    told = {image.uri for image in found.images} | {skip.uri for skip in found.skipped}
    assert images_of(made) <= told
    return found


def survey_or_refusal(name: str, made: Path) -> Survey | str:
    try:
        return read(name, made)
    except WrongInput as error:
        return str(error)


def test_the_good_survey_is_read_whole(name: str, made: Path) -> None:
    survey = outcome(name, made)
    assert isinstance(survey, Survey)
    assert (len(survey.images), survey.skipped) == (2, ())


def test_a_file_cut_anywhere_is_read_as_far_as_it_goes_or_refused(name: str, made: Path) -> None:
    whole = made.read_bytes()

    @PROPERTY
    @given(st.integers(0, len(whole) - 1))
    def check(length: int) -> None:
        made.write_bytes(whole[:length])
        outcome(name, made)

    check()


def test_bytes_changed_anywhere_are_read_or_refused(name: str, made: Path) -> None:
    whole = made.read_bytes()

    @PROPERTY
    @given(st.lists(st.tuples(st.integers(0, len(whole) - 1), st.integers(0, 255)), max_size=4))
    def check(changes: list[tuple[int, int]]) -> None:
        harmed = bytearray(whole)
        for at, value in changes:
            harmed[at] = value
        made.write_bytes(harmed)
        outcome(name, made)

    check()


@pytest.mark.parametrize("name", TEXTS)
def test_a_byte_order_mark_changes_nothing(name: str, made: Path) -> None:
    good = outcome(name, made)
    made.write_bytes(b"\xef\xbb\xbf" + made.read_bytes())
    assert outcome(name, made) == good


@pytest.mark.parametrize("name", TEXTS)
def test_ends_of_lines_change_nothing(name: str, made: Path) -> None:
    good = outcome(name, made)
    made.write_bytes(made.read_bytes().replace(b"\n", b"\r\n"))
    assert outcome(name, made) == good


@pytest.mark.parametrize("name", TEXTS)
def test_the_order_of_the_entries_changes_nothing(name: str, made: Path) -> None:
    good = outcome(name, made)
    text = made.read_text()
    if name in ("mapillary", "stereopolis"):
        made.write_text(json.dumps([dict(reversed(e.items())) for e in json.loads(text)[::-1]]))
    elif name == "geojson":
        collection = json.loads(text)
        made.write_text(json.dumps(collection | {"features": collection["features"][::-1]}))
    else:
        *header, first, second = text.splitlines()
        made.write_text("\n".join([*header, second, first]))
    assert made.read_text() != text
    assert outcome(name, made) == good


@pytest.mark.parametrize("name", TEXTS)
def test_decimal_commas_are_no_coordinates_of_another_place(name: str, made: Path) -> None:
    good = outcome(name, made)
    made.write_text(made.read_text().replace("0.5", "0,5"))
    found = outcome(name, made)
    assert isinstance(good, Survey)
    assert isinstance(found, str) or all(image in good.images for image in found.images)


@pytest.mark.parametrize("name", TEXTS)
def test_latin_1_among_the_numbers_is_told_by_file_and_row(name: str, made: Path) -> None:
    made.write_bytes(made.read_bytes().replace(b"0.5", b"\xe9", 1))
    found = outcome(name, made)
    if isinstance(found, Survey):
        assert any(f"{made.name} row 2" in skip.reason for skip in found.skipped)


@pytest.mark.parametrize("name", sorted(MAKERS))
def test_an_empty_file_is_named(name: str, made: Path) -> None:
    made.write_bytes(b"")
    found = outcome(name, made)
    if isinstance(found, Survey):
        assert [skip.uri for skip in found.skipped] == [made.name]


@pytest.mark.parametrize("name", TEXTS)
def test_an_entry_that_is_there_twice_gives_no_image_twice(name: str, made: Path) -> None:
    good = outcome(name, made)
    text = made.read_text()
    if name == "geojson":
        collection = json.loads(text)
        made.write_text(json.dumps(collection | {"features": collection["features"] * 2}))
    elif text.startswith("["):
        made.write_text(json.dumps(json.loads(text) * 2))
    else:
        made.write_text(text + text.splitlines()[-1] + "\n")
    found = outcome(name, made)
    assert isinstance(good, Survey)
    if isinstance(found, str):
        assert "twice" in found or "again" in found or "more than once" in found
    else:
        assert set(found.images) <= set(good.images)
        assert found.skipped
