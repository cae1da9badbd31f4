"""What one MCAP file says of its images and of where they were taken; pixels are not kept."""

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TypeVar

from contracts.places import Place
from contracts.records import Skipped
from survey.fragments import Message
from survey.mcap import raw_images
from survey.mcap.contents import Damage, Stored, Topic, read_messages
from survey.mcap.decoders import IMAGE_KINDS, KINDS, decode
from survey.mcap.messages import BodyPose, Calibration, Fix, ImageMessage, Said, Transform
from survey.mcap.names import image_suffix, message_uri
from survey.mcap.tracks import Samples
from survey.poses import on_null_island

Key = TypeVar("Key")
_LATEST_NS = 2**63 - 1
"""In the year 2262, where 64-bit nanoseconds end."""


@dataclass(frozen=True, slots=True)
class CameraKey:
    """A camera: the topic of its images and the frame they name."""

    topic: str
    frame: str


@dataclass(frozen=True, slots=True)
class ImageAt:
    """An image by its place. width_px, height_px : 0 where the message does not say."""

    uri: str
    path: str
    message: Message
    stamp_ns: int
    width_px: int
    height_px: int


@dataclass(frozen=True, slots=True)
class PoseTopic:
    """A source of poses: `body` in `frame`; `body` is "" where it is not said."""

    topic: str
    kind: str
    frame: str
    body: str


@dataclass(slots=True)
class Recording:
    """One drive, of a file or several.

    fixes : (topic, frame) -> lon, lat, alt, error, east and north of the heading. poses : -> x, y,
    z, qx, qy, qz, qw, as are the transforms, by (child, parent). fixed : children in topics of
    fixed transforms.
    """

    images: dict[CameraKey, list[ImageAt]] = field(default_factory=dict)
    fixes: dict[tuple[str, str], Samples] = field(default_factory=dict)
    poses: dict[PoseTopic, Samples] = field(default_factory=dict)
    transforms: dict[tuple[str, str], Samples] = field(default_factory=dict)
    fixed: set[str] = field(default_factory=set)
    calibrations: dict[str, Calibration] = field(default_factory=dict)
    skipped: list[Skipped] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    topics: set[Topic] = field(default_factory=set)


def read_recording(
    path: Place, name: str, prefix: str, wanted: Callable[[str], bool], *, with_poses: bool
) -> Recording:
    """Everything in a file that matters, read once.

    name : of the file in what a person reads. prefix : of the uris. wanted : which uris.

    Raises
    ------
    OSError : the file cannot be read.
    """
    gathering = _Gathering(str(path), prefix, wanted)
    kinds = KINDS if with_poses else IMAGE_KINDS

    def of_interest(topic: Topic) -> bool:
        gathering.recording.topics.add(topic)
        return topic.kind in kinds

    damages: list[Damage] = []
    latest_ns = 0
    for item in read_messages(path, of_interest):
        if isinstance(item, Damage):
            damages.append(item)
        else:
            latest_ns = max(latest_ns, item.log_time_ns)
            gathering.take(item)
    recording = gathering.recording
    recording.notes += _damage_notes(name, damages, path.stat().st_size, latest_ns)
    recording.notes += [
        f"{name}: {count} {what}" for what, count in sorted(gathering.left_out.items())
    ]
    return recording


def _damage_notes(name: str, damages: list[Damage], file_bytes: int, latest_ns: int) -> list[str]:
    notes = []
    partial = [damage for damage in damages if not damage.ended]
    if partial:
        notes.append(
            f"{name}: {len(partial)} damaged chunks or records were left out; the first, at byte "
            f"{partial[0].at}: {partial[0].reason}"
        )
    notes += [
        f"{name}: read as far as byte {damage.at} of {file_bytes}, log time "
        f"{latest_ns / 1e9:.3f} s: {damage.reason}"
        for damage in damages
        if damage.ended
    ]
    return notes


