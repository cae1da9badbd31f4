"""MCAP files as they are found: every layout, unfinished, damaged, and made to do harm."""

import io
import struct
import tracemalloc
from dataclasses import replace
from pathlib import Path

import pytest
import zstandard
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.records import Channel, Chunk, Footer, Schema
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, IndexType, Writer
from mcap_drives import CAMERA, Protobuf, drive, jpeg

from contracts.errors import BadSurvey, UnusableImage, WrongInput
from survey.fragments import Message, parse_fragment
from survey.mcap.contents import Damage, read_messages
from survey.mcap.payload import image_bytes
from survey.mcap.reader import READER
from survey.options import Reading, ReadOptions

MAGIC = b"\x89MCAP0\r\n"
LAYOUTS = {
    "zstd": {"compression": CompressionType.ZSTD},
    "lz4": {"compression": CompressionType.LZ4},
    "none": {"compression": CompressionType.NONE},
    "no chunks": {"use_chunking": False},
    "no index": {"index_types": IndexType.NONE},
    "no summary": {
        "index_types": IndexType.NONE,
        "repeat_channels": False,
        "repeat_schemas": False,
        "use_statistics": False,
        "use_summary_offsets": False,
    },
    "no message index": {"index_types": IndexType.CHUNK},
    "no channels in the summary": {"repeat_channels": False, "repeat_schemas": False},
    "one chunk": {"chunk_size": 1 << 20},
    "no checksums": {"enable_crcs": False},
}


def read(path: Path) -> Reading:
    return READER.read(path, ReadOptions(), lambda uri: True)


def pictures(reading: Reading) -> list[bytes]:
    found = []
    for image in sorted(reading.images, key=lambda image: image.uri):
        message = parse_fragment(image.fragment).message
        assert message is not None
        found.append(image_bytes(image.path, message))
    return found


def written(path: Path, **layout: object) -> Path:
    """The drive with another layout, by the library's own writer."""
    said = drive(Protobuf())
    with path.open("wb") as file:
        writer = Writer(file, **{"chunk_size": 2048, **layout})  # type: ignore[arg-type]
        writer.start()
        channels: dict[str, int] = {}
        for item in said:
            if item.topic not in channels:
                schema = item.schema.get_schema()
                number = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[item.topic] = writer.register_channel(item.topic, "protobuf", number)
            writer.add_message(
                channels[item.topic], item.time_ns, item.content.encode(), item.time_ns
            )
        writer.finish()
    return path


@pytest.mark.parametrize("layout", sorted(LAYOUTS))
def test_every_layout_gives_the_same_images_and_poses(layout, tmp_path):
    reading = read(written(tmp_path / "drive.mcap", **LAYOUTS[layout]))
    plain = read(written(tmp_path / "plain.mcap"))
    assert [image.pose for image in reading.images] == [image.pose for image in plain.images]
    assert pictures(reading) == [jpeg(number) for number in range(5)]
    assert (reading.notes, reading.skipped) == ((), ())


def test_a_file_cut_anywhere_gives_what_comes_before_the_cut(tmp_path):
    whole = written(tmp_path / "whole.mcap", index_types=IndexType.CHUNK).read_bytes()
    cut = tmp_path / "cut.mcap"

    @given(st.integers(0, len(whole) - 1))
    @settings(max_examples=300, deadline=None)
    def check(length):
        cut.write_bytes(whole[:length])
        try:
            reading = read(cut)
        except BadSurvey:
            assert length < whole.index(b"/right/image")
            return
        assert pictures(reading) == [jpeg(number) for number in range(len(reading.images))]
        # After the data there is nothing that is missed.
        if not reading.notes:
            assert len(reading.images) == 5
        else:
            assert "read as far as byte" in reading.notes[0]

    check()


def test_a_cut_is_reported_with_its_place_and_time(tmp_path):
    whole = written(tmp_path / "whole.mcap", compression=CompressionType.NONE).read_bytes()
    (tmp_path / "cut.mcap").write_bytes(whole[: whole.index(jpeg(3)) + 10])
    reading = read(tmp_path / "cut.mcap")
    assert 0 < len(reading.images) < 5
    note = reading.notes[0]
    assert f"of {whole.index(jpeg(3)) + 10}, log time 17000000" in note


def test_bytes_changed_anywhere_never_crash(tmp_path):
    whole = written(tmp_path / "whole.mcap").read_bytes()
    changed = tmp_path / "changed.mcap"

    @given(st.lists(st.tuples(st.integers(8, len(whole) - 1), st.integers(0, 255)), max_size=8))
    @settings(max_examples=200, deadline=None)
    def check(changes):
        data = bytearray(whole)
        for at, value in changes:
            data[at] = value
        changed.write_bytes(data)
        try:
            reading = read(changed)
        except WrongInput:
            return
        for image in reading.images:
            message = parse_fragment(image.fragment).message
            assert message is not None
            image_bytes(image.path, message)

    check()


def test_a_damaged_chunk_is_left_out_and_counted(tmp_path):
    path = written(tmp_path / "drive.mcap", compression=CompressionType.NONE, chunk_size=1)
    data = bytearray(path.read_bytes())
    at = data.index(jpeg(2))
    data[at + 100] ^= 0xFF
    path.write_bytes(data)
    reading = read(path)
    assert jpeg(2) not in pictures(reading)
    assert len(reading.images) == 4
    (note,) = reading.notes
    assert "1 damaged chunks" in note
    assert "CRC-32" in note


