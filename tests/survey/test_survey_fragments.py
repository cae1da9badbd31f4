import contextlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from contracts.errors import UnusableImage
from survey.fragments import Fragment, Message, View, parse_fragment

DEGREES = st.integers(-7200, 7200).map(lambda half: half / 20.0)
VIEWS = st.builds(
    View,
    DEGREES,
    st.integers(-900, 900).map(lambda tenth: tenth / 10.0),
    st.floats(1, 179).map(int),
)
MESSAGES = st.builds(
    Message,
    st.text(),
    st.integers(0, 2**63),
    st.integers(0, 2**63),
    st.integers(0, 2**40),
    st.text(),
)


@given(st.none() | MESSAGES, st.none() | VIEWS)
def test_a_fragment_is_read_as_it_was_written(message: Message | None, view: View | None) -> None:
    fragment = Fragment(message, view)
    assert parse_fragment(str(fragment)) == fragment


def test_nothing_is_all_of_a_file() -> None:
    assert str(Fragment()) == ""
    assert parse_fragment("") == Fragment()


def test_a_view_is_written_as_a_person_would() -> None:
    assert str(Fragment(view=View(45.0, 0.0, 75.0))) == "yaw=45&pitch=0&fov=75"


@pytest.mark.parametrize(
    "text",
    [
        "yaw",
        "yaw=1&pitch=0",
        "yaw=x&pitch=0&fov=75",
        "yaw=nan&pitch=0&fov=75",
        "yaw=inf&pitch=0&fov=75",
        "yaw=0&pitch=91&fov=75",
        "yaw=0&pitch=nan&fov=75",
        "yaw=0&pitch=0&fov=0",
        "yaw=0&pitch=0&fov=180",
        "yaw=0&pitch=0&fov=nan",
        "yaw=0&pitch=0&fov=75&zoom=2",
        "topic=a&time_ns=-1&record=0&offset=0&kind=",
        "topic=a&time_ns=1",
    ],
)
def test_what_means_nothing_is_refused(text: str) -> None:
    with pytest.raises(UnusableImage, match="means nothing"):
        parse_fragment(text)


@given(st.text(max_size=40))
def test_any_text_is_a_fragment_or_unusable(text: str) -> None:
    with contextlib.suppress(UnusableImage):
        assert isinstance(parse_fragment(text), Fragment)
