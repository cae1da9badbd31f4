"""A folder of images with a pose table: file, x/y or lon/lat, z, heading, pitch, roll, time.

North: the `north` option; without it, grid for a projected system and true for degrees.
"""

import unicodedata
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from contracts.config import North
from contracts.errors import BadSurvey, UnknownCrs
from contracts.records import Camera, Pose, PosedImage, Skipped
from survey.files import Listing, list_images
from survey.options import Reader, Reading, ReadOptions
from survey.poses import crs_name, is_geographic, normalised, pose_problem
from survey.table_columns import Columns, find_columns
from survey.table_text import TextTable, looks_like_poses, read_table
from survey.times import zoned_time

_TABLE_SUFFIXES = frozenset({".csv", ".tsv", ".txt"})


@dataclass(frozen=True, slots=True)
class _Frame:
    """What all poses of a table share."""

    crs: str
    geographic: bool
    north: North
    decimal_comma: bool


def recognises(path: Path) -> bool:
    """A table, or a folder with at least one whose header names a file and a position."""
    if path.is_file():
        return path.suffix.lower() in _TABLE_SUFFIXES
    return bool(_tables_in(path))


def read(path: Path, options: ReadOptions, wanted: Callable[[str], bool]) -> Reading:
    """Every image that has a row; no image is opened.

    Raises
    ------
    BadSurvey : no table or several, or columns that cannot be understood.
    UnknownCrs : coordinates without a system, or one that is not known.
    """
    del wanted
    file = path if path.is_file() else _only_table(path)
    table = read_table(file)
    given = None if options.crs is None else crs_name(options.crs)
    degrees_wanted = given is None or is_geographic(given)
    columns = find_columns(table.header, str(file), prefer_degrees=degrees_wanted)
    frame = _frame(file, table, columns, given, options.north)
    listing = list_images(file.parent)
    images, skipped = _match(table, columns, frame, listing)
    posed = {image.uri for image in images} | {skip.uri for skip in skipped}
    skipped += [
        Skipped(uri, f"image without pose: no row of {file.name} names it")
        for uri in listing.paths.keys() - posed
    ]
    return Reading(tuple(images), tuple(skipped) + listing.skipped, frame.crs)


def _tables_in(folder: Path) -> list[Path]:
    try:
        entries = sorted(folder.iterdir())
    except OSError as error:
        raise BadSurvey(f"survey {folder} cannot be listed: {error.strerror}") from error
    return [
        entry
        for entry in entries
        if entry.suffix.lower() in {".csv", ".tsv"} and entry.is_file() and looks_like_poses(entry)
    ]


def _only_table(folder: Path) -> Path:
    tables = _tables_in(folder)
    if len(tables) != 1:
        names = ", ".join(table.name for table in tables) or "none"
        raise BadSurvey(
            f"survey {folder}: expected one pose table (CSV with a file and a position), found "
            f"{names}; give the path of the table itself"
        )
    return tables[0]


def _frame(
    file: Path, table: TextTable, columns: Columns, given: str | None, north: North | None
) -> _Frame:
    if given is None and not columns.in_degrees:
        names = f"{table.header[columns.x]!r}, {table.header[columns.y]!r}"
        raise UnknownCrs(
            f"pose table {file}: coordinates {names} without a coordinate system; name it with "
            "--crs (such as --crs EPSG:2154), or call the columns lon and lat if they are degrees"
        )
    crs = given or "EPSG:4326"
    geographic = is_geographic(crs)
    if columns.in_degrees and not geographic:
        raise BadSurvey(
            f"pose table {file}: columns lon and lat are degrees but --crs {crs} is projected; "
            "leave --crs out, or name the columns x and y if they are in its units"
        )
    return _Frame(
        crs=crs,
        geographic=geographic,
        north=north or ("true" if geographic else "grid"),
        decimal_comma=table.separator != ",",
    )


def _match(
    table: TextTable, columns: Columns, frame: _Frame, listing: Listing
) -> tuple[list[PosedImage], list[Skipped]]:
    images: list[PosedImage] = []
    skipped: list[Skipped] = []
    row_of: dict[str, int] = {}
    told = {skip.uri for skip in listing.skipped} - listing.paths.keys()
    for number, cells in table.rows:
        name = _cell(cells, columns.file)
        uri = local_uri(name)
        if uri in told:  # the file is there and its own reason is known
            continue
        image = _posed(uri, cells, columns, frame, listing)
        if isinstance(image, PosedImage) and uri in row_of:
            image = f"the same image as row {row_of[uri]}, which counts; remove one"
        if isinstance(image, PosedImage):
            row_of[uri] = number
            images.append(image)
        else:
            skipped.append(Skipped(uri or f"row {number}", f"row {number}: {image}"))
    return images, skipped


def local_uri(name: str) -> str:
    """The uri a row means: `/` for a backslash, no leading `./`, NFC. Confined elsewhere."""
    return unicodedata.normalize("NFC", name.replace("\\", "/")).removeprefix("./")


def _confined(uri: str) -> bool:
    drive = uri[1:3] == ":/" or "://" in uri
    return not (uri.startswith("/") or drive or ".." in uri.split("/"))


def _posed(
    uri: str, cells: list[str], columns: Columns, frame: _Frame, listing: Listing
) -> PosedImage | str:
    """One row's image, or why the row is left out."""
    if not uri:
        return "names no file"
    if not _confined(uri):
        return f"{uri!r} is not a path within the survey; paths are relative to the table's folder"
    file = listing.paths.get(uri)
    if file is None:
        return f"pose without image: no image {uri!r} in the survey"
    try:
        pose = _pose(cells, columns, frame)
        hfov_deg = _number(cells, columns.hfov, "hfov", frame)
    except ValueError as error:
        return str(error)
    problem = pose_problem(pose, frame.geographic)
    if problem is not None:
        return problem
    camera = Camera(name=_cell(cells, columns.camera), hfov_deg=hfov_deg)
    return PosedImage(uri, file, normalised(pose), camera, zoned_time(_cell(cells, columns.time)))


def _pose(cells: list[str], columns: Columns, frame: _Frame) -> Pose:
    """Raises ValueError with what is wrong."""
    x = _number(cells, columns.x, "longitude" if columns.in_degrees else "easting", frame)
    y = _number(cells, columns.y, "latitude" if columns.in_degrees else "northing", frame)
    if x is None or y is None:
        raise ValueError("image without pose: its coordinates are empty")
    return Pose(
        easting=x,
        northing=y,
        crs=frame.crs,
        altitude_m=_number(cells, columns.z, "altitude", frame),
        heading_deg=_number(cells, columns.heading, "heading", frame),
        pitch_deg=_number(cells, columns.pitch, "pitch", frame),
        roll_deg=_number(cells, columns.roll, "roll", frame),
        north=frame.north,
    )


def _number(cells: list[str], column: int | None, name: str, frame: _Frame) -> float | None:
    """A cell's number, None if it is empty; ValueError says what is wrong with it."""
    text = _cell(cells, column)
    if not text:
        return None
    if frame.decimal_comma and "." not in text:
        text = text.replace(",", ".")
    try:
        return float(text)
    except ValueError:
        raise ValueError(f"{name} is {text!r}, expected a number") from None


def _cell(cells: list[str], column: int | None) -> str:
    return "" if column is None or column >= len(cells) else cells[column].strip()


READER = Reader("table", recognises, read)
