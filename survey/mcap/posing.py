"""From places to posed images in one coordinate system."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from contracts.config import North
from contracts.errors import BadSurvey, UnknownCrs
from contracts.records import Camera, Pose, PosedImage, Skipped
from geo.rotations import hpr_from_rotations
from survey.fragments import Fragment
from survey.mcap.lenses import calibration_of, hfov_deg
from survey.mcap.names import moment
from survey.mcap.placing import Places
from survey.mcap.recording import CameraKey, ImageAt, Recording
from survey.options import ReadOptions
from survey.poses import crs_name, is_geographic, normalised, outside_area, pose_problem

_FLAT, _WITH_HEIGHTS = "EPSG:4326", "EPSG:4979"


@dataclass(frozen=True, slots=True)
class System:
    """What coordinates mean. crs : None where the fixes' heights decide. local : they are those
    of poses in a map's metres, not of fixes."""

    crs: str | None
    local: bool
    north: North

    def named(self, places: Sequence[Places]) -> str:
        """The coordinate system, which has heights if any place has."""
        if self.crs is not None:
            return self.crs
        heights = any(np.isfinite(place.position[:, 2]).any() for place in places)
        return _WITH_HEIGHTS if heights else _FLAT


def system(survey: str, drives: Sequence[Recording], options: ReadOptions) -> System:
    """The coordinate system that the options and the recordings agree on.

    Raises
    ------
    UnknownCrs : positions are in a frame of their own and no `--crs` says what it is.
    BadSurvey : no positions, or none in the system that was named.
    """
    fixes = any(drive.fixes for drive in drives)
    poses = any(drive.poses or drive.transforms for drive in drives)
    given = None if options.crs is None else crs_name(options.crs)
    if given is not None and not is_geographic(given):
        if poses:
            return System(given, True, options.north or "grid")
        if fixes:
            raise BadSurvey(
                f"survey {survey}: its positions are longitudes and latitudes in WGS 84, which "
                f"--crs {given} is not; leave --crs out"
            )
    if fixes:
        return System(given, False, options.north or "true")
    if poses:
        raise UnknownCrs(
            f"survey {survey}: positions are in the frames {_frames(drives)}, without a "
            "coordinate system, and there is no LocationFix or NavSatFix; if a frame is that of a "
            "map in projected coordinates, name it with --crs (such as --crs EPSG:25832)"
        )
    raise BadSurvey(
        f"survey {survey}: no positions; expected LocationFix, NavSatFix, PoseInFrame, Odometry, "
        f"PoseStamped or transforms among its topics: {topics(drives)}. Without positions: "
        "--no-pose"
    )


def refuse_unless_inside(
    survey: str, images: Sequence[PosedImage], crs: str, drives: Sequence[Recording]
) -> None:
    """Metres of a frame that is no map's are most often far from where `crs` is used.

    Raises
    ------
    BadSurvey : all of them are, and there are fixes that would have done without `crs`.
    """
    poses = [pose for image in images if (pose := image.pose) is not None]
    if not any(drive.fixes for drive in drives) or not poses:
        return
    if outside_area(poses, crs).all():
        raise BadSurvey(
            f"survey {survey}: its poses are no coordinates of {crs}; the first is x "
            f"{poses[0].easting:g}, y {poses[0].northing:g}. Leave --crs out: the positions in "
            "WGS 84 that were recorded as well will be used"
        )


def _frames(drives: Sequence[Recording]) -> str:
    frames = {topic.frame for drive in drives for topic in drive.poses}
    frames |= {parent for drive in drives for _, parent in drive.transforms}
    return ", ".join(sorted(map(repr, frames))[:10])


def topics(drives: Sequence[Recording]) -> str:
    """All topics with their kinds, for a person."""
    every = sorted({f"{topic.name} ({topic.kind})" for drive in drives for topic in drive.topics})
    return ", ".join(every[:30]) + (", ..." if len(every) > 30 else "") if every else "none"


def camera_names(drive: Recording) -> dict[CameraKey, str]:
    """Each camera's frame; its topic where it has none or shares it."""
    uses = Counter(camera.frame for camera in drive.images)
    return {
        camera: camera.frame if camera.frame and uses[camera.frame] == 1 else camera.topic
        for camera in drive.images
    }


def bare_images(drive: Recording) -> list[PosedImage]:
    """All images without poses."""
    names = camera_names(drive)
    return [
        _image(image, None, _camera(drive, key, names[key], image))
        for key, images in drive.images.items()
        for image in images
    ]


def posed_images(
    drive: Recording, places: Places, crs: str, north: North
) -> tuple[list[PosedImage], list[Skipped]]:
    """The images of one camera that have a position, and why the others have none."""
    name = camera_names(drive)[places.camera]
    geographic = is_geographic(crs)
    angles = np.column_stack(hpr_from_rotations(places.rotation))
    posed: list[PosedImage] = []
    skipped: list[Skipped] = []
    for at, image in enumerate(places.images):
        position, hpr = places.position[at], angles[at]
        reason: str | None = places.reasons[at]
        if not reason and not np.isfinite(position[:2]).all():
            reason = "a transform between the pose and the camera has a gap there"
        if reason:
            skipped.append(Skipped(image.uri, f"image without pose: {reason}"))
            continue
        pose = Pose(
            easting=float(position[0]),
            northing=float(position[1]),
            crs=crs,
            altitude_m=_known(position[2]),
            heading_deg=_known(hpr[0] if np.isfinite(hpr[0]) else places.heading_deg[at]),
            pitch_deg=_known(hpr[1]),
            roll_deg=_known(hpr[2]),
            north=north,
            position_error_m=_known(places.error_m[at]),
        )
        if (problem := pose_problem(pose, geographic)) is not None:
            skipped.append(Skipped(image.uri, problem))
            continue
        camera = _camera(drive, places.camera, name, image)
        posed.append(_image(image, normalised(pose), camera))
    return posed, skipped


def _known(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _camera(drive: Recording, key: CameraKey, name: str, image: ImageAt) -> Camera:
    calibration = calibration_of(key, drive.calibrations)
    if calibration is None:
        return Camera(name, None, image.width_px or None, image.height_px or None)
    return Camera(
        name,
        hfov_deg(calibration),
        image.width_px or calibration.width_px or None,
        image.height_px or calibration.height_px or None,
    )


def _image(image: ImageAt, pose: Pose | None, camera: Camera) -> PosedImage:
    return PosedImage(
        uri=image.uri,
        path=image.path,
        fragment=str(Fragment(message=image.message)),
        pose=pose,
        camera=camera,
        captured_at=moment(image.stamp_ns),
    )
