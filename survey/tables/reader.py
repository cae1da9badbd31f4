"""A folder of images with a pose table: text, JSON or a layer of points.

North: the `north` option, else the profile's, else grid for a projected system and true for
degrees.
"""

from collections.abc import Callable, Set
from pathlib import Path, PurePath

from contracts.errors import BadSurvey, WrongInput
from contracts.places import Place
from contracts.records import PosedImage, Skipped
from survey.files import list_images, visible_objects
from survey.options import Reader, Reading, ReadOptions
from survey.stored import is_file
from survey.tables import mapping, records, text, vector
from survey.tables.images import ImageFinder, filled
from survey.tables.profile import Profile
from survey.tables.profiles import NOT_RESULTS, of_results, recognised, recognised_cells
from survey.tables.rows import Rows, read_rows
from survey.tables.table import Table

_TEXT_SUFFIXES = frozenset({".csv", ".tsv", ".txt"})
_MAPILLARY = "mapillary_image_description.json"
_TABLE_SUFFIXES = frozenset({".csv", ".tsv", ".json"}) | vector.SUFFIXES
"""Of what may be a pose table without being named; of JSON only Mapillary's."""


def recognises(path: Place) -> bool:
    """A table, or a folder with at least one that names a file and a position."""
    if is_file(path):
        known = path.suffix.lower() in _TEXT_SUFFIXES or records.is_records(path)
        return known or vector.vector_format(path) is not None
    return bool(_tables_in(path))


def read(path: Place, options: ReadOptions, wanted: Callable[[str], bool]) -> Reading:
    """Every image that has a row; no image is opened.

    Raises
    ------
    BadSurvey : no table or several, or columns that cannot be understood.
    UnknownCrs : coordinates without a system, or one that is not known.
    BadConfig : a mapping that makes no sense.
    """
    del wanted
    given = None if options.mapping is None else mapping.read_mapping(options.mapping)
    file = path if is_file(path) else _only_table(path, given)
    table, profile = _read_table(file, given)
    rows = read_rows(table, profile, options)
    listing = list_images(file.parent)
    images, skipped = _match(rows, ImageFinder.of(listing, profile.loose_names), profile)
    posed = {image.uri for image in images} | {skip.uri for skip in skipped}
    skipped += [
        Skipped(uri, f"image without pose: no {table.row_word} of {file.name} names it")
        for uri in listing.paths.keys() - posed
    ]
    skipped += listing.skipped
    return Reading(tuple(images), tuple(skipped), rows.positions.crs, rows.notes)


def _tables_in(folder: Place) -> list[Place]:
    try:
        entries = _files_in(folder, _TABLE_SUFFIXES)
    except OSError as error:
        raise BadSurvey(f"survey {folder} cannot be listed: {error.strerror}") from error
    return [entry for entry in entries if _looks_like_poses(entry)]


def _files_in(folder: Place, suffixes: Set[str]) -> list[Place]:
    """Files right in a folder, in order of names, of those whose names end so."""

    def fits(path: PurePath) -> bool:
        return path.suffix.lower() in suffixes

    if isinstance(folder, Path):
        return [each for each in sorted(folder.iterdir()) if fits(each) and each.is_file()]
    names = visible_objects(folder)
    return [folder / name for name in names if "/" not in name and fits(PurePath(name))]


def _looks_like_poses(file: Place) -> bool:
    suffix = file.suffix.lower()
    if suffix in {".csv", ".tsv"}:
        return text.looks_like_poses(file)
    if suffix in vector.SUFFIXES:
        return vector.vector_format(file) is not None and vector.holds_poses(file)
    return file.name == _MAPILLARY


def _only_table(folder: Place, given: mapping.TableMapping | None) -> Place:
    if given is not None and given.table is not None:
        file = folder / given.table
        if PurePath(given.table).name != given.table or not file.is_file():
            raise BadSurvey(f"survey {folder}: the mapping's table {given.table!r} is not in it")
        return file
    tables = _tables_in(folder) if given is None else _candidates(folder)
    if len(tables) != 1:
        names = ", ".join(table.name for table in tables) or "none"
        raise BadSurvey(
            f"survey {folder}: expected one pose table (such as CSV with a file and a position), "
            f"found {names}; give the path of the table itself"
        )
    return tables[0]


def _candidates(folder: Place) -> list[Place]:
    """Files that a mapping could be about."""
    return _files_in(folder, _TEXT_SUFFIXES | vector.SUFFIXES)


def untaken_tables(folder: Place) -> str:
    """What is to be told of the files in a folder that could be pose tables; "" without any.

    A `.txt` that is no table is a text like others.
    """
    told = ""
    for file in _candidates(folder):
        try:
            _read_table(file, None)
        except WrongInput as error:
            if file.suffix.lower() != ".txt":
                reason = str(error).removeprefix(f"pose table {file}").lstrip(":, ")
                told += f"; {file.name} is there but is no pose table: {reason}"
        else:
            told += f"; {file.name} is there: give its path if it is the pose table"
    return told


def _read_table(file: Place, given: mapping.TableMapping | None) -> tuple[Table, Profile]:
    own = None if given is None else given.profile
    if vector.vector_format(file) is not None:
        table = vector.read_vector(file, own)
    elif records.is_records(file):
        table = records.read_records(file)
    else:
        table = text.read_text(file, text.Layout() if given is None else given.layout, own)
    if not len(table):
        raise BadSurvey(f"pose table {file} has columns but no rows; expected one an image")
    return table, own or _profile(table)


def _profile(table: Table) -> Profile:
    """The kind of table it is, by its header, or its first row if it has none."""
    if not table.names:
        profile = recognised_cells([column[0] for column in map(table.texts, range(table.width))])
    else:
        if of_results(table.names):
            raise BadSurvey(f"pose table {table.path}: {NOT_RESULTS}")
        profile = recognised(table.names, has_position=table.xyz is not None)
    if profile is None:
        raise BadSurvey(
            f"pose table {table.path}: columns {list(table.names)}, expected one for the file "
            "(file, image, path) and two for the position (x, y or easting, northing or lon, "
            "lat); a mapping (--mapping) can say which they are"
        )
    return profile


def _match(
    rows: Rows, finder: ImageFinder, profile: Profile
) -> tuple[list[PosedImage], list[Skipped]]:
    """Images with the first row of each, and what is wrong with all other rows."""
    images: list[PosedImage] = []
    skipped: list[Skipped] = []
    row_of: dict[str, int] = {}
    told = {skip.uri for skip in finder.listing.skipped} - finder.listing.paths.keys()
    for at, name in enumerate(filled(profile.template, rows.files, rows.cameras)):
        uri = finder.uri(name)
        if uri in told:  # the file is there and its own reason is known
            continue
        reason = rows.faults.get(at)
        if (problem := finder.problem(uri)) is not None:
            reason = f"{rows.table.row(at)}: {problem}"
        if reason is None and uri in row_of:
            first = rows.table.numbers[row_of[uri]]
            word = rows.table.row_word
            reason = f"{rows.table.row(at)}: the same image as {word} {first}, which counts"
        if reason is None:
            image = rows.image(at, uri, finder.listing.paths[uri])
            if isinstance(image, PosedImage):
                row_of[uri] = at
                images.append(image)
                continue
            reason = image
        label = uri or f"{rows.table.row_word} {rows.table.numbers[at]}"
        skipped.append(Skipped(label, reason))
    return images, skipped


READER = Reader("table", recognises, read)
