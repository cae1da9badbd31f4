from pathlib import Path
from urllib.parse import urlsplit
from urllib.request import url2pathname

import pytest
from hypothesis import given
from hypothesis import strategies as st

from survey.fragments import Fragment, Message, View, parse_fragment
from survey.uris import image_uri

NAMES = st.text(
    st.characters(exclude_characters="/\0", exclude_categories=["Cs"]), min_size=1, max_size=40
).filter(lambda name: name not in {".", ".."})


@given(NAMES)
def test_any_name_comes_back_by_the_standard_library(name: str) -> None:
    parts = urlsplit(image_uri(f"/survey/{name}"))
    assert (parts.scheme, parts.netloc, parts.query, parts.fragment) == ("file", "", "", "")
    assert Path(url2pathname(parts.path)) == Path(f"/survey/{name}")


@pytest.mark.parametrize(
    ("path", "uri"),
    [
        ("/survey/a.jpg", "file:///survey/a.jpg"),
        ("/survey/a b#1?.jpg", "file:///survey/a%20b%231%3F.jpg"),
        ("/survey/été.jpg", "file:///survey/%C3%A9t%C3%A9.jpg"),
        ("/survey/caf\udce9.jpg", "file:///survey/caf%E9.jpg"),
    ],
)
def test_what_a_uri_may_not_hold_is_encoded(path: str, uri: str) -> None:
    assert image_uri(path) == uri


def test_an_image_within_a_file_is_behind_the_number_sign() -> None:
    within = Fragment(Message("/cam/front #1", 17, 4096), View(90.0, -5.0, 90.0))
    uri = image_uri("/survey/drive.mcap", str(within))
    assert uri.startswith("file:///survey/drive.mcap#topic=%2Fcam%2Ffront+%231&")
    assert parse_fragment(urlsplit(uri).fragment) == within


def test_a_relative_path_is_refused() -> None:
    with pytest.raises(ValueError, match="relative"):
        image_uri("survey/a.jpg")
