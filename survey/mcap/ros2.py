"""ROS 2 messages in CDR: https://github.com/ros2/common_interfaces."""

from collections.abc import Callable, Mapping

from survey.mcap.cdr import Cdr
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

_NO_FIX = -1
_LEAST_TRANSFORM_BYTES = 72


def _header(cdr: Cdr) -> tuple[int | None, str]:
    seconds, nanoseconds = cdr.int32(), cdr.uint32()
    stamp_ns = seconds * 1_000_000_000 + nanoseconds
    return (stamp_ns if stamp_ns > 0 else None), frame_name(cdr.text())


def _pose(cdr: Cdr) -> tuple[Vector, Quaternion]:
    x, y, z, qx, qy, qz, qw = cdr.doubles(7)
    return (x, y, z), (qx, qy, qz, qw)


def _compressed_image(data: memoryview) -> tuple[Said, ...]:
    cdr = Cdr(data)
    stamp_ns, frame = _header(cdr)
    return (ImageMessage(stamp_ns, frame, cdr.text(), cdr.octets()),)


def _image(data: memoryview) -> tuple[Said, ...]:
    cdr = Cdr(data)
    stamp_ns, frame = _header(cdr)
    height, width, encoding = cdr.uint32(), cdr.uint32(), cdr.text()
    big_endian, step = bool(cdr.uint8()), cdr.uint32()
    pixels = cdr.octets()
    return (ImageMessage(stamp_ns, frame, encoding, pixels, True, width, height, step, big_endian),)


def _nav_sat_fix(data: memoryview) -> tuple[Said, ...]:
    cdr = Cdr(data)
    stamp_ns, frame = _header(cdr)
    status, _ = cdr.int8(), cdr.uint16()
    lat, lon, alt, *covariance = cdr.doubles(12)
    error_m = horizontal_error_m(tuple(covariance), known=cdr.uint8() != 0)
    return (Fix(stamp_ns, frame, lon, lat, alt, error_m, valid=status != _NO_FIX),)


def _camera_info(data: memoryview) -> tuple[Said, ...]:
    cdr = Cdr(data)
    _, frame = _header(cdr)
    height, width, model = cdr.uint32(), cdr.uint32(), cdr.text()
    cdr.doubles(cdr.sequence_length(8))
    return (Calibration(frame, width, height, cdr.doubles(9)[0], model),)


def _odometry(data: memoryview) -> tuple[Said, ...]:
    cdr = Cdr(data)
    stamp_ns, frame = _header(cdr)
    body = frame_name(cdr.text())
    return (BodyPose(stamp_ns, frame, body, *_pose(cdr)),)


def _pose_stamped(data: memoryview) -> tuple[Said, ...]:
    cdr = Cdr(data)
    stamp_ns, frame = _header(cdr)
    return (BodyPose(stamp_ns, frame, "", *_pose(cdr)),)


def _tf_message(data: memoryview) -> tuple[Said, ...]:
    cdr = Cdr(data)
    return tuple(_transform(cdr) for _ in range(cdr.sequence_length(_LEAST_TRANSFORM_BYTES)))


def _transform(cdr: Cdr) -> Transform:
    stamp_ns, parent = _header(cdr)
    return Transform(stamp_ns, parent, frame_name(cdr.text()), *_pose(cdr))


DECODERS: Mapping[str, Callable[[memoryview], tuple[Said, ...]]] = {
    "cdr:sensor_msgs/msg/CompressedImage": _compressed_image,
    "cdr:sensor_msgs/msg/Image": _image,
    "cdr:sensor_msgs/msg/NavSatFix": _nav_sat_fix,
    "cdr:sensor_msgs/msg/CameraInfo": _camera_info,
    "cdr:nav_msgs/msg/Odometry": _odometry,
    "cdr:geometry_msgs/msg/PoseStamped": _pose_stamped,
    "cdr:geometry_msgs/msg/PoseWithCovarianceStamped": _pose_stamped,
    "cdr:tf2_msgs/msg/TFMessage": _tf_message,
}
"""Kind of message -> what it says; ValueError where it does not hold."""