class _Gathering:
    """Sorts the messages of a file into a `Recording`."""

    def __init__(self, path: str, prefix: str, wanted: Callable[[str], bool]) -> None:
        self.recording = Recording()
        self.left_out: Counter[str] = Counter()
        self._path, self._prefix, self._wanted = path, prefix, wanted
        self._uris: set[str] = set()

    def take(self, stored: Stored) -> None:
        topic = stored.topic
        try:
            for said in decode(topic.kind, stored.data):
                self._sort(stored, said)
        except (ValueError, OverflowError) as error:
            if topic.kind in IMAGE_KINDS:
                uri = message_uri(self._prefix, topic.name, stored.log_time_ns, "")
                self._skip(uri, f"message {error}")
            else:
                self.left_out[f"messages of topic {topic.name} cannot be understood"] += 1

    def _sort(self, stored: Stored, said: Said) -> None:
        topic = stored.topic.name
        if isinstance(said, ImageMessage):
            self._image(stored, said)
        elif isinstance(said, Fix):
            self._fix(stored, said)
        elif isinstance(said, BodyPose):
            key = PoseTopic(topic, stored.topic.kind, said.frame, said.body)
            self._add(self.recording.poses, key, stored, said.stamp_ns, _numbers(said))
        elif isinstance(said, Transform):
            if said.child and said.parent:
                edge = (said.child, said.parent)
                self._add(self.recording.transforms, edge, stored, said.stamp_ns, _numbers(said))
                if topic.endswith("tf_static"):
                    self.recording.fixed.add(said.child)
        else:
            self.recording.calibrations.setdefault(topic, said)

    def _add(
        self,
        into: dict[Key, Samples],
        key: Key,
        stored: Stored,
        stamp_ns: int | None,
        values: tuple[float, ...],
    ) -> None:
        if not all(map(math.isfinite, values[:2])):
            self.left_out[f"messages of topic {stored.topic.name} are not finite"] += 1
            return
        time_ns = stored.log_time_ns if stamp_ns is None else stamp_ns
        into.setdefault(key, Samples(len(values))).add(time_ns, values)

    def _fix(self, stored: Stored, fix: Fix) -> None:
        known = math.isfinite(fix.lon_deg) and math.isfinite(fix.lat_deg)
        possible = known and abs(fix.lon_deg) <= 180.0 and abs(fix.lat_deg) <= 90.0
        if not (fix.valid and possible) or on_null_island(fix.lon_deg, fix.lat_deg):
            self.left_out[f"positions of topic {stored.topic.name} have no fix"] += 1
            return
        towards = (math.sin(fix.heading_rad), math.cos(fix.heading_rad))
        values = (fix.lon_deg, fix.lat_deg, fix.alt_m, fix.error_m, *towards)
        key = (stored.topic.name, fix.frame)
        self._add(self.recording.fixes, key, stored, fix.stamp_ns, values)

    def _image(self, stored: Stored, image: ImageMessage) -> None:
        topic = stored.topic
        if image.encoding.lower() in raw_images.DEPTHS or "compressedDepth" in image.encoding:
            self.left_out[f"images of topic {topic.name} are depths, not photographs"] += 1
            return
        stamp_ns = stored.log_time_ns if image.stamp_ns is None else image.stamp_ns
        suffix = image_suffix(image)
        uri = message_uri(self._prefix, topic.name, stamp_ns, suffix or "")
        if not self._wanted(uri):
            return
        reason = raw_images.problem(image) if image.raw else None
        if suffix is None:
            reason = f"format {image.encoding[:40]!r}, expected JPEG, PNG, WebP or another image"
        if stamp_ns > _LATEST_NS:
            reason = f"its time, {stamp_ns} ns, is beyond the year 2262"
        if uri in self._uris:
            reason = "topic and time are those of an earlier message, which counts"
        if reason is not None:
            self._skip(uri, reason)
            return
        self._uris.add(uri)
        message = Message(topic.name, stored.log_time_ns, stored.record, stored.offset, topic.kind)
        camera = CameraKey(topic.name, image.frame)
        self.recording.images.setdefault(camera, []).append(
            ImageAt(uri, self._path, message, stamp_ns, image.width_px, image.height_px)
        )

    def _skip(self, uri: str, reason: str) -> None:
        if self._wanted(uri):
            self.recording.skipped.append(Skipped(uri, reason))


def _numbers(said: BodyPose | Transform) -> tuple[float, ...]:
    where = said.position if isinstance(said, BodyPose) else said.translation
    return where + said.quaternion