def one_chunk(path: Path, chunk: Chunk) -> Path:
    out = io.BytesIO()
    builder = _records()
    Schema(data=b"", encoding="protobuf", id=1, name="foxglove.CompressedImage").write(builder)
    Channel(id=1, schema_id=1, topic="/c", message_encoding="protobuf", metadata={}).write(builder)
    chunk.write(builder)
    Footer(0, 0, 0).write(builder)
    out.write(MAGIC + builder.end() + MAGIC)
    path.write_bytes(out.getvalue())
    return path


def _records():
    from mcap.data_stream import RecordBuilder

    return RecordBuilder()


@pytest.mark.parametrize("stated", [100, 1 << 40])
def test_a_chunk_that_lies_about_its_size_is_not_unpacked(stated, tmp_path):
    bomb = zstandard.ZstdCompressor().compress(bytes(200_000_000))
    chunk = Chunk("zstd", bomb, 0, 0, 0, stated)
    path = one_chunk(tmp_path / "bomb.mcap", chunk)
    tracemalloc.start()
    (damage,) = read_messages(path, lambda topic: True)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert isinstance(damage, Damage)
    assert f"states {stated} bytes" in damage.reason
    assert peak < 5_000_000


def test_a_record_longer_than_its_file_ends_the_reading(tmp_path):
    path = tmp_path / "long.mcap"
    path.write_bytes(MAGIC + struct.pack("<BQ", 6, 1 << 62) + b"x")
    (damage,) = read_messages(path, lambda topic: True)
    assert isinstance(damage, Damage)
    assert damage.ended


def test_a_message_deeper_than_any_stack_is_skipped(tmp_path):
    path = tmp_path / "deep.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("foxglove.CompressedImage", "jsonschema", b"{}")
        channel = writer.register_channel("/c", "json", schema)
        writer.add_message(channel, 5, b'{"data":' + b"[" * 1_000_000, 5)
        writer.add_message(channel, 6, b"\xff{}", 6)
        writer.add_message(channel, 7, b"[]", 7)
        writer.finish()
    with pytest.raises(BadSurvey):
        read(path)
    reading = READER.read(path, ReadOptions(no_pose=True), lambda uri: True)
    assert [skip.uri for skip in reading.skipped] == [
        "c/0.000000005",
        "c/0.000000006",
        "c/0.000000007",
    ]


def test_topics_cannot_name_files_outside_the_survey(tmp_path):
    path = tmp_path / "up.mcap"
    dialect = Protobuf()
    said = [
        dialect.image("/../../etc/./pass\nwd", 0.0, CAMERA, jpeg(0)),
        dialect.fix("/fix", 0.0, CAMERA, 2.0, 48.0, 0.0),
    ]
    dialect.write(path, said)
    (image,) = read(path).images
    assert image.uri == "etc/pass�wd/1700000000.000000000.jpg"


def test_an_image_is_found_by_its_place_and_nothing_else(tmp_path):
    path = written(tmp_path / "drive.mcap")
    image = read(path).images[0]
    message = parse_fragment(image.fragment).message
    assert message is not None
    assert image_bytes(path, message) == jpeg(0)
    wrong = replace(message, time_ns=message.time_ns + 1)
    with pytest.raises(UnusableImage, match="replaced since"):
        image_bytes(path, wrong)
    with pytest.raises(UnusableImage, match="holds no image"):
        image_bytes(path, Message("/c", message.time_ns, message.record, message.offset, "cdr:x/y"))
    with pytest.raises(UnusableImage):
        image_bytes(path, Message("/c", 0, 1 << 50, 0, message.kind))
    path.write_bytes(b"not an MCAP file any more, but long enough to be read")
    with pytest.raises(UnusableImage, match="not an MCAP"):
        image_bytes(path, message)
    path.unlink()
    with pytest.raises(UnusableImage, match="cannot be opened"):
        image_bytes(path, message)


def test_chunks_without_anything_asked_for_are_not_opened(tmp_path):
    """Chunks of other topics hold rubbish: opening one would be noticed."""
    path = tmp_path / "drive.mcap"
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=1, compression=CompressionType.NONE)
        writer.start()
        schema = writer.register_schema("sensor_msgs/msg/PointCloud2", "ros2msg", b"")
        other = writer.register_channel("/points", "cdr", schema)
        for number in range(50):
            writer.add_message(other, number, b"POINTS" * 100, number)
        writer.finish()
    data = path.read_bytes()
    path.write_bytes(data.replace(b"POINTS", b"RUBBLE"))
    opened = list(read_messages(path, lambda topic: topic.name == "/points"))
    assert len(opened) == 50
    assert all(isinstance(item, Damage) for item in opened)
    assert list(read_messages(path, lambda topic: False)) == []


def test_memory_does_not_grow_with_the_pictures(tmp_path):
    path = tmp_path / "long.mcap"
    dialect = Protobuf()
    noise = jpeg(0) + bytes(200_000)
    said = [dialect.image("/c", float(at), CAMERA, noise) for at in range(300)]
    said += [dialect.fix("/fix", float(at), CAMERA, 2.0, 48.0, 1.0) for at in range(300)]
    dialect.write(path, sorted(said, key=lambda item: item.time_ns), compression=None)
    assert path.stat().st_size > 60_000_000
    read(path)
    tracemalloc.start()
    assert len(read(path).images) == 300
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 4_000_000


def test_the_library_reads_what_the_fixtures_write(tmp_path):
    path = written(tmp_path / "drive.mcap")
    with path.open("rb") as file:
        assert sum(1 for _ in StreamReader(file, validate_crcs=True).records) > 20
