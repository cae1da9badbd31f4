"""The tables in use: how each is recognised by its header, and what its columns are.

A further one is a `Profile` more in `PROFILES`. docs/surveys.md says where each was looked up.
"""

from collections.abc import Mapping, Sequence

from survey.tables.convention import Convention
from survey.tables.profile import MATRIX, Profile, Role, plain_name


def _named(names: Mapping[Role, str]) -> dict[Role, tuple[str, ...] | int]:
    return {role: tuple(text.split()) for role, text in names.items()}


GENERIC = Profile(
    name="generic",
    columns=_named(
        {
            "file": "file filename file_name image image_name imagename image_file img path "
            "image_path file_path filepath photo uri",
            "x": "x easting east e x_m easting_m x_coord coord_x",
            "y": "y northing north n y_m northing_m y_coord coord_y",
            "lon": "lon lng long longitude lon_deg longitude_deg",
            "lat": "lat latitude lat_deg latitude_deg",
            "z": "z alt altitude height elevation z_m alt_m altitude_m height_m elevation_m",
            "heading": "heading heading_deg yaw yaw_deg azimuth azimuth_deg bearing bearing_deg",
            "pitch": "pitch pitch_deg tilt tilt_deg",
            "roll": "roll roll_deg",
            "omega": "omega omega_deg",
            "phi": "phi phi_deg",
            "kappa": "kappa kappa_deg",
            "time": "time timestamp date datetime date_time captured_at capture_time time_utc",
            "camera": "camera camera_name cam sensor",
            "hfov": "hfov hfov_deg",
            "error": "position_error_m gps_accuracy accuracy_m",
            "crs": "crs srs epsg srid wkid",
        }
    ),
)

_PHOTOGRAMMETRIC: dict[Role, str] = {
    "file": "filename file image imagename image_name",
    "x": "origin_(easting origin_(x easting x x0 x1 e",
    "y": "northing northing) y y0 y1 n",
    "lon": "origin_(longitude longitude lon",
    "lat": "origin_(latitude latitude lat",
    "z": "height) altitude) z) height altitude elevation z z0 z1",
    "omega": "omega",
    "phi": "phi",
    "kappa": "kappa",
    "camera": "camera cameraid camera_id",
}

_PEGASUS: tuple[Role | None, ...] = (
    *("file", None, "x", "y", "z", "omega", "phi", "kappa"),
    *("m11", "m21", "m31", "m12", "m22", "m32", "m13", "m23", "m33"),
)

PROFILES: tuple[Profile, ...] = (
    Profile(
        name="mapillary",
        needs=frozenset({"maplatitude", "maplongitude"}),
        columns=_named(
            {
                "file": "filename mapfilename",
                "lon": "maplongitude",
                "lat": "maplatitude",
                "z": "mapaltitude",
                "heading": "mapcompassheading.trueheading mapcompassheading_trueheading "
                "trueheading mapcompassheading",
                "time": "mapcapturetime",
                "camera": "mapcamerauuid",
                "error": "mapgpsaccuracymeters",
            }
        ),
        convention=Convention(
            time_format="%Y_%m_%d_%H_%M_%S_%f", time_zone="UTC", zero_headings_unknown=True
        ),
        north="true",
        loose_names=True,
        repeats=True,
    ),
    Profile(
        name="arcgis",
        needs=frozenset({"imagepath"}),
        columns=_named(
            {
                "file": "imagepath",
                "x": "x",
                "y": "y",
                "z": "z",
                "crs": "srs",
                "heading": "cameraheading",
                "pitch": "camerapitch",
                "roll": "cameraroll",
                "omega": "omega",
                "phi": "phi",
                "kappa": "kappa",
                "hfov": "horizontalfieldofview",
                "time": "acquisitiondate",
            }
        ),
        convention=Convention(pitch_zero="nadir", unknown=(-999.0,), time_format="unix_ms"),
        loose_names=True,
    ),
    Profile(
        name="navvis",
        needs=frozenset({"pano_pos_x", "pano_pos_y", "pano_ori_w"}),
        columns=_named(
            {
                "file": "filename",
                "x": "pano_pos_x",
                "y": "pano_pos_y",
                "z": "pano_pos_z",
                "qw": "pano_ori_w",
                "qx": "pano_ori_x",
                "qy": "pano_ori_y",
                "qz": "pano_ori_z",
                "time": "timestamp",
            }
        ),
        convention=Convention(camera_axes="flu", time_format="unix_s"),
    ),
    Profile(
        name="panoramax",
        needs=frozenset({"file", "lon", "lat", "capture_time"}),
        columns=_named(
            {
                "file": "file",
                "lon": "lon",
                "lat": "lat",
                "z": "exif.gpsinfo.gpsaltitude",
                "heading": "exif.gpsinfo.gpsimgdirection xmp.gpano.poseheadingdegrees heading",
                "pitch": "xmp.camera.pitch pitch",
                "roll": "xmp.camera.roll roll",
                "time": "capture_time",
            }
        ),
        north="true",
        repeats=True,
    ),
    Profile(
        name="stereopolis",
        needs=frozenset({"pan_xml_easting", "pan_xml_northing"}),
        columns=_named(
            {
                "file": "file filename image pan_xml_filename",
                "x": "pan_xml_easting",
                "y": "pan_xml_northing",
                "z": "pan_xml_altitude",
                "heading": "pan_xml_heading",
                "pitch": "pan_xml_pitch",
                "roll": "pan_xml_roll",
                "time": "pan_xml_date pan_xml_time",
            }
        ),
        crs="EPSG:2154",
        north="true",
    ),
    Profile(
        name="riprocess",
        needs=frozenset({"filename", "yaw(z)"}),
        columns=_named(
            _PHOTOGRAMMETRIC | {"heading": "yaw(z)", "pitch": "pitch(y)", "roll": "roll(x)"}
        ),
        repeats=True,  # `Direction` and `Up` have a northing and a height too
    ),
    Profile(
        name="matrix",
        needs=frozenset(MATRIX),
        columns=_named(_PHOTOGRAMMETRIC | {role: role for role in MATRIX}),
    ),
    Profile(
        name="pegasus",
        n_columns=(len(_PEGASUS),),
        columns={role: at for at, role in enumerate(_PEGASUS, 1) if role is not None},
    ),
    GENERIC,
)


_OF_RESULTS = frozenset({"query", "rank", "score"})
"""Columns of what `flaneur locate` writes, which may lie in the survey's folder."""

NOT_RESULTS = (
    "these are results of `flaneur locate`, not a survey; give the folder or the pose table that "
    "was indexed"
)


def of_results(header: Sequence[str]) -> bool:
    """Whether a header is of results of `flaneur locate`."""
    return {plain_name(name) for name in header} >= _OF_RESULTS


def recognised(header: Sequence[str], has_position: bool = False) -> Profile | None:
    """The first profile that a header fits; None for results, which name images as well."""
    if of_results(header):
        return None
    return next((p for p in PROFILES if p.fits(header, has_position)), None)


def recognised_cells(cells: Sequence[str]) -> Profile | None:
    """The profile without header that a first line fits."""
    return next((profile for profile in PROFILES if profile.fits_cells(cells)), None)
