"""Which column of a pose table is what."""

from dataclasses import dataclass

from contracts.errors import BadSurvey

_NAMES: dict[str, frozenset[str]] = {
    role: frozenset(names.split())
    for role, names in {
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
        "time": "time timestamp date datetime date_time captured_at capture_time time_utc",
        "camera": "camera camera_name cam sensor",
        "hfov": "hfov hfov_deg",
    }.items()
}


@dataclass(frozen=True, slots=True)
class Columns:
    """Positions of the columns of a pose table; None: not there.

    x, y : easting and northing, or longitude and latitude in degrees if `in_degrees`.
    """

    file: int
    x: int
    y: int
    in_degrees: bool
    z: int | None
    heading: int | None
    pitch: int | None
    roll: int | None
    time: int | None
    camera: int | None
    hfov: int | None


def has_pose_columns(header: list[str]) -> bool:
    """Whether a header names a file and a position."""
    roles = {role for role in map(_role, header) if role is not None}
    return "file" in roles and ({"x", "y"} <= roles or {"lon", "lat"} <= roles)


def find_columns(header: list[str], table: str, prefer_degrees: bool) -> Columns:
    """The columns of a header; names count whatever their case.

    prefer_degrees : which of lon/lat and x/y is used where a table has both.

    Raises
    ------
    BadSurvey : two columns for the same thing, or no file or position.
    """
    found: dict[str, int] = {}
    for at, name in enumerate(header):
        role = _role(name)
        if role is None:
            continue
        if role in found:
            raise BadSurvey(
                f"pose table {table}: columns {header[found[role]]!r} and {name!r} both say "
                f"{role}; remove or rename one of them"
            )
        found[role] = at
    if not has_pose_columns(header):
        raise BadSurvey(
            f"pose table {table}: columns {header}, expected one for the file (file, image, path) "
            "and two for the position (x, y or easting, northing or lon, lat)"
        )
    has_degrees, has_metres = {"lon", "lat"} <= found.keys(), {"x", "y"} <= found.keys()
    in_degrees = has_degrees and (prefer_degrees or not has_metres)
    return Columns(
        file=found["file"],
        x=found["lon" if in_degrees else "x"],
        y=found["lat" if in_degrees else "y"],
        in_degrees=in_degrees,
        z=found.get("z"),
        heading=found.get("heading"),
        pitch=found.get("pitch"),
        roll=found.get("roll"),
        time=found.get("time"),
        camera=found.get("camera"),
        hfov=found.get("hfov"),
    )


def _role(name: str) -> str | None:
    plain = "_".join(name.strip().lower().replace("-", "_").split())
    for role, names in _NAMES.items():
        if plain in names:
            return role
    return None
