"""How an MCAP file is cut into records, and how a chunk is opened.

The records themselves are parsed by the `mcap` library. Its readers give neither the place of a
message in the file nor a bound on what a damaged or hostile file makes them hold, so the cutting
is done here: https://mcap.dev/spec.
"""

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO
from typing import BinaryIO

import lz4.frame
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode

MAGIC = b"\x89MCAP0\r\n"
MAX_RECORD_BYTES = 1 << 30
"""No photograph is larger; a length beyond it is damage or malice, and is not allocated."""

_HEADER = struct.Struct("<BQ")
HEADER_BYTES = _HEADER.size
_CHUNK = struct.Struct("<QQQII")
_MESSAGE = struct.Struct("<HIQQ")

PARSE_ERRORS = (McapError, struct.error, UnicodeDecodeError)
"""What the library raises on a record that means nothing."""


class Damaged(Exception):
    """A record cannot be read; the message says why."""


@dataclass(frozen=True, slots=True)
class Record:
    """One record. at : byte offset of its header in the file, or in the opened chunk."""

    opcode: int
    at: int
    body: memoryview


@dataclass(frozen=True, slots=True)
class MessageRecord:
    """A message record, parsed without a copy of its data."""

    channel_id: int
    log_time_ns: int
    data: memoryview


def record_size(file: BinaryIO, at: int, file_bytes: int) -> tuple[int, int]:
    """Opcode and body length of the record at `at`; the file is left at the body.

    Raises
    ------
    Damaged : the file ends before the record does, or the record is too large to be true.
    """
    file.seek(at)
    header = file.read(HEADER_BYTES)
    if len(header) < HEADER_BYTES:
        raise Damaged("the file ends here in the middle of a record")
    opcode, length = _HEADER.unpack(header)
    if opcode == 0:
        raise Damaged("no record begins here (opcode 0)")
    if length > file_bytes - at - HEADER_BYTES:
        raise Damaged(
            f"the file ends {length - (file_bytes - at - HEADER_BYTES)} bytes before the end of "
            "the record that begins here"
        )
    return opcode, length


def read_record(file: BinaryIO, at: int, file_bytes: int) -> Record:
    """The whole record at `at`.

    Raises
    ------
    Damaged : as `record_size`, or larger than a record of interest may be.
    """
    opcode, length = record_size(file, at, file_bytes)
    if length > MAX_RECORD_BYTES:
        raise Damaged(f"the record is {length} bytes long, more than {MAX_RECORD_BYTES}")
    return Record(opcode, at, memoryview(file.read(length)))


def records_in(chunk: memoryview) -> Iterator[Record]:
    """The records of an opened chunk.

    Raises
    ------
    Damaged : the chunk ends in the middle of one.
    """
    at = 0
    while at < len(chunk):
        record = record_in(chunk, at)
        yield record
        at += HEADER_BYTES + len(record.body)


def record_in(chunk: memoryview, at: int) -> Record:
    """The record at `at` of an opened chunk.

    Raises
    ------
    Damaged : the chunk ends before the record does.
    """
    if at + HEADER_BYTES > len(chunk):
        raise Damaged("a chunk ends in the middle of a record")
    opcode, length = _HEADER.unpack_from(chunk, at)
    begin = at + HEADER_BYTES
    if length > len(chunk) - begin:
        raise Damaged("a chunk ends in the middle of a record")
    return Record(opcode, at, chunk[begin : begin + length])


def parse_message(body: memoryview) -> MessageRecord:
    """A message record.

    Raises
    ------
    Damaged : too short to be one.
    """
    if len(body) < _MESSAGE.size:
        raise Damaged("a message record is too short")
    channel_id, _, log_time_ns, _ = _MESSAGE.unpack_from(body)
    return MessageRecord(channel_id, log_time_ns, body[_MESSAGE.size :])


def stream(body: memoryview) -> ReadDataStream:
    """What the library parses records from."""
    return ReadDataStream(BytesIO(body))


def opened_chunk(body: memoryview) -> memoryview:
    """The records of a chunk record, decompressed and checked.

    At most the stated size is ever decompressed, and a stated size beyond `MAX_RECORD_BYTES` is
    refused, so that a small file cannot fill the memory.

    Raises
    ------
    Damaged : the sizes or the checksum do not hold, or the compression is unknown.
    """
    if len(body) < _CHUNK.size:
        raise Damaged("a chunk record is too short")
    _, _, size, checksum, name_bytes = _CHUNK.unpack_from(body)
    at = _CHUNK.size + name_bytes
    if at + 8 > len(body):
        raise Damaged("a chunk record is too short")
    compression = bytes(body[_CHUNK.size : at]).decode("ascii", "replace")
    (stored_bytes,) = struct.unpack_from("<Q", body, at)
    stored = body[at + 8 : at + 8 + stored_bytes]
    if size > MAX_RECORD_BYTES:
        raise Damaged(f"a chunk states {size} bytes of content, more than {MAX_RECORD_BYTES}")
    content = _decompressed(stored, compression, size)
    if len(content) != size:
        raise Damaged(f"a chunk states {size} bytes of content and does not hold as many")
    if checksum and zlib.crc32(content) != checksum:
        raise Damaged("a chunk's checksum (CRC-32) does not match its content")
    return content


def _decompressed(stored: memoryview, compression: str, size: int) -> memoryview:
    """At most one byte more than `size`, which shows that there is more."""
    try:
        if compression == "":
            return stored
        if compression == "zstd":
            with zstandard.ZstdDecompressor().stream_reader(stored) as reader:
                return memoryview(reader.read(size + 1))
        if compression == "lz4":
            content = lz4.frame.LZ4FrameDecompressor().decompress(stored, max_length=size + 1)
            return memoryview(content)
    except (zstandard.ZstdError, RuntimeError, EOFError, MemoryError) as error:
        raise Damaged(f"a chunk cannot be decompressed ({compression}): {error}") from error
    raise Damaged(f"a chunk is compressed with {compression[:20]!r}, which is not known")


def is_chunk(record: Record) -> bool:
    """Whether a record holds others."""
    return record.opcode == Opcode.CHUNK
