"""Single messages: both byte orders of CDR, old spellings, and messages that end too early."""

import contextlib
import json
import struct

import foxglove.messages as fox
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.writer import Writer
from mcap_drives import DIALECTS, Ros2, ns, ros_types
from mcap_ros2.writer import Writer as Ros2Writer

from survey.mcap.cdr import Cdr
from survey.mcap.contents import Stored, message_kind, read_messages
from survey.mcap.decoders import KINDS, decode
from survey.mcap.lenses import hfov_deg
from survey.mcap.messages import Calibration, Fix, ImageMessage, Transform
from survey.mcap.names import image_suffix, moment
from survey.mcap.reader import READER
from survey.options import ReadOptions

ROS = Ros2()
EXAMPLES = [
    ROS.image("/t", 1.0, "cam", b"\xff\xd8\xff" + bytes(50)),
    ROS.raw("/t", 1.0, "cam", (4, 2), bytes(24), "rgb8", 12),
    ROS.fix("/t", 1.0, "gnss", 2.0, 48.0, 80.0, variance=0.5),
    ROS.calibration("/t", 1.0, "cam", (32, 24), 20.0),
    ROS.odometry("/t", 1.0, "map", "base_link", (1.0, 2.0, 3.0), (0.0, 0.0, 0.6, 0.8)),
    ROS.pose("/t", 1.0, "map", (1.0, 2.0, 3.0), (0.0, 0.0, 0.6, 0.8)),
    ROS.transform("/t", 1.0, "map", "base_link", (1.0, 2.0, 3.0), (0.0, 0.0, 0.6, 0.8)),
]


@pytest.mark.parametrize("said", EXAMPLES, ids=lambda said: said.schema)
def test_both_byte_orders_say_the_same(said):
    little, big = (
        decode(
            f"cdr:{said.schema}",
            memoryview(ros_types().serialize_cdr(said.content, said.schema, little_endian=order)),
        )
        for order in (True, False)
    )
    assert little == big
    assert "1.0" in repr(little) or "cam" in repr(little)


@pytest.mark.parametrize("said", EXAMPLES, ids=lambda said: said.schema)
def test_a_message_cut_anywhere_is_refused_or_whole(said):
    whole = bytes(ros_types().serialize_cdr(said.content, said.schema))
    read = 0
    for length in range(len(whole)):
        try:
            decode(f"cdr:{said.schema}", memoryview(whole[:length]))
            read += 1
        except ValueError:
            assert not read
    decode(f"cdr:{said.schema}", memoryview(whole))


@given(st.sampled_from(sorted(KINDS)), st.binary(max_size=200))
@settings(max_examples=500, deadline=None)
def test_any_bytes_are_a_message_or_a_value_error(kind, data):
    with contextlib.suppress(ValueError):
        decode(kind, memoryview(data))


def test_a_sequence_cannot_promise_more_than_the_message_holds():
    promise = b"\0\1\0\0" + struct.pack("<I", 0xFFFFFFFF)
    with pytest.raises(ValueError, match="before all of its fields"):
        decode("cdr:tf2_msgs/msg/TFMessage", memoryview(promise))


def test_numbers_are_aligned_from_the_end_of_the_encapsulation():
    data = b"\0\1\0\0" + b"\x07" + bytes(7) + struct.pack("<d", 1.5)
    cdr = Cdr(memoryview(data))
    assert (cdr.uint8(), cdr.doubles(1)) == (7, (1.5,))


def test_pictures_stay_views_of_their_message():
    said = EXAMPLES[0]
    whole = memoryview(bytes(ros_types().serialize_cdr(said.content, said.schema)))
    (image,) = decode(f"cdr:{said.schema}", whole)
    assert isinstance(image, ImageMessage)
    assert image.data.obj is whole.obj


