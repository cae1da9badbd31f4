"""What people write as dates, and the instants that these span."""

import numpy as np
import pytest

from contracts.config import Where
from contracts.dates import span_of
from contracts.errors import BadConfig


@pytest.mark.parametrize(
    ("text", "begin", "end"),
    [
        ("2024", "2024-01-01", "2025-01-01"),
        ("2024-12", "2024-12-01", "2025-01-01"),
        ("2024-02-29", "2024-02-29", "2024-03-01"),
        ("2024-06-16T10:00+02:00", "2024-06-16T08:00", "2024-06-16T08:00:00.000001"),
        ("2024-06-16T10:00", "2024-06-16T10:00", "2024-06-16T10:00:00.000001"),
        ("2024-06-16 10:00:00.5Z", "2024-06-16T10:00:00.5", "2024-06-16T10:00:00.500001"),
    ],
)
def test_a_date_spans_all_that_it_names(text: str, begin: str, end: str) -> None:
    assert span_of(text) == (np.datetime64(begin, "us"), np.datetime64(end, "us"))


@pytest.mark.parametrize(
    "text",
    ["", "16/06/2024", "2024-13", "2023-02-29", "20240616", "2024-W05", "2024-06-16T25:00", "now",
     "0001-01-01T00:00+05:00", "٢٠٢٤"],
)  # fmt: skip
def test_what_is_no_date_is_refused_by_its_text(text: str) -> None:
    with pytest.raises(BadConfig, match="is no date; expected a year, month, day or moment"):
        span_of(text)


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ({"since": "2024-06-17", "until": "2024-06-16"}, "until 2024-06-16 lies before since"),
        ({"until": "tomorrow"}, "'tomorrow' is no date"),
        ({"bbox": (2.0, 49.0, 3.0, 48.0)}, "a box takes west,south,east,north"),
        ({"bbox": (2.0, 48.0, 361.0, 49.0)}, "a box takes west,south,east,north"),
        ({"bbox": (float("nan"), 48.0, 3.0, 49.0)}, "a box takes west,south,east,north"),
        ({"heading": (180.0, 181.0)}, "got 180±181"),
        ({"heading": (float("inf"), 10.0)}, "got inf±10"),
    ],
)
def test_conditions_that_make_no_sense_are_refused(settings: dict, says: str) -> None:
    with pytest.raises(BadConfig, match=says):
        Where.of(**settings)


def test_a_day_alone_can_be_both_ends() -> None:
    assert Where.of(since="2024-06-16", until="2024-06-16") != Where()
