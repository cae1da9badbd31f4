"""Which messages are understood."""

from survey.mcap import foxglove, ros2
from survey.mcap.messages import ImageMessage, Said

_DECODERS = {**foxglove.DECODERS, **ros2.DECODERS}
KINDS = frozenset(_DECODERS)
_IMAGE_TYPES = ("CompressedImage", "RawImage", "sensor_msgs/msg/Image")
IMAGE_KINDS = frozenset(kind for kind in KINDS if kind.endswith(_IMAGE_TYPES))


def decode(kind: str, data: memoryview) -> tuple[Said, ...]:
    """What a message says.

    Raises
    ------
    ValueError : it does not hold. KeyError : a kind that is not in `KINDS`.
    """
    return _DECODERS[kind](data)


def decode_image(kind: str, data: memoryview) -> ImageMessage:
    """The picture in a message of one of `IMAGE_KINDS`; raises ValueError for any other."""
    if kind not in IMAGE_KINDS:
        raise ValueError(f"is of kind {kind[:80]!r}, which holds no image")
    (said,) = decode(kind, data)
    if not isinstance(said, ImageMessage):
        raise ValueError(f"is of kind {kind!r} and holds no image")
    return said
