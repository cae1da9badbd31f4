"""A kapture folder (version 1): `sensors/records_camera.txt`, `trajectories.txt`, `rigs.txt`.

Poses map world to device, with x east, y north and z up in the system that `--crs` names; kapture
itself has no word for one. Devices are cameras as OpenCV has them: x right, y down, z ahead.
Timestamps may be any number, so they are not read as times. North: grid; `north` overrides.
"""

from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from contracts.config import North
from contracts.errors import BadSurvey, UnknownCrs
from contracts.places import Place
from contracts.records import Camera, Pose, PosedImage, Skipped
from geo.rotations import hpr_from_rotations
from survey.files import Listing, list_images, printable_uri
from survey.kapture_text import Line, Rigid, camera, lines, pose_numbers, rigids, timestamp
from survey.options import Reader, Reading, ReadOptions
from survey.poses import crs_name, is_geographic, normalised, pose_problem

_SENSORS = "sensors"
_RECORDS = "sensors/records_camera.txt"
_TRAJECTORIES = "sensors/trajectories.txt"
_DATA = "sensors/records_data/"

_When = tuple[int, str]
"""Timestamp and device."""


@dataclass(frozen=True, slots=True)
class _Placed:
    """A device's pose, world to device. line : of trajectories.txt that says it."""

    pose: Rigid
    line: int


@dataclass(frozen=True, slots=True)
class _Track:
    """What is known of where devices were.

    poses : or why one cannot be used. rigs : sensor or rig -> the rigs it is mounted on, and
    itself as seen from there.
    """

    poses: dict[_When, _Placed | str]
    rigs: dict[str, list[tuple[str, Rigid]]]


def recognises(path: Place) -> bool:
    """A folder with the two files that name cameras and images."""
    return (path / _SENSORS / "sensors.txt").is_file() and (path / _RECORDS).is_file()


def read(path: Place, options: ReadOptions, wanted: Callable[[str], bool]) -> Reading:
    """Every image that has a pose; no image is opened.

    Raises
    ------
    BadSurvey : no kapture folder, or a file that does not hold. UnknownCrs : no `--crs`.
    """
    if not recognises(path):
        raise BadSurvey(f"{path} is no kapture folder: it has no {_RECORDS} and sensors.txt")
    crs = _crs(path, options)
    cameras = _cameras(path / _SENSORS / "sensors.txt")
    poses, unread = _poses(path / _TRAJECTORIES)
    track = _Track(poses, _rigs(path / _SENSORS / "rigs.txt"))
    listing = list_images(path)
    images, skipped = _match(path, cameras, track, listing, wanted)
    posed, impossible = _posed(images, crs, options.north or "grid")
    told = {image.uri for image, _ in images} | {skip.uri for skip in skipped}
    unnamed = [
        Skipped(uri, f"image without pose: no line of {_RECORDS} names it")
        for uri in listing.paths.keys() - told
        if uri.startswith(_DATA)
    ]
    return Reading(posed, (*skipped, *unread, *impossible, *unnamed, *listing.skipped), crs)


def _crs(path: Place, options: ReadOptions) -> str:
    if options.crs is None:
        raise UnknownCrs(
            f"kapture folder {path}: its poses are in metres of a system that it does not name; "
            "name it with --crs, such as --crs EPSG:2154 (x east, y north, z up)"
        )
    crs = crs_name(options.crs)
    if is_geographic(crs):
        raise BadSurvey(
            f"kapture folder {path}: poses are in metres but --crs {crs} is in degrees; give the "
            "projected system they are in"
        )
    return crs


def _cameras(path: Place) -> dict[str, Camera]:
    cameras: dict[str, Camera] = {}
    for line in lines(path):
        if len(line.cells) < 3 or line.cells[2] != "camera":
            continue
        if line.cells[0] in cameras:
            raise BadSurvey(f"{path}, line {line.number}: sensor {line.cells[0]!r} is there twice")
        try:
            cameras[line.cells[0]] = camera(line.cells[0], line.cells)
        except ValueError as error:
            raise BadSurvey(f"{path}, line {line.number}: {error}; mend the line") from error
    return cameras


def _poses(path: Place) -> tuple[dict[_When, _Placed | str], list[Skipped]]:
    """Poses of devices, and the lines that name none."""
    numbers: dict[_When, list[float]] = {}
    unusable: dict[_When, str] = {}
    line_of: dict[_When, int] = {}
    unread: list[Skipped] = []
    for line in lines(path) if path.is_file() else ():
        where = f"{_TRAJECTORIES}, line {line.number}"
        try:
            when = _when(line)
        except ValueError as error:
            unread.append(Skipped(where, str(error)))
            continue
        if line_of.setdefault(when, line.number) != line.number:
            unusable[when] = f"{where}: the pose of line {line_of[when]} is given again; keep one"
            continue
        try:
            numbers[when] = pose_numbers(line.cells[2:])
        except ValueError as error:
            unusable[when] = f"{where}: {error}"
    poses = {
        when: _Placed(pose, line_of[when])
        for when, pose in zip(numbers, rigids(list(numbers.values())), strict=True)
    }
    return {**poses, **unusable}, unread


