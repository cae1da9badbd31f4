"""A survey as one MCAP file that Foxglove opens, and that is read again as a survey.

For each camera: its pictures (CompressedImage), its positions in WGS 84 (LocationFix), how it is
turned in the east, north and up of where it stands (FrameTransform) and its lens
(CameraCalibration).
"""

import io
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.LocationFix_pb2 import LocationFix
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from google.protobuf.message import Message
from google.protobuf.timestamp_pb2 import Timestamp
from mcap_protobuf.writer import Writer
from PIL import Image

from contracts.errors import UnusableImage
from contracts.records import PosedImage, Skipped
from coordinator.export.beside import writing_to, written_beside
from coordinator.export.mcap_places import Floats, Place, in_wgs84
from survey.decode import decode_image
from survey.fragments import parse_fragment
from survey.image_file import image_bytes, opened
from survey.image_header import header_of
from survey.options import Survey

WORLD_FRAME = "local_enu"
"""East, north and up of where each picture was taken: all cameras stand at its origin."""
_KEPT = {"JPEG": "jpeg", "PNG": "png", "WEBP": "webp"}
_MAX_PIXELS = 250_000_000
_JPEG_QUALITY = 95
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_SECOND_NS = 1_000_000_000
_NOT_TOPIC = re.compile(r"[^\w.-]+")


@dataclass(frozen=True, slots=True)
class Export:
    """n_images : written. skipped : what could not be read, and why."""

    n_images: int
    skipped: tuple[Skipped, ...]


def write_mcap(
    survey: Survey, out: Path, advance: Callable[[], None], allow_ballpark: bool = False
) -> Export:
    """Write the whole survey, in order of time, one image in memory at a time.

    JPEG, PNG and WebP files go in byte for byte, with what their EXIF says. Anything else, views
    of panoramas and images that are stored turned become upright JPEGs. An image without
    `captured_at` gets a second of its own from 1970-01-01T00:00:01Z on, in the order of the
    survey; images of one camera with the same time follow each other by a nanosecond. Heights are
    written where they are known above the ellipsoid, attitudes where heading, pitch and roll are,
    a heading alone in the LocationFix; directions derived from the track are left out, since a
    reader can derive them again.

    Parameters
    ----------
    advance : called once an image. allow_ballpark : see `geo.crs.ToWgs84`.

    Raises
    ------
    WrongInput : `out` cannot be written. UnknownCrs : positions have no place in WGS 84.
    """
    frames = _frames(survey.images)
    times_ns = _times_ns(survey.images)
    places = in_wgs84(survey, allow_ballpark)
    skipped: list[Skipped] = []
    with (
        written_beside(out) as part,
        writing_to(out),
        part.open("wb") as file,
        Writer(file) as messages,
    ):
        writer = _Log(messages)
        for at in sorted(range(len(times_ns)), key=lambda at: (times_ns[at], at)):
            image = survey.images[at]
            try:
                picture = _picture(image)
            except UnusableImage as error:
                skipped.append(Skipped(image.uri, str(error)))
            else:
                writer.image(frames[image.camera.name], times_ns[at], image, picture, places[at])
            advance()
        messages.add_metadata("survey", _facts(survey))
    return Export(len(survey.images) - len(skipped), tuple(skipped))


@dataclass(frozen=True, slots=True)
class _Picture:
    """An image file; the size is that of the upright image."""

    data: bytes
    format: str
    width_px: int
    height_px: int


def _picture(image: PosedImage) -> _Picture:
    """Raises UnusableImage."""
    fragment = parse_fragment(image.fragment)
    if fragment.view is None and image.quarter_turns % 4 == 0:
        data = image_bytes(image.path, fragment.message, _MAX_PIXELS)
        with opened(io.BytesIO(data)) as file:
            if file.format in _KEPT:
                header = header_of(file)
                return _Picture(data, _KEPT[file.format], header.width_px, header.height_px)
    decoded = decode_image(
        image.path,
        fragment=image.fragment,
        quarter_turns=image.quarter_turns,
        max_side_px=_MAX_PIXELS,
        max_pixels=_MAX_PIXELS,
    )
    upright = io.BytesIO()
    Image.fromarray(decoded.rgb).save(upright, "JPEG", quality=_JPEG_QUALITY, subsampling=0)
    height, width = decoded.rgb.shape[:2]
    return _Picture(upright.getvalue(), "jpeg", width, height)


