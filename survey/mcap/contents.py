"""The messages of an MCAP file, in the order in which they are stored.

An indexed file is read by its chunk indexes, and chunks that hold nothing asked for are not
opened. Without an index, or with a damaged one, the file is walked from its beginning for as far
as it goes. Either way one chunk is held at a time.
"""

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import BinaryIO

from mcap.opcode import Opcode
from mcap.records import Channel, ChunkIndex, Footer, Schema

from contracts.places import Place
from survey.mcap.framing import (
    HEADER_BYTES,
    MAGIC,
    PARSE_ERRORS,
    Damaged,
    MessageRecord,
    Record,
    is_chunk,
    opened_chunk,
    parse_message,
    read_record,
    record_size,
    records_in,
    stream,
)
from survey.stored import open_place

_FOOTER_BYTES = HEADER_BYTES + 20
_END = frozenset({int(Opcode.DATA_END), int(Opcode.FOOTER)})
_MAX_SUMMARY_BYTES = 1 << 28
_READ_AHEAD_BYTES = 1 << 23
"""Of a file in a store: some chunks, as it is mostly read from its beginning to its end."""


@dataclass(frozen=True, slots=True)
class Topic:
    """A channel. kind : encoding and type of its messages, `cdr:sensor_msgs/msg/Image`."""

    name: str
    kind: str


@dataclass(frozen=True, slots=True)
class Stored:
    """A message and where it is.

    record : byte offset in the file of the chunk, or of the message itself. offset : of the
    message within the opened chunk, 0 for a message that is in none.
    """

    topic: Topic
    log_time_ns: int
    data: memoryview
    record: int
    offset: int


@dataclass(frozen=True, slots=True)
class Damage:
    """Something that could not be read. at : byte offset. ended : reading ended there."""

    at: int
    reason: str
    ended: bool = False


@dataclass(slots=True)
class _Names:
    """Schemas and channels by their ids, as far as they have been met."""

    schemas: dict[int, str] = field(default_factory=dict)
    topics: dict[int, Topic] = field(default_factory=dict)

    def meet(self, record: Record) -> None:
        """Raises PARSE_ERRORS."""
        if record.opcode == Opcode.SCHEMA:
            schema = Schema.read(stream(record.body))
            self.schemas[schema.id] = schema.name
        elif record.opcode == Opcode.CHANNEL:
            channel = Channel.read(stream(record.body))
            schema_name = self.schemas.get(channel.schema_id, "")
            kind = message_kind(channel.message_encoding, schema_name)
            self.topics[channel.id] = Topic(channel.topic, kind)


def message_kind(encoding: str, schema_name: str) -> str:
    """`encoding:type`, with the ROS 2 spelling `pkg/Type` written as `pkg/msg/Type`."""
    package, _, name = schema_name.partition("/")
    if encoding == "cdr" and name and "/" not in name:
        schema_name = f"{package}/msg/{name}"
    return f"{encoding}:{schema_name}"


def read_messages(path: Place, wanted: Callable[[Topic], bool]) -> Iterator[Stored | Damage]:
    """Every message of the topics asked for, and what could not be read.

    Raises
    ------
    OSError : the file cannot be opened or read.
    """
    with open_place(path, _READ_AHEAD_BYTES) as file:
        file_bytes = file.seek(0, os.SEEK_END)
        summary = _summary(file, file_bytes)
        if summary is not None and summary[1]:
            yield from _indexed(file, file_bytes, summary[0], summary[1], wanted)
        else:
            yield from _walked(file, file_bytes, wanted)


def _summary(file: BinaryIO, file_bytes: int) -> tuple[_Names, list[ChunkIndex]] | None:
    """Names and chunk indexes of the summary section; None where there is none that holds."""
    footer_at = file_bytes - len(MAGIC) - _FOOTER_BYTES
    try:
        record = read_record(file, footer_at, file_bytes) if footer_at > 0 else None
        if record is None or record.opcode != Opcode.FOOTER:
            return None
        at = Footer.read(stream(record.body)).summary_start
        if not 0 < at < footer_at or footer_at - at > _MAX_SUMMARY_BYTES:
            return None
        file.seek(at)
        names, chunks = _Names(), {}
        for record in records_in(memoryview(file.read(footer_at - at))):
            names.meet(record)
            if record.opcode == Opcode.CHUNK_INDEX:
                index = ChunkIndex.read(stream(record.body))
                chunks[index.chunk_start_offset] = index
    except (Damaged, *PARSE_ERRORS):
        return None
    return names, [chunks[at] for at in sorted(chunks)]


def _indexed(
    file: BinaryIO,
    file_bytes: int,
    names: _Names,
    chunks: list[ChunkIndex],
    wanted: Callable[[Topic], bool],
) -> Iterator[Stored | Damage]:
    for chunk in chunks:
        # A chunk without message indexes, or with a channel the summary does not name, may hold
        # anything.
        topics = [names.topics.get(number) for number in chunk.message_index_offsets]
        if topics and not any(topic is None or wanted(topic) for topic in topics):
            continue
        at = chunk.chunk_start_offset
        try:
            record = read_record(file, at, file_bytes)
            if not is_chunk(record):
                raise Damaged("the index promises a chunk that is not there")
        except Damaged as error:
            yield Damage(at, str(error))
            continue
        yield from _messages_of(record, names, wanted)


def _walked(
    file: BinaryIO, file_bytes: int, wanted: Callable[[Topic], bool]
) -> Iterator[Stored | Damage]:
    names, at = _Names(), len(MAGIC)
    while True:
        try:
            opcode, length = record_size(file, at, file_bytes)
            if opcode in _END:
                return
            if opcode in _READ:
                yield from _messages_of(read_record(file, at, file_bytes), names, wanted)
        except Damaged as error:
            yield Damage(at, str(error), ended=True)
            return
        at += HEADER_BYTES + length


_READ = frozenset(map(int, (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.CHUNK, Opcode.MESSAGE)))


def _messages_of(
    top: Record, names: _Names, wanted: Callable[[Topic], bool]
) -> Iterator[Stored | Damage]:
    """The messages of one record of the file: of a chunk, or the one message that it is."""
    try:
        inner = records_in(opened_chunk(top.body)) if is_chunk(top) else iter((top,))
        for record in inner:
            if record.opcode == Opcode.MESSAGE:
                message = parse_message(record.body)
                topic = names.topics.get(message.channel_id)
                if topic is None:
                    yield Damage(top.at, f"a message of the unknown channel {message.channel_id}")
                elif wanted(topic):
                    offset = record.at if is_chunk(top) else 0
                    yield _stored(topic, message, top.at, offset)
            else:
                names.meet(record)
    except (Damaged, *PARSE_ERRORS) as error:
        yield Damage(top.at, str(error) or type(error).__name__)


def _stored(topic: Topic, message: MessageRecord, record: int, offset: int) -> Stored:
    return Stored(topic, message.log_time_ns, message.data, record, offset)