def _rigs(path: Place) -> dict[str, list[tuple[str, Rigid]]]:
    rigs: dict[str, list[tuple[str, Rigid]]] = defaultdict(list)
    for line in lines(path) if path.is_file() else ():
        try:
            if len(line.cells) < 2:
                raise ValueError("expected a rig and a sensor")
            (sensor_from_rig,) = rigids([pose_numbers(line.cells[2:])])
        except ValueError as error:
            raise BadSurvey(f"{path}, line {line.number}: {error}; mend the line") from error
        rigs[line.cells[1]].append((line.cells[0], sensor_from_rig))
    return rigs


def _when(line: Line) -> _When:
    if len(line.cells) < 2:
        raise ValueError("expected a timestamp and a device")
    return timestamp(line.cells[0]), line.cells[1]


def _match(
    path: Place,
    cameras: dict[str, Camera],
    track: _Track,
    listing: Listing,
    wanted: Callable[[str], bool],
) -> tuple[list[tuple[PosedImage, _Placed]], list[Skipped]]:
    """Images with the pose of their camera."""
    images: dict[str, tuple[PosedImage, _Placed]] = {}
    skipped: list[Skipped] = []
    told = {skip.uri for skip in listing.skipped}
    for line in lines(path / _RECORDS):
        uri = _DATA + printable_uri(line.cells[2]) if len(line.cells) > 2 else ""
        if uri in told or not wanted(uri):
            continue
        found = _record(line, uri, cameras, track, listing)
        if uri in images:
            found = "the same image as a line before, which counts; remove one"
        if isinstance(found, str):
            where = f"{_RECORDS}, line {line.number}"
            skipped.append(Skipped(uri or where, f"{where}: {found}"))
        else:
            images[uri] = found
    return list(images.values()), skipped


def _record(
    line: Line, uri: str, cameras: dict[str, Camera], track: _Track, listing: Listing
) -> tuple[PosedImage, _Placed] | str:
    """One line of records_camera.txt, or why it is left out."""
    if not uri:
        return "expected a timestamp, a device and a path"
    if uri not in listing.paths:
        return f"pose without image: no image {uri!r} in the survey"
    try:
        when = _when(line)
    except ValueError as error:
        return str(error)
    if when[1] not in cameras:
        return f"camera {when[1]!r} is not in sensors.txt"
    pose = _camera_from_world(when, track, frozenset())
    if isinstance(pose, str):
        return f"image without pose: {pose}"
    return PosedImage(uri, listing.paths[uri], camera=cameras[when[1]]), pose


def _camera_from_world(when: _When, track: _Track, seen: frozenset[str]) -> _Placed | str:
    """The pose of a device, its own or that of a rig it is mounted on, or why there is none."""
    stamp, device = when
    reason = f"none for {device!r} or its rig at {stamp} in {_TRAJECTORIES}"
    own = track.poses.get(when)
    if isinstance(own, _Placed):
        return own
    for rig, device_from_rig in track.rigs.get(device, ()):
        if rig in seen:
            continue
        rig_from_world = _camera_from_world((stamp, rig), track, seen | {device})
        if isinstance(rig_from_world, _Placed):
            return replace(rig_from_world, pose=device_from_rig.after(rig_from_world.pose))
        if (stamp, rig) in track.poses:
            reason = rig_from_world
    return reason if own is None else own


def _posed(
    images: list[tuple[PosedImage, _Placed]], crs: str, north: North
) -> tuple[tuple[PosedImage, ...], tuple[Skipped, ...]]:
    if not images:
        return (), ()
    world_from_camera = np.stack([placed.pose.rotation.T for _, placed in images])
    translations = np.stack([placed.pose.translation_m for _, placed in images])
    centres = -np.einsum("nij,nj->ni", world_from_camera, translations)
    angles = np.stack(hpr_from_rotations(world_from_camera), axis=1)
    posed: list[PosedImage] = []
    impossible: list[Skipped] = []
    for (image, placed), (x, y, z), (heading, pitch, roll) in zip(
        images, centres.tolist(), angles.tolist(), strict=True
    ):
        pose = Pose(x, y, crs, z, heading, pitch, roll, north)
        problem = pose_problem(pose, geographic=False)
        if problem is None:
            posed.append(replace(image, pose=normalised(pose)))
        else:
            where = f"{_TRAJECTORIES}, line {placed.line}"
            impossible.append(Skipped(image.uri, f"{where}: {problem}"))
    return tuple(posed), tuple(impossible)


READER = Reader("kapture", recognises, read)