def _frames(images: Sequence[PosedImage]) -> Mapping[str, str]:
    """The cameras' names as names of frames and topics, each once."""
    found: dict[str, str] = {}
    for name in sorted({image.camera.name for image in images}):
        plain = _NOT_TOPIC.sub("_", name).strip("_") or "camera"
        taken, number = set(found.values()) | {WORLD_FRAME}, 2
        frame = plain
        while frame in taken:
            frame, number = f"{plain}_{number}", number + 1
        found[name] = frame
    return found


def _times_ns(images: Sequence[PosedImage]) -> list[int]:
    """A time for every image, which its camera has only once."""
    times = [
        (at + 1) * _SECOND_NS if image.captured_at is None else _nanoseconds(image.captured_at)
        for at, image in enumerate(images)
    ]
    latest: dict[str, int] = {}
    for at in sorted(range(len(times)), key=lambda at: (times[at], at)):
        camera = images[at].camera.name
        times[at] = max(times[at], latest.get(camera, 0) + 1)
        latest[camera] = times[at]
    return times


def _nanoseconds(captured_at: str) -> int:
    moment = datetime.fromisoformat(captured_at)
    return (moment - _EPOCH) // timedelta(microseconds=1) * 1000


def _facts(survey: Survey) -> dict[str, str]:
    facts = {"format": survey.format, "crs": survey.crs or "", "attribution": survey.attribution}
    return facts | {"notes": "\n".join(survey.notes)}


class _Log:
    """Writes messages; a camera's lens is written when it is new."""

    def __init__(self, writer: Writer) -> None:
        self._writer = writer
        self._lenses: dict[str, tuple[float, int, int]] = {}

    def image(
        self, frame: str, time_ns: int, image: PosedImage, picture: _Picture, place: Place | None
    ) -> None:
        stamp = Timestamp(seconds=time_ns // _SECOND_NS, nanos=time_ns % _SECOND_NS)
        if place is not None:
            error_m = None if image.pose is None else image.pose.position_error_m
            self._write(f"/{frame}/location", time_ns, _fix(stamp, frame, place, error_m))
            if np.isfinite(place.quaternion).all():
                self._write("/tf", time_ns, _transform(stamp, frame, place.quaternion))
        self._lens(frame, time_ns, stamp, image.camera.hfov_deg, picture)
        message = CompressedImage(
            timestamp=stamp, frame_id=frame, data=picture.data, format=picture.format
        )
        self._write(f"/{frame}/image/compressed", time_ns, message)

    def _lens(
        self, frame: str, time_ns: int, stamp: Timestamp, hfov_deg: float | None, picture: _Picture
    ) -> None:
        if hfov_deg is None or not 0.0 < hfov_deg < 180.0:
            return
        width, height = picture.width_px, picture.height_px
        lens = (hfov_deg, width, height)
        if self._lenses.get(frame) == lens:
            return
        self._lenses[frame] = lens
        focal = width / 2.0 / math.tan(math.radians(hfov_deg) / 2.0)
        projection = [focal, 0.0, width / 2.0, 0.0, focal, height / 2.0, 0.0, 0.0, 1.0]
        message = CameraCalibration(
            timestamp=stamp,
            frame_id=frame,
            width=width,
            height=height,
            K=projection,
            R=np.eye(3).ravel(),
            P=np.insert(np.reshape(projection, (3, 3)), 3, 0.0, axis=1).ravel(),
        )
        self._write(f"/{frame}/calibration", time_ns, message)

    def _write(self, topic: str, time_ns: int, message: Message) -> None:
        self._writer.write_message(topic, message, log_time=time_ns, publish_time=time_ns)


def _fix(stamp: Timestamp, frame: str, place: Place, error_m: float | None) -> LocationFix:
    """A height that is not known is NaN, as in ROS: 0 would be one."""
    message = LocationFix(
        timestamp=stamp,
        frame_id=frame,
        latitude=place.lat_deg,
        longitude=place.lon_deg,
        altitude=place.height_m,
    )
    if math.isfinite(place.heading_deg):
        message.heading = math.radians(place.heading_deg)
    if error_m is not None:
        variance = error_m**2 / 2.0  # half of it east, half north
        message.position_covariance.extend([variance, 0, 0, 0, variance, 0, 0, 0, 0])
        message.position_covariance_type = LocationFix.APPROXIMATED
    return message


def _transform(stamp: Timestamp, frame: str, quaternion: Floats) -> FrameTransform:
    x, y, z, w = (float(part) for part in quaternion)
    return FrameTransform(
        timestamp=stamp,
        parent_frame_id=WORLD_FRAME,
        child_frame_id=frame,
        rotation=Quaternion(x=x, y=y, z=z, w=w),
    )
