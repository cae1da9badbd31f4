"""What the image of a message is called."""

import re
import unicodedata
from datetime import UTC, datetime, timedelta

from survey.mcap.messages import ImageMessage
from survey.times import zoned_time

_SIGNATURES = (
    (b"\xff\xd8\xff", ".jpg"),
    (b"\x89PNG\r\n\x1a\n", ".png"),
    (b"II*\0", ".tif"),
    (b"MM\0*", ".tif"),
    (b"BM", ".bmp"),
    (b"\0\0\0\x0cjP  ", ".jp2"),
    (b"P5", ".pgm"),
    (b"P6", ".ppm"),
)
_HEIF_BRANDS = {b"avif": ".avif", b"heic": ".heic", b"heix": ".heic", b"mif1": ".heic"}
_UNPRINTABLE = re.compile(r"[\x00-\x1f\x7f\ud800-\udfff]")
_FIRST_CLOCK_NS = 946_684_800_000_000_000
"""The year 2000: clocks of simulations, and of machines without one, begin at 0."""
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


def message_uri(prefix: str, topic: str, time_ns: int, suffix: str) -> str:
    """`prefix` + topic/seconds.nanoseconds + suffix, without steps that lead elsewhere."""
    pieces = [
        piece
        for piece in _UNPRINTABLE.sub("\ufffd", topic).split("/")
        if piece not in ("", ".", "..")
    ]
    seconds, nanoseconds = divmod(time_ns, 1_000_000_000)
    name = f"{seconds}.{nanoseconds:09d}{suffix}"
    return prefix + unicodedata.normalize("NFC", "/".join([*pieces, name]))


def image_suffix(image: ImageMessage) -> str | None:
    """What an image file with these bytes ends in, whatever the message calls it; None: no known
    image."""
    if image.raw:
        return ".pgm" if image.encoding.lower() in ("mono8", "mono16", "8uc1") else ".ppm"
    head = bytes(image.data[:16])
    if head[:4] == b"RIFF" and head[8:12] == b"WEBP":
        return ".webp"
    if head[4:8] == b"ftyp":
        return _HEIF_BRANDS.get(head[8:12])
    return next((suffix for start, suffix in _SIGNATURES if head.startswith(start)), None)


def moment(time_ns: int) -> str | None:
    """ISO 8601 in UTC, to the microsecond; None where the clock was not set."""
    if time_ns < _FIRST_CLOCK_NS:
        return None
    return zoned_time((_EPOCH + timedelta(microseconds=time_ns // 1000)).isoformat())
