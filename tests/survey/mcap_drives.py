"""A drive as three independent writers record it: Foxglove's SDK (protobuf, JSON) and rosbags.

The vehicle starts at `lon_lat(0)` and turns steadily; its camera looks to the right, 90 degrees
clockwise of where the vehicle goes. Positions are those of the antenna.
"""

import base64
import functools
import io
import math
import shutil
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import foxglove
import numpy as np
from foxglove import messages as fox
from foxglove.mcap import MCAPWriteOptions
from PIL import Image
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

T0_NS = 1_700_000_000_000_000_000
CAMERA = "cam_right_optical_frame"
LOOKING_RIGHT = (0.0, math.sqrt(0.5), -math.sqrt(0.5), 0.0)
"""Quaternion x, y, z, w: image right = -x, down = -z, axis = -y of a body with y left, z up."""
CAMERA_AT = (1.5, -0.4, 1.9)
ANTENNA_AT = (0.2, 0.0, 2.1)

Vector = tuple[float, float, float]
Turn = tuple[float, float, float, float]


def ns(seconds: float) -> int:
    """Moment of a time of the drive."""
    return T0_NS + round(seconds * 1e9)


def lon_lat(seconds: float) -> tuple[float, float]:
    """Of the antenna."""
    return 2.35 + 1e-5 * seconds, 48.85 + 2e-5 * seconds


def heading_deg(seconds: float) -> float:
    """Of the vehicle, clockwise from north."""
    return 30.0 + 4.0 * seconds


def turn_of(heading: float) -> Turn:
    """Quaternion of a level vehicle, x forward, in east, north, up."""
    half = math.radians(90.0 - heading) / 2.0
    return 0.0, 0.0, math.sin(half), math.cos(half)


@functools.cache
def jpeg(seed: int, width: int = 32, height: int = 24) -> bytes:
    """A small picture."""
    pixels = np.random.default_rng(seed).integers(0, 256, (height, width, 3), dtype=np.uint8)
    out = io.BytesIO()
    Image.fromarray(pixels).save(out, "JPEG")
    return out.getvalue()


@dataclass(frozen=True)
class Said:
    """One message of a dialect: schema (anything the dialect's writer takes) and content."""

    topic: str
    time_ns: int
    schema: Any
    content: Any