def test_what_the_ros_library_of_mcap_writes_is_read(tmp_path):
    text = "geometry_msgs/TransformStamped[] transforms\n" + "=" * 80 + (
        "\nMSG: geometry_msgs/TransformStamped\nstd_msgs/Header header\nstring child_frame_id\n"
        "geometry_msgs/Transform transform\n" + "=" * 80 + "\nMSG: geometry_msgs/Transform\n"
        "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n" + "=" * 80
        + "\nMSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n" + "=" * 80
        + "\nMSG: geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"
        + "=" * 80 + "\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n"
        + "=" * 80 + "\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
    )  # fmt: skip
    transform = {
        "header": {"stamp": {"sec": 7, "nanosec": 9}, "frame_id": "/map"},
        "child_frame_id": "base",
        "transform": {
            "translation": {"x": 1.0, "y": 2.0, "z": 3.0},
            "rotation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0},
        },
    }
    with (tmp_path / "tf.mcap").open("wb") as file, Ros2Writer(file) as writer:
        schema = writer.register_msgdef("tf2_msgs/TFMessage", text)
        writer.write_message("/tf", schema, {"transforms": [transform]}, log_time=5)
    (stored,) = read_messages(tmp_path / "tf.mcap", lambda topic: True)
    assert isinstance(stored, Stored)
    assert decode(stored.topic.kind, stored.data) == (
        Transform(7_000_000_009, "map", "base", (1.0, 2.0, 3.0), (0.0, 0.0, 0.0, 1.0)),
    )


def test_schemas_of_both_spellings_are_the_same_kind():
    assert message_kind("cdr", "sensor_msgs/Image") == "cdr:sensor_msgs/msg/Image"
    assert message_kind("cdr", "sensor_msgs/msg/Image") == "cdr:sensor_msgs/msg/Image"
    assert message_kind("protobuf", "foxglove.RawImage") == "protobuf:foxglove.RawImage"


@pytest.mark.parametrize("name", ["protobuf", "json"])
def test_location_fixes_are_several_fixes(name, tmp_path):
    dialect = DIALECTS[name]()
    fixes = [
        fox.LocationFix(timestamp=fox.Timestamp(sec=5, nsec=7), longitude=lon, latitude=48.0)
        for lon in (2.0, 3.0)
    ]
    said = dialect._said("/fixes", 0.0, fox.LocationFixes(fixes=fixes))
    dialect.write(tmp_path / "f.mcap", [said])
    (stored,) = read_messages(tmp_path / "f.mcap", lambda topic: True)
    assert isinstance(stored, Stored)
    one, two = decode(stored.topic.kind, stored.data)
    assert isinstance(one, Fix)
    assert isinstance(two, Fix)
    assert (one.stamp_ns, one.lon_deg, two.lon_deg) == (5_000_000_007, 2.0, 3.0)


def test_without_a_stamp_the_log_time_counts(tmp_path):
    image = {"frame_id": "cam", "format": "jpeg", "data": "/9j/AAAA"}
    fix = {"frame_id": "cam", "latitude": 48.0, "longitude": 2.0, "altitude": 7.0}
    with (tmp_path / "a.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start()
        for topic, content in (("CompressedImage", image), ("LocationFix", fix)):
            schema = writer.register_schema(f"foxglove.{topic}", "jsonschema", b"{}")
            channel = writer.register_channel(f"/{topic}", "json", schema)
            writer.add_message(channel, ns(3.0), json.dumps(content).encode(), ns(3.0))
        writer.finish()
    (found,) = READER.read(tmp_path / "a.mcap", ReadOptions(), lambda uri: True).images
    assert found.uri == "CompressedImage/1700000003.000000000.jpg"
    assert found.captured_at == "2023-11-14T22:13:23Z"


def test_fields_of_view_follow_the_lens():
    assert hfov_deg(Calibration("c", 640, 480, 320.0, "plumb_bob")) == pytest.approx(90.0)
    fisheye = hfov_deg(Calibration("c", 640, 480, 640 / np.pi, "equidistant"))
    assert fisheye == pytest.approx(180.0)
    for focal in (0.0, float("nan"), -1.0):
        assert hfov_deg(Calibration("c", 640, 480, focal, "")) is None


@pytest.mark.parametrize(
    ("head", "suffix"),
    [
        (b"\xff\xd8\xff\xe0", ".jpg"),
        (b"\x89PNG\r\n\x1a\n", ".png"),
        (b"RIFF\0\0\0\0WEBPVP8 ", ".webp"),
        (b"\0\0\0\x18ftypheic", ".heic"),
        (b"\0\0\0\x01\x67\x42", None),
        (b"", None),
    ],
)
def test_formats_are_known_by_their_bytes(head, suffix):
    assert image_suffix(ImageMessage(None, "", "jpeg", memoryview(head))) == suffix


def test_clocks_that_were_not_set_give_no_moment():
    assert moment(5_000_000_000) is None
    assert moment(1_700_000_000_123_456_789) == "2023-11-14T22:13:20.123456Z"
