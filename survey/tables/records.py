"""A table as a JSON list of objects, such as `mapillary_image_description.json`."""

import json

from contracts.errors import BadSurvey
from contracts.places import Place
from survey.stored import open_place
from survey.tables.profile import plain_name
from survey.tables.table import Faults, Table

_MAX_BYTES = 1 << 30


def is_records(path: Place) -> bool:
    """Whether a file is JSON that begins with a list."""
    try:
        with open_place(path) as file:
            start = file.read(64)
    except OSError:
        return False
    text = start.removeprefix(b"\xef\xbb\xbf").lstrip()
    return path.suffix.lower() == ".json" and text.startswith(b"[")


def read_records(path: Place) -> Table:
    """One row an object; an object within one gives columns `outer.inner`.

    An entry that mapillary_tools gave up on (`error`), or that is no image, is a fault.

    Raises
    ------
    BadSurvey : unreadable, not JSON, or not a list of objects.
    """
    entries = _entries(path)
    flat = [_flat(entry) for entry in entries]
    names = list(dict.fromkeys(name for entry in flat for name in entry))
    columns = tuple([entry.get(name, "") for entry in flat] for name in names)
    numbers = range(1, len(entries) + 1)
    table = Table(path, tuple(names), columns, numbers, row_word="entry")
    faults: Faults = {}
    for at, entry in enumerate(flat):
        plain = {plain_name(name): cell for name, cell in entry.items()}
        if "error.message" in plain:
            faults[at] = f"{table.row(at)}: mapillary_tools left it out: {plain['error.message']}"
        elif plain.get("filetype", "image") != "image":
            faults[at] = f"{table.row(at)}: is a {plain['filetype']}, not an image"
    return Table(path, tuple(names), columns, numbers, row_word="entry", faults=faults)


def _entries(path: Place) -> list[dict[str, object]]:
    try:
        if path.stat().st_size > _MAX_BYTES:
            raise BadSurvey(f"pose table {path} is larger than 1 GiB; write it as CSV")
        entries = json.loads(path.read_bytes())
    except OSError as error:
        raise BadSurvey(f"pose table {path} cannot be read: {error.strerror}") from error
    except (ValueError, RecursionError) as error:
        raise BadSurvey(f"pose table {path} is not JSON: {error}") from error
    if not isinstance(entries, list):
        raise BadSurvey(f"pose table {path}: expected a list of objects")
    for number, entry in enumerate(entries, 1):
        if not isinstance(entry, dict):
            raise BadSurvey(f"pose table {path} entry {number}: expected an object")
    return entries


def _flat(entry: dict[str, object]) -> dict[str, str]:
    cells: dict[str, str] = {}
    for name, value in entry.items():
        if isinstance(value, dict):
            cells |= {f"{name}.{inner}": _text(cell) for inner, cell in value.items()}
        else:
            cells[name] = _text(value)
    return cells


def _text(value: object) -> str:
    return "" if value is None else str(value)