class Protobuf:
    """Foxglove's messages by Foxglove's SDK."""

    def _said(self, topic: str, seconds: float, message: Any) -> Said:
        return Said(topic, ns(seconds), type(message), message)

    def _stamp(self, seconds: float) -> fox.Timestamp:
        return fox.Timestamp(sec=ns(seconds) // 10**9, nsec=ns(seconds) % 10**9)

    def _pose(self, at: Vector, turn: Turn) -> fox.Pose:
        return fox.Pose(
            position=fox.Vector3(x=at[0], y=at[1], z=at[2]),
            orientation=fox.Quaternion(x=turn[0], y=turn[1], z=turn[2], w=turn[3]),
        )

    def image(self, topic: str, seconds: float, frame: str, data: bytes) -> Said:
        stamp = self._stamp(seconds)
        return self._said(
            topic,
            seconds,
            fox.CompressedImage(timestamp=stamp, frame_id=frame, data=data, format="jpeg"),
        )

    def raw(self, topic: str, seconds: float, frame: str, size: tuple[int, int], data: bytes,
            encoding: str, step: int) -> Said:  # fmt: skip
        message = fox.RawImage(
            timestamp=self._stamp(seconds), frame_id=frame, width=size[0], height=size[1],
            encoding=encoding, step=step, data=data,
        )  # fmt: skip
        return self._said(topic, seconds, message)

    def fix(self, topic: str, seconds: float, frame: str, lon: float, lat: float, alt: float,
            variance: float = 0.0, heading: float | None = None) -> Said:  # fmt: skip
        kinds = fox.LocationFixPositionCovarianceType
        message = fox.LocationFix(
            timestamp=self._stamp(seconds), frame_id=frame, latitude=lat, longitude=lon,
            altitude=alt, heading=heading,
            position_covariance=[variance, 0, 0, 0, variance, 0, 0, 0, variance],
            position_covariance_type=kinds.DiagonalKnown if variance else kinds.Unknown,
        )  # fmt: skip
        return self._said(topic, seconds, message)

    def pose(self, topic: str, seconds: float, frame: str, at: Vector, turn: Turn) -> Said:
        pose = self._pose(at, turn)
        message = fox.PoseInFrame(timestamp=self._stamp(seconds), frame_id=frame, pose=pose)
        return self._said(topic, seconds, message)

    def odometry(
        self, topic: str, seconds: float, frame: str, body: str, at: Vector, turn: Turn
    ) -> Said:
        message = fox.Odometry(
            timestamp=self._stamp(seconds), frame_id=frame, body_frame_id=body,
            pose=self._pose(at, turn),
        )  # fmt: skip
        return self._said(topic, seconds, message)

    def transform(
        self, topic: str, seconds: float, parent: str, child: str, at: Vector, turn: Turn
    ) -> Said:
        message = fox.FrameTransform(
            timestamp=self._stamp(seconds), parent_frame_id=parent, child_frame_id=child,
            translation=fox.Vector3(x=at[0], y=at[1], z=at[2]),
            rotation=fox.Quaternion(x=turn[0], y=turn[1], z=turn[2], w=turn[3]),
        )  # fmt: skip
        return self._said(topic, seconds, fox.FrameTransforms(transforms=[message]))

    def calibration(
        self, topic: str, seconds: float, frame: str, size: tuple[int, int], focal: float,
        model: str = "plumb_bob",
    ) -> Said:  # fmt: skip
        matrix = [focal, 0.0, size[0] / 2, 0.0, focal, size[1] / 2, 0.0, 0.0, 1.0]
        message = fox.CameraCalibration(
            timestamp=self._stamp(seconds), frame_id=frame, width=size[0], height=size[1],
            distortion_model=model, D=[], K=matrix, R=[], P=[],
        )  # fmt: skip
        return self._said(topic, seconds, message)

    def write(self, path: Path, said: Iterable[Said], **options: Any) -> None:
        context = foxglove.Context()
        channels: dict[str, foxglove.Channel] = {}
        settings = MCAPWriteOptions(chunk_size=options.pop("chunk_size", 4096), **options)
        with foxglove.open_mcap(path, context=context, writer_options=settings):
            for item in said:
                if item.topic not in channels:
                    channels[item.topic] = self._channel(item, context)
                self._log(channels[item.topic], item)

    def _channel(self, item: Said, context: foxglove.Context) -> foxglove.Channel:
        return foxglove.Channel(
            item.topic, schema=item.schema.get_schema(), message_encoding="protobuf",
            context=context,
        )  # fmt: skip

    def _log(self, channel: foxglove.Channel, item: Said) -> None:
        channel.log(item.content.encode(), log_time=item.time_ns)


class Json(Protobuf):
    """The same in JSON, field by field as Foxglove's documentation writes them."""

    def _said(self, topic: str, seconds: float, message: Any) -> Said:
        name = f"foxglove.{type(message).__name__}"
        return Said(topic, ns(seconds), name, _as_json(name, message.encode()))

    def _channel(self, item: Said, context: foxglove.Context) -> foxglove.Channel:
        schema = foxglove.Schema(name=item.schema, encoding="jsonschema", data=b'{"type":"object"}')
        return foxglove.Channel(item.topic, schema=schema, message_encoding="json", context=context)

    def _log(self, channel: foxglove.Channel, item: Said) -> None:
        channel.log(item.content, log_time=item.time_ns)


def _as_json(name: str, encoded: bytes) -> dict[str, Any]:
    """By the schema's own description, which the SDK stores with a channel."""
    from google.protobuf import descriptor_pb2, descriptor_pool, message_factory

    schema = getattr(fox, name.removeprefix("foxglove.")).get_schema()
    pool = descriptor_pool.DescriptorPool()
    for file in descriptor_pb2.FileDescriptorSet.FromString(schema.data).file:
        pool.Add(file)
    kind = message_factory.GetMessageClass(pool.FindMessageTypeByName(name))
    return _fields(kind.FromString(encoded))


def _fields(message: Any) -> dict[str, Any]:
    if message.DESCRIPTOR.full_name == "google.protobuf.Timestamp":
        return {"sec": message.seconds, "nsec": message.nanos}
    found: dict[str, Any] = {}
    for field, value in message.ListFields():
        if field.is_repeated:
            found[field.name] = [_plain(item) for item in value]
        else:
            found[field.name] = _plain(value)
    return found


def _plain(value: Any) -> Any:
    if isinstance(value, bytes):
        return base64.b64encode(value).decode()
    return _fields(value) if hasattr(value, "DESCRIPTOR") else value


@functools.cache
def ros_types() -> Any:
    """Message classes and CDR of ROS 2 Humble."""
    return get_typestore(Stores.ROS2_HUMBLE)


class Ros2:
    """ROS 2 messages by rosbags."""

    def _new(self, name: str, *fields: Any) -> Any:
        return ros_types().types[name](*fields)

    def header(self, seconds: float, frame: str) -> Any:
        stamp = self._new("builtin_interfaces/msg/Time", ns(seconds) // 10**9, ns(seconds) % 10**9)
        return self._new("std_msgs/msg/Header", stamp, frame)

    def _said(self, topic: str, seconds: float, name: str, *fields: Any) -> Said:
        return Said(topic, ns(seconds), name, self._new(name, *fields))

    def _vector(self, name: str, values: Iterable[float]) -> Any:
        return self._new(f"geometry_msgs/msg/{name}", *map(float, values))

    def _pose(self, at: Vector, turn: Turn) -> Any:
        return self._new(
            "geometry_msgs/msg/Pose", self._vector("Point", at), self._vector("Quaternion", turn)
        )

    def image(self, topic: str, seconds: float, frame: str, data: bytes) -> Said:
        return self._said(
            topic, seconds, "sensor_msgs/msg/CompressedImage", self.header(seconds, frame), "jpeg",
            np.frombuffer(data, np.uint8),
        )  # fmt: skip

    def raw(self, topic: str, seconds: float, frame: str, size: tuple[int, int], data: bytes,
            encoding: str, step: int, big_endian: int = 0) -> Said:  # fmt: skip
        return self._said(
            topic, seconds, "sensor_msgs/msg/Image", self.header(seconds, frame), size[1], size[0],
            encoding, big_endian, step, np.frombuffer(data, np.uint8),
        )  # fmt: skip

    def fix(self, topic: str, seconds: float, frame: str, lon: float, lat: float, alt: float,
            variance: float = 0.0, status: int = 0) -> Said:  # fmt: skip
        return self._said(
            topic, seconds, "sensor_msgs/msg/NavSatFix", self.header(seconds, frame),
            self._new("sensor_msgs/msg/NavSatStatus", status, 1), lat, lon, alt,
            np.diag([variance] * 3).ravel().astype(float), 2 if variance else 0,
        )  # fmt: skip

    def pose(self, topic: str, seconds: float, frame: str, at: Vector, turn: Turn) -> Said:
        return self._said(
            topic, seconds, "geometry_msgs/msg/PoseStamped", self.header(seconds, frame),
            self._pose(at, turn),
        )  # fmt: skip

    def odometry(
        self, topic: str, seconds: float, frame: str, body: str, at: Vector, turn: Turn
    ) -> Said:
        pose = self._new("geometry_msgs/msg/PoseWithCovariance", self._pose(at, turn), np.zeros(36))
        still = self._new(
            "geometry_msgs/msg/Twist",
            self._vector("Vector3", (0, 0, 0)),
            self._vector("Vector3", (0, 0, 0)),
        )
        twist = self._new("geometry_msgs/msg/TwistWithCovariance", still, np.zeros(36))
        return self._said(
            topic, seconds, "nav_msgs/msg/Odometry", self.header(seconds, frame), body, pose, twist
        )

    def transform(
        self, topic: str, seconds: float, parent: str, child: str, at: Vector, turn: Turn
    ) -> Said:
        lies = self._new(
            "geometry_msgs/msg/Transform",
            self._vector("Vector3", at),
            self._vector("Quaternion", turn),
        )
        stamped = self._new(
            "geometry_msgs/msg/TransformStamped", self.header(seconds, parent), child, lies
        )
        return self._said(topic, seconds, "tf2_msgs/msg/TFMessage", [stamped])

    def calibration(
        self, topic: str, seconds: float, frame: str, size: tuple[int, int], focal: float,
        model: str = "plumb_bob",
    ) -> Said:  # fmt: skip
        matrix = np.array([focal, 0, size[0] / 2, 0, focal, size[1] / 2, 0, 0, 1.0])
        region = self._new("sensor_msgs/msg/RegionOfInterest", 0, 0, 0, 0, False)
        return self._said(
            topic, seconds, "sensor_msgs/msg/CameraInfo", self.header(seconds, frame), size[1],
            size[0], model, np.zeros(5), matrix, np.eye(3).ravel(), np.zeros(12), 0, 0, region,
        )  # fmt: skip

    def write(self, path: Path, said: Iterable[Said]) -> None:
        folder = path.with_suffix(".bag")
        with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
            connections: dict[str, Any] = {}
            for item in said:
                if item.topic not in connections:
                    connections[item.topic] = writer.add_connection(
                        item.topic, item.schema, typestore=ros_types()
                    )
                writer.write(
                    connections[item.topic],
                    item.time_ns,
                    ros_types().serialize_cdr(item.content, item.schema),
                )
        (bag,) = folder.glob("*.mcap")
        shutil.move(bag, path)
        shutil.rmtree(folder)


Dialect = Protobuf | Json | Ros2
DIALECTS: dict[str, Callable[[], Dialect]] = {"protobuf": Protobuf, "json": Json, "ros2": Ros2}

IMAGE_TIMES = tuple(0.25 + at for at in range(5))


def drive(
    dialect: Dialect,
    *,
    until: float = 5.0,
    fix_every: float = 0.5,
    frame: str = CAMERA,
    mounted: bool = True,
    posed: bool = True,
) -> list[Said]:
    """Images, fixes, poses of the vehicle, its sensors' mounting and the lens, in order of time."""
    said = [dialect.calibration("/right/camera_info", 0.0, frame, (32, 24), 20.0)]
    if mounted:
        said += [
            dialect.transform("/tf_static", 0.0, "base_link", frame, CAMERA_AT, LOOKING_RIGHT),
            dialect.transform("/tf_static", 0.0, "base_link", "gnss", ANTENNA_AT, (0, 0, 0, 1.0)),
        ]
    for at in np.arange(0.0, until + 1e-9, fix_every):
        seconds = float(at)
        said.append(dialect.fix("/fix", seconds, "gnss", *lon_lat(seconds), 80.0, variance=0.02))
        if posed:
            said.append(
                dialect.odometry(
                    "/odometry",
                    seconds,
                    "map",
                    "base_link",
                    (0.0, 0.0, 0.0),
                    turn_of(heading_deg(seconds)),
                )
            )
    said += [
        dialect.image("/right/image/compressed", at, frame, jpeg(number))
        for number, at in enumerate(IMAGE_TIMES)
    ]
    return sorted(said, key=lambda item: item.time_ns)
