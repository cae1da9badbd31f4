"""Equirectangular panoramas: which images are, and the perspective views they are cut into."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

from contracts.errors import UnusableImage
from contracts.records import Camera, Pose, PosedImage, Skipped
from geo.attitude import Attitude, camera_attitude, enu_from_frd, enu_from_rdf
from geo.headings import wrapped_360
from survey.equirectangular import PanoramaArea
from survey.fragments import View, parse_fragment
from survey.image_header import ImageHeader, read_header
from survey.track import camera_key
from survey.xmp import Properties, gpano_number, gpano_text

VIEW_FOV_DEG = 80.0
"""Shows 40 degrees above the horizon. Wider views would draw their corners out by more than the
2.4 times of this one; narrower ones need more than half of a panorama of 8192 columns for 1024
pixels, so that it could not be decoded at half its size."""
VIEW_YAWS_DEG = tuple(45.0 * turn for turn in range(8))
"""Neighbours share 35 degrees, so that what is narrower is whole in one of them."""
_MIN_WIDTH_PX = 4096
"""A picture twice as wide as high is taken for a panorama from this width, without GPano."""
_CANDIDATE_RATIO = 1.9
_WHOLE_TURN_DEG = 360.0
_ROUNDING = 1e-3
_STRETCH = 0.02


def panorama_area(header: ImageHeader) -> PanoramaArea | None:
    """The part of the sphere an image shows; None if it is not an equirectangular panorama.

    It is one if its GPano XMP says so, or if it has no GPano, is exactly twice as wide as high
    and at least 4096 wide. A GPano without a crop means all round, and centred on the horizon.

    Raises
    ------
    UnusableImage : GPano gives a crop that cannot be.
    """
    width, height = header.width_px, header.height_px
    projection = gpano_text(header.xmp, "ProjectionType").lower()
    if not projection:
        is_panorama = width == 2 * height and width >= _MIN_WIDTH_PX
        return PanoramaArea() if is_panorama else None
    return None if projection != "equirectangular" else _area(header.xmp, width, height)


def cut_panoramas(
    images: Sequence[PosedImage],
) -> tuple[tuple[PosedImage, ...], tuple[Skipped, ...]]:
    """Images with each panorama replaced by its views, and the panoramas that cannot be cut.

    Headers are looked into only where a camera's field of view and size leave it open. Where not
    even the size is known, the first image of a camera in a folder speaks for the others: if it
    is no panorama, they are not looked at. A crop too narrow for a view is used as it is.
    """
    kept: list[PosedImage] = []
    skipped: list[Skipped] = []
    of_size_unknown: dict[tuple[object, ...], bool] = {}
    for image in images:
        key = camera_key(image) if image.camera.width_px is None else ()
        if not _may_be_panorama(image.camera) or not of_size_unknown.get(key, True):
            kept.append(image)
            continue
        try:
            header = read_header(image.path, image.fragment)
        except UnusableImage:
            kept.append(image)  # whoever decodes it will say what is wrong with it
            continue
        try:
            area = panorama_area(header)
        except UnusableImage as error:
            skipped.append(Skipped(image.uri, str(error)))
            continue
        if key:
            of_size_unknown.setdefault(key, area is not None)
        kept += [image] if area is None else cut(image, area) or [image]
    return tuple(kept), tuple(skipped)


def _may_be_panorama(camera: Camera) -> bool:
    """Whether what is known of a camera leaves it open that its images are panoramas.

    A panorama less than 1.9 times as wide as high, a narrow crop, is used as it is.
    """
    if camera.hfov_deg is not None and camera.hfov_deg < 180.0:
        return False
    if camera.width_px is None or camera.height_px is None:
        return True
    return camera.width_px >= _CANDIDATE_RATIO * camera.height_px


def cut(image: PosedImage, area: PanoramaArea) -> tuple[PosedImage, ...]:
    """Perspective views of a panorama, each with its own pose, field of view and uri.

    Eight, 45 degrees apart at the panorama's horizon, 80 degrees wide and high; of a cropped one
    those it wholly shows from left to right. Their uris end in `#` and the fragment.

    Parameters
    ----------
    image : its pose is that of the panorama's middle column at its horizon. Where only one of
        pitch and roll is known the views have none; the heading is then that of a level camera.
    """
    whole = parse_fragment(image.fragment)
    base = image.uri.removesuffix(f"#{image.fragment}") if image.fragment else image.uri
    views = []
    for yaw in VIEW_YAWS_DEG:
        if not _shows(area, yaw):
            continue
        view = View(yaw, 0.0, VIEW_FOV_DEG)
        fragment = str(replace(whole, view=view))
        views.append(
            replace(
                image,
                uri=f"{base}#{fragment}",
                fragment=fragment,
                pose=None if image.pose is None else view_pose(image.pose, view),
                camera=Camera(image.camera.name, VIEW_FOV_DEG),
            )
        )
    return tuple(views)


def view_pose(pose: Pose, view: View) -> Pose:
    """The pose of a view from that of its panorama."""
    if pose.pitch_deg is None or pose.roll_deg is None:
        heading = None if pose.heading_deg is None else wrapped_360(pose.heading_deg + view.yaw_deg)
        return replace(pose, heading_deg=heading, pitch_deg=None, roll_deg=None)
    panorama = Attitude(pose.heading_deg or 0.0, pose.pitch_deg, pose.roll_deg)
    ahead = Attitude(0.0, 0.0, 0.0)
    frd_from_view = enu_from_frd(ahead).T @ enu_from_rdf(Attitude(view.yaw_deg, view.pitch_deg, 0))
    turned = camera_attitude(enu_from_frd(panorama) @ frd_from_view)
    return replace(
        pose,
        heading_deg=None if pose.heading_deg is None else turned.heading_deg,
        pitch_deg=turned.pitch_deg,
        roll_deg=turned.roll_deg,
    )


def _shows(area: PanoramaArea, yaw_deg: float) -> bool:
    """Whether a view at this yaw lies within the columns of a picture."""
    if area.is_all_round:
        return True
    left = (area.left - 0.5) * _WHOLE_TURN_DEG
    from_left = (yaw_deg - VIEW_FOV_DEG / 2 - left) % _WHOLE_TURN_DEG
    return from_left + VIEW_FOV_DEG <= area.width * _WHOLE_TURN_DEG


def _area(properties: Properties, width_px: int, height_px: int) -> PanoramaArea:
    number = partial(gpano_number, properties)
    full_width, full_height = number("FullPanoWidthPixels"), number("FullPanoHeightPixels")
    if full_width is None or full_height is None:
        tall = 2.0 * height_px / width_px
        area = PanoramaArea(0.0, (1.0 - tall) / 2.0, 1.0, tall)
    elif not (full_width > 0.0 and full_height > 0.0):
        raise UnusableImage(f"GPano gives a full panorama of {full_width:g} x {full_height:g}")
    else:
        area = PanoramaArea(
            left=(number("CroppedAreaLeftPixels") or 0.0) / full_width,
            top=(number("CroppedAreaTopPixels") or 0.0) / full_height,
            width=(number("CroppedAreaImageWidthPixels") or full_width) / full_width,
            height=(number("CroppedAreaImageHeightPixels") or full_height) / full_height,
        )
    within = (
        min(area.left, area.top) >= -_ROUNDING
        and max(area.left + area.width, area.top + area.height) <= 1.0 + _ROUNDING
        and min(area.width, area.height) > 0.0
    )
    # Degrees a pixel must agree, or the picture was stretched or cut after GPano was written.
    across, down = area.width * 2.0 / width_px, area.height / height_px
    if not (within and abs(across - down) < _STRETCH * down):
        raise UnusableImage(
            f"GPano's crop does not fit its {width_px} x {height_px} pixels: {area}; "
            "write FullPano* and CroppedArea* anew, or take GPano out"
        )
    return area
