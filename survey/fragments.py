"""What within a file is one image: written behind `#` of its uri, and read again to decode it.

A query string, as in `drive.mcap#topic=%2Fcam&time_ns=17000&record=4096` or
`pano.jpg#yaw=90&pitch=0&fov=90`; both parts together for a panorama inside an MCAP file.
"""

import math
from dataclasses import dataclass
from urllib.parse import parse_qsl, urlencode

from contracts.errors import UnusableImage


@dataclass(frozen=True, slots=True)
class Message:
    """A message of an MCAP file, found and decoded without an index or the channels' records.

    time_ns : its log time. record : byte offset in the file of the record that holds it, a chunk
    or the message itself. offset : byte offset of the message in the opened chunk, 0 without one.
    kind : encoding and type, `cdr:sensor_msgs/msg/Image`.
    """

    topic: str
    time_ns: int
    record: int
    offset: int = 0
    kind: str = ""


@dataclass(frozen=True, slots=True)
class View:
    """A square perspective view cut from an equirectangular panorama.

    yaw_deg : clockwise from the panorama's middle column. pitch_deg : up positive.
    fov_deg : horizontal and vertical field of view, above 0 and below 180.
    """

    yaw_deg: float
    pitch_deg: float
    fov_deg: float


@dataclass(frozen=True, slots=True)
class Fragment:
    """Which message holds the image, and which view of it is meant; None: all of it."""

    message: Message | None = None
    view: View | None = None

    def __str__(self) -> str:
        fields: dict[str, str] = {}
        if self.message is not None:
            fields |= {
                "topic": self.message.topic,
                "time_ns": str(self.message.time_ns),
                "record": str(self.message.record),
                "offset": str(self.message.offset),
                "kind": self.message.kind,
            }
        if self.view is not None:
            fields |= {
                "yaw": f"{self.view.yaw_deg:g}",
                "pitch": f"{self.view.pitch_deg:g}",
                "fov": f"{self.view.fov_deg:g}",
            }
        return urlencode(fields)


def parse_fragment(text: str) -> Fragment:
    """The inverse of `str(fragment)`; "" is all of a file.

    Raises
    ------
    UnusableImage : not a fragment.
    """
    try:
        fields = dict(parse_qsl(text, keep_blank_values=True, strict_parsing=bool(text)))
        message = view = None
        if "topic" in fields:
            time_ns, record, offset = (
                int(fields.pop(name)) for name in ("time_ns", "record", "offset")
            )
            if min(time_ns, record, offset) < 0:
                raise ValueError("negative")
            message = Message(fields.pop("topic"), time_ns, record, offset, fields.pop("kind"))
        if "yaw" in fields:
            yaw, pitch, fov = (float(fields.pop(name)) for name in ("yaw", "pitch", "fov"))
            if not (math.isfinite(yaw) and abs(pitch) <= 90.0 and 0.0 < fov < 180.0):
                raise ValueError("out of range")
            view = View(yaw, pitch, fov)
        if fields:
            raise ValueError("unknown fields")
    except (KeyError, ValueError) as error:
        raise UnusableImage(f"has a fragment that means nothing: {text[:80]!r}") from error
    return Fragment(message, view)
