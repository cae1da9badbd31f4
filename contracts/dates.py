"""Dates as people write them, such as 2024, 2024-06, 2024-06-16 or 2024-06-16T10:00+02:00."""

import re
from datetime import UTC, datetime

import numpy as np

from contracts.errors import BadConfig

_CALENDAR = re.compile(r"\d{4}(-\d{2}(-\d{2})?)?", re.ASCII)
_CLOCK = re.compile(r"\d{4}-\d{2}-\d{2}[T ].+", re.ASCII)


def span_of(text: str) -> tuple[np.datetime64, np.datetime64]:
    """The first instant of a year, month, day or moment, and the first one after it.

    Returns
    -------
    begin, end : datetime64[us] in UTC, which is also the zone of what names none. A moment is a
    microsecond long.

    Raises
    ------
    BadConfig : not ISO 8601, or no such day.
    """
    try:
        if _CALENDAR.fullmatch(text):
            begin = np.datetime64(text)
            return begin.astype("datetime64[us]"), (begin + 1).astype("datetime64[us]")
        if _CLOCK.fullmatch(text):
            moment = utc_instant(datetime.fromisoformat(text))
            return moment, moment + np.timedelta64(1, "us")
    except (ValueError, OverflowError):
        pass
    raise BadConfig(
        f"{text!r} is no date; expected a year, month, day or moment such as 2024, 2024-06, "
        "2024-06-16 or 2024-06-16T10:00+02:00"
    )


def utc_instant(moment: datetime) -> np.datetime64:
    """The same instant as datetime64[us] in UTC; without a zone it is taken as UTC.

    Raises
    ------
    OverflowError : it is before the year 1 or after 9999 in UTC.
    """
    aware = moment if moment.tzinfo else moment.replace(tzinfo=UTC)
    return np.datetime64(aware.astimezone(UTC).replace(tzinfo=None), "us")
