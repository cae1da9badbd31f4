"""The picture in one message of an MCAP file, found by its place in the file."""

import functools
from pathlib import Path, PurePath

from mcap.opcode import Opcode

from contracts.errors import UnusableImage
from survey.fragments import Message
from survey.image_file import regular_file
from survey.mcap.decoders import decode_image
from survey.mcap.framing import (
    MAGIC,
    Damaged,
    Record,
    is_chunk,
    opened_chunk,
    parse_message,
    read_record,
    record_in,
)
from survey.mcap.raw_images import as_netpbm
from survey.stored import State, state_of


def image_bytes(path: str | Path, message: Message) -> bytes:
    """An image file: the compressed one as it was recorded, a raw one as PPM or PGM.

    One record of the file is read. The chunk opened last is kept, since neighbours in it are
    usually asked for next.

    Raises
    ------
    UnusableImage : the file is gone or another one, damaged there, or the message holds no image
        of a known kind.
    """
    try:
        image = decode_image(message.kind, _message_data(str(path), message))
        return as_netpbm(image) if image.raw else bytes(image.data)
    except (Damaged, ValueError) as error:
        raise UnusableImage(
            f"message at byte {message.record} of {PurePath(path).name}: {error}"
        ) from error
    except OSError as error:
        raise UnusableImage(f"cannot be opened: {error.strerror}") from error


def _message_data(path: str, message: Message) -> memoryview:
    """Raises Damaged where no such message is there."""
    record = _top_record(path, state_of(path), message.record)
    if is_chunk(record):
        record = record_in(record.body, message.offset)
    if record.opcode != Opcode.MESSAGE:
        raise Damaged("no message is there; the file has been replaced since it was indexed")
    found = parse_message(record.body)
    if found.log_time_ns != message.time_ns:
        raise Damaged(
            f"its log time is {found.log_time_ns} ns, expected {message.time_ns}; the file has "
            "been replaced since it was indexed"
        )
    return found.data


@functools.lru_cache(maxsize=1)
def _top_record(path: str, state: State, at: int) -> Record:
    """The record at `at`; of a chunk, its opened content. state : a changed file is read again."""
    with regular_file(path) as file:
        if file.read(len(MAGIC)) != MAGIC:
            raise Damaged("the file is not an MCAP file")
        record = read_record(file, at, state.size)
    if is_chunk(record):
        return Record(record.opcode, at, opened_chunk(record.body))
    return record
