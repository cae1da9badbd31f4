"""Which of a recording's sources places its images, and where that is.

The rule has no option. Positions: with a projected `--crs`, the poses and transforms of the
recording, else its WGS 84 fixes; a fix of the camera's own frame comes first, then the source
that places the most images, then the one that states the smaller error. Attitudes: poses whose
body is named, then other poses, then the transforms; again the one that knows the most images'.
What is still equal is decided by the topic's name.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from survey.mcap.attitudes import Source, sources
from survey.mcap.fixes import FixAt, fixes_at
from survey.mcap.frames import FrameTree, frame_tree
from survey.mcap.levers import lever_m, moved_by
from survey.mcap.recording import CameraKey, ImageAt, Recording
from survey.mcap.tracks import Asked, Bracket, Floats


@dataclass(frozen=True, slots=True)
class Places:
    """Where the images of one camera were taken.

    position : (m, 3) float64, longitude, latitude, height or x, y, z; NaN: not known.
    error_m : (m,). rotation : (m, 3, 3), right, down, forward in east, north, up; NaN: not known.
    heading_deg : (m,), where no more than the heading is known. reasons : why an image has no
    position, "" where it has one.
    """

    camera: CameraKey
    images: Sequence[ImageAt]
    position: Floats
    error_m: Floats
    rotation: Floats
    heading_deg: Floats
    reasons: tuple[str, ...]
    notes: tuple[str, ...] = ()


@dataclass(slots=True)
class _Notes:
    """What is to be told of one camera."""

    camera: CameraKey
    texts: list[str] = field(default_factory=list)

    def add(self, text: str) -> None:
        self.texts.append(f"camera {self.camera.frame or self.camera.topic}: {text}")


def placed(recording: Recording, max_gap_s: float, *, local: bool) -> list[Places]:
    """Every camera's images; `local`: by poses in the map's coordinates instead of fixes."""
    tree = frame_tree(recording.transforms, recording.fixed)
    return [
        _placed_camera(recording, tree, camera, images, max_gap_s, local)
        for camera, images in recording.images.items()
    ]


def _placed_camera(
    recording: Recording,
    tree: FrameTree,
    camera: CameraKey,
    images: Sequence[ImageAt],
    max_gap_s: float,
    local: bool,
) -> Places:
    asked = Asked(np.array([image.stamp_ns for image in images], np.int64), max_gap_s)
    ways = sources(recording, tree, camera, asked)
    notes = _Notes(camera)
    if local:
        return _by_poses(ways, camera, images, max_gap_s, notes)
    rotation = _attitude(ways, len(images), notes)
    fixes = fixes_at(recording.fixes, asked)
    if not fixes:
        return _nowhere(camera, images, "the recording has no position (LocationFix, NavSatFix)")
    best = min(fixes, key=lambda fix: fix.order(camera.frame))
    position = _from_antenna(tree, best, camera.frame, asked, rotation, notes)
    reasons = _gap_reasons(best.around, max_gap_s, f"positions of topic {best.topic}")
    heading_deg = _stated_heading(best, camera, alone=len(recording.images) == 1)
    return Places(
        camera, images, position, best.error_m, rotation, heading_deg, reasons, tuple(notes.texts)
    )


def _from_antenna(
    tree: FrameTree, fix: FixAt, camera_frame: str, asked: Asked, rotation: Floats, notes: _Notes
) -> Floats:
    lever = lever_m(tree, fix.frame, camera_frame, asked)
    if isinstance(lever, str):
        notes.add(f"{lever}: positions are the antenna's")
        return fix.position
    moved = moved_by(fix.position, np.einsum("nij,nj->ni", rotation, lever))
    if lever.any() and (unmoved := int((~np.isfinite(rotation).all(axis=(1, 2))).sum())):
        notes.add(f"{unmoved} positions are the antenna's: no attitude says how it was turned")
    return moved


def _nowhere(camera: CameraKey, images: Sequence[ImageAt], reason: str) -> Places:
    unknown = np.full((len(images), 3), np.nan)
    turned = np.full((len(images), 3, 3), np.nan)
    reasons = (reason,) * len(images)
    return Places(camera, images, unknown, unknown[:, 0], turned, unknown[:, 0], reasons)


def _gap_reasons(around: Bracket, max_gap_s: float, what: str) -> tuple[str, ...]:
    """Why a moment has no position among the `what`, "" where it has one."""
    return tuple(
        ""
        if within
        else f"taken before the first or after the last of the {what}"
        if np.isinf(gap)
        else f"the {what} around it are {gap:.3f} s apart, more than {max_gap_s:g} s"
        for within, gap in zip(around.within, around.gap_s, strict=True)
    )


def _stated_heading(fix: FixAt, camera: CameraKey, *, alone: bool) -> Floats:
    """Of the camera itself, or of the vehicle whose only camera looks ahead."""
    if alone or fix.frame == camera.frame:
        return fix.heading_deg
    return np.full_like(fix.heading_deg, np.nan)


def _attitude(ways: Sequence[Source], count: int, notes: _Notes) -> Floats:
    steady = [way for way in ways if not way.adrift]
    for frame in sorted({way.frame for way in ways if way.adrift}):
        notes.add(f"attitudes in frame {frame!r} are not used: its north is not known")
    chosen = _choice(steady, Source.turns)
    if chosen is None:
        return np.full((count, 3, 3), np.nan)
    if chosen.assumed_forward:
        notes.add(
            f"no transform says how it is mounted; it is taken to look ahead, along the x axis "
            f"of the poses of {chosen.name}"
        )
    return chosen.camera.rotation


def _choice(ways: Sequence[Source], known: Callable[[Source], NDArray[np.bool_]]) -> Source | None:
    """The source that knows the most; None if none knows anything."""
    return min(
        (way for way in ways if known(way).any()),
        key=lambda way: (way.adrift, -int(known(way).sum()), way.rank, way.name, way.frame),
        default=None,
    )


def _by_poses(
    ways: Sequence[Source],
    camera: CameraKey,
    images: Sequence[ImageAt],
    max_gap_s: float,
    notes: _Notes,
) -> Places:
    chosen = _choice(ways, Source.stands)
    if chosen is None:
        reason = "no pose within the track and a gap of {:g} s says where it was taken"
        return _nowhere(camera, images, reason.format(max_gap_s))
    notes.add(f"placed by {chosen.name}, in frame {chosen.frame!r}, taken as --crs")
    rotation = chosen.camera.rotation
    if not chosen.turns().any():
        rotation = _attitude(ways, len(images), notes)
    elif chosen.assumed_forward:
        notes.add("no transform says how it is mounted; it is taken to look ahead")
    unknown = np.full(len(images), np.nan)
    reasons = _gap_reasons(chosen.around, max_gap_s, f"poses of {chosen.name}")
    return Places(
        camera,
        images,
        chosen.camera.position,
        unknown,
        rotation,
        unknown,
        reasons,
        tuple(notes.texts),
    )
