"""Moments of capture, as ISO 8601 with a zone."""

from datetime import datetime


def zoned_time(text: str) -> str | None:
    """`text` as ISO 8601, or None if it is no moment with a zone.

    A time without a zone may be off by half a day, so it is not written down as if it were known.
    """
    try:
        moment = datetime.fromisoformat(text.strip())
    except ValueError:
        return None
    if moment.tzinfo is None:
        return None
    precision = "auto" if moment.microsecond % 1000 else "milliseconds"
    if not moment.microsecond:
        precision = "seconds"
    return moment.isoformat(timespec=precision).replace("+00:00", "Z")
