"""Foxglove messages in protobuf and JSON: https://docs.foxglove.dev/docs/sdk/schemas.

JSON is read into the same protobuf classes, so that there is one way from a message to what it
says.
"""

import json
import math
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from typing import TypeVar

from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.LocationFix_pb2 import LocationFix
from foxglove_schemas_protobuf.LocationFixes_pb2 import LocationFixes
from foxglove_schemas_protobuf.Odometry_pb2 import Odometry
from foxglove_schemas_protobuf.Pose_pb2 import Pose
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion as QuaternionMessage
from foxglove_schemas_protobuf.RawImage_pb2 import RawImage
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from google.protobuf import json_format
from google.protobuf.message import DecodeError, Message
from google.protobuf.timestamp_pb2 import Timestamp

from survey.mcap.messages import (
    BodyPose,
    Calibration,
    Fix,
    ImageMessage,
    Quaternion,
    Said,
    Transform,
    Vector,
    frame_name,
    horizontal_error_m,
)

AnyMessage = TypeVar("AnyMessage", bound=Message)
Decoder = Callable[[memoryview], tuple[Said, ...]]


def _stamp_ns(stamp: Timestamp) -> int | None:
    nanoseconds = stamp.seconds * 1_000_000_000 + stamp.nanos
    return nanoseconds if nanoseconds > 0 else None


def _vector(vector: Vector3) -> Vector:
    return vector.x, vector.y, vector.z


def _quaternion(turn: QuaternionMessage) -> Quaternion:
    return turn.x, turn.y, turn.z, turn.w


def _compressed_image(message: CompressedImage) -> tuple[Said, ...]:
    stamp_ns, frame = _stamp_ns(message.timestamp), frame_name(message.frame_id)
    return (ImageMessage(stamp_ns, frame, message.format, memoryview(message.data)),)


def _raw_image(message: RawImage) -> tuple[Said, ...]:
    return (
        ImageMessage(
            _stamp_ns(message.timestamp),
            frame_name(message.frame_id),
            message.encoding,
            memoryview(message.data),
            raw=True,
            width_px=message.width,
            height_px=message.height,
            step_bytes=message.step,
        ),
    )


def _fix(message: LocationFix) -> Fix:
    known = message.position_covariance_type != LocationFix.UNKNOWN
    return Fix(
        _stamp_ns(message.timestamp),
        frame_name(message.frame_id),
        message.longitude,
        message.latitude,
        message.altitude,
        horizontal_error_m(tuple(message.position_covariance), known),
        message.heading if message.HasField("heading") else math.nan,
    )


def _pose(stamp: Timestamp, frame: str, body: str, pose: Pose) -> BodyPose:
    return BodyPose(
        _stamp_ns(stamp),
        frame_name(frame),
        frame_name(body),
        _vector(pose.position),
        _quaternion(pose.orientation),
    )


def _transform(message: FrameTransform) -> Transform:
    return Transform(
        _stamp_ns(message.timestamp),
        frame_name(message.parent_frame_id),
        frame_name(message.child_frame_id),
        _vector(message.translation),
        _quaternion(message.rotation),
    )


def _calibration(message: CameraCalibration) -> tuple[Said, ...]:
    focal_px = message.K[0] if len(message.K) == 9 else math.nan
    frame = frame_name(message.frame_id)
    return (Calibration(frame, message.width, message.height, focal_px, message.distortion_model),)


def _both_encodings(
    kind: type[AnyMessage], says: Callable[[AnyMessage], tuple[Said, ...]]
) -> dict[str, Decoder]:
    name = kind.DESCRIPTOR.full_name

    def from_protobuf(data: memoryview) -> tuple[Said, ...]:
        try:
            return says(kind.FromString(bytes(data)))
        except DecodeError as error:
            raise ValueError(f"is no {name} in protobuf: {error}") from error

    def from_json(data: memoryview) -> tuple[Said, ...]:
        try:
            fields = _with_protobuf_times(json.loads(bytes(data)))
            if not isinstance(fields, dict):
                raise TypeError("it is no object")
            return says(json_format.ParseDict(fields, kind(), ignore_unknown_fields=True))
        except (json_format.ParseError, RecursionError, TypeError, AttributeError) as error:
            raise ValueError(f"is no {name} in JSON: {str(error)[:200]}") from error

    return {f"protobuf:{name}": from_protobuf, f"json:{name}": from_json}


def _with_protobuf_times(value: object) -> object:
    """The same JSON with `{"sec", "nsec"}` written as the text that protobuf takes."""
    if isinstance(value, list):
        return [_with_protobuf_times(item) for item in value]
    if not isinstance(value, dict):
        return value
    if value.keys() == {"sec", "nsec"}:
        return _time_text(int(value["sec"]), int(value["nsec"]))
    return {name: _with_protobuf_times(item) for name, item in value.items()}


def _time_text(seconds: int, nanoseconds: int) -> str:
    try:
        moment = datetime.fromtimestamp(seconds, UTC)
    except (OverflowError, OSError, ValueError) as error:
        raise ValueError(f"has the impossible time of {seconds} s") from error
    return f"{moment:%Y-%m-%dT%H:%M:%S}.{nanoseconds:09d}Z"


DECODERS: Mapping[str, Decoder] = {
    **_both_encodings(CompressedImage, _compressed_image),
    **_both_encodings(RawImage, _raw_image),
    **_both_encodings(LocationFix, lambda message: (_fix(message),)),
    **_both_encodings(LocationFixes, lambda message: tuple(map(_fix, message.fixes))),
    **_both_encodings(
        PoseInFrame,
        lambda message: (_pose(message.timestamp, message.frame_id, "", message.pose),),
    ),
    **_both_encodings(
        Odometry,
        lambda message: (
            _pose(message.timestamp, message.frame_id, message.body_frame_id, message.pose),
        ),
    ),
    **_both_encodings(FrameTransform, lambda message: (_transform(message),)),
    **_both_encodings(FrameTransforms, lambda message: tuple(map(_transform, message.transforms))),
    **_both_encodings(CameraCalibration, _calibration),
}
"""Kind of message -> what it says; ValueError where it does not hold."""
