"""What the specification of MCAP allows and recorders do: any order, several cameras."""

import math
from pathlib import Path

import pytest
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from google.protobuf.timestamp_pb2 import Timestamp
from mcap.writer import CompressionType, Writer
from mcap_drives import CAMERA, DIALECTS, LOOKING_RIGHT, Protobuf, Said, drive, jpeg, ns

from survey.mcap.reader import READER
from survey.options import Reading, ReadOptions


def read(path: Path) -> Reading:
    return READER.read(path, ReadOptions(), lambda uri: True)


def by_time(reading: Reading) -> list[object]:
    return [image.pose for image in sorted(reading.images, key=lambda image: image.uri)]


@pytest.mark.parametrize("dialect", sorted(DIALECTS))
def test_messages_may_be_stored_in_any_order(dialect: str, tmp_path: Path) -> None:
    said = drive(DIALECTS[dialect]())
    DIALECTS[dialect]().write(tmp_path / "ordered.mcap", said)
    DIALECTS[dialect]().write(tmp_path / "turned.mcap", said[::-1])
    ordered, turned = read(tmp_path / "ordered.mcap"), read(tmp_path / "turned.mcap")
    assert len(ordered.images) == 5
    assert by_time(turned) == by_time(ordered)


def test_two_cameras_of_one_drive_are_told_apart(tmp_path: Path) -> None:
    dialect = Protobuf()
    said = drive(dialect)
    said += [dialect.transform("/tf_static", 0.0, "base_link", "left", (0, 0, 0), LEFT)]
    said += [dialect.image("/left/image", 0.25 + at, "left", jpeg(9)) for at in range(3)]
    dialect.write(tmp_path / "drive.mcap", sorted(said, key=lambda item: item.time_ns))
    images = read(tmp_path / "drive.mcap").images
    of_camera = {
        name: [image for image in images if image.camera.name == name] for name in (CAMERA, "left")
    }
    assert {name: len(found) for name, found in of_camera.items()} == {CAMERA: 5, "left": 3}
    right, left = (sorted(found, key=lambda image: image.uri) for found in of_camera.values())
    for one, other in zip(right, left, strict=False):
        assert one.captured_at == other.captured_at
        assert one.pose is not None
        assert other.pose is not None
        apart = (one.pose.heading_deg or 0.0) - (other.pose.heading_deg or 0.0)
        assert apart % 360.0 == pytest.approx(180.0)
    assert [image.camera.hfov_deg is None for image in (right[0], left[0])] == [False, True]


LEFT = (-math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))
"""Image right = x, down = -z, axis = y of a body with y left, z up."""


def test_a_single_transform_of_foxglove_mounts_a_camera(tmp_path: Path) -> None:
    dialect = Protobuf()
    said = [item for item in drive(dialect) if item.topic != "/tf_static"]
    dialect.write(tmp_path / "whole.mcap", drive(dialect))
    path = tmp_path / "single.mcap"
    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType.NONE)
        writer.start()
        schema = writer.register_schema("foxglove.FrameTransform", "protobuf", b"")
        single = writer.register_channel("/mounting", "protobuf", schema)
        for child, at, turn in (
            (CAMERA, (1.5, -0.4, 1.9), LOOKING_RIGHT),
            ("gnss", (0.2, 0.0, 2.1), (0.0, 0.0, 0.0, 1.0)),
        ):
            message = FrameTransform(parent_frame_id="base_link", child_frame_id=child)
            message.timestamp.CopyFrom(_stamp(0.0))
            message.translation.x, message.translation.y, message.translation.z = at
            rotation = message.rotation
            rotation.x, rotation.y, rotation.z, rotation.w = turn
            writer.add_message(single, ns(0.0), message.SerializeToString(), ns(0.0))
        _add(writer, said)
        writer.finish()
    assert by_time(read(path)) == by_time(read(tmp_path / "whole.mcap"))


def _stamp(seconds: float) -> Timestamp:
    return Timestamp(seconds=ns(seconds) // 10**9, nanos=ns(seconds) % 10**9)


def _add(writer: Writer, said: list[Said]) -> None:
    channels: dict[str, int] = {}
    for item in said:
        if item.topic not in channels:
            schema = item.schema.get_schema()
            number = writer.register_schema(schema.name, schema.encoding, schema.data)
            channels[item.topic] = writer.register_channel(item.topic, "protobuf", number)
        writer.add_message(channels[item.topic], item.time_ns, item.content.encode(), item.time_ns)
