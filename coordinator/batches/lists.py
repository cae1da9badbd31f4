"""Lists of photos: CSV or TSV with a column of paths, or a path a line."""

import codecs
import csv
import io
from contextlib import suppress
from pathlib import Path

from contracts.errors import WrongInput
from index.files import read_text_file

SUFFIXES = (".csv", ".tsv", ".txt")
COLUMNS = ("path", "file", "filename", "photo", "image")
"""Names of the column that is meant, in any case, the first that is there."""

_MAX_BYTES = 2**28
_MARKS = (  # those of UTF-32 begin like those of UTF-16
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)


def read_list(path: Path) -> list[str]:
    """The paths of a list, as written.

    UTF-8, UTF-16 or UTF-32 by its mark, else UTF-8, else that of Windows, else Latin-1. With a
    header that names one of `COLUMNS`, or without one a single column.

    Raises
    ------
    WrongInput : it cannot be read, or nobody can tell which column is meant.
    """
    try:
        text = _text(read_text_file(path, _MAX_BYTES))
    except OSError as error:
        raise WrongInput(f"The list {path} cannot be read: {error.strerror}.") from error
    except UnicodeDecodeError as error:
        raise WrongInput(f"The list {path} is not {error.encoding}; save it as UTF-8.") from error
    return paths_in(text, str(path))


def paths_in(text: str, name: str) -> list[str]:
    """The paths of a list's text. name : for messages. Errors as `read_list`."""
    if "\0" in text:
        raise WrongInput(f"The list {name} holds NUL characters; save it as text in UTF-8.")
    first = next((line for line in text.splitlines() if line.strip()), "")
    separator = max(",;\t", key=first.count)
    try:
        rows = list(csv.reader(io.StringIO(text, newline=""), delimiter=separator, strict=True))
    except csv.Error as error:
        raise WrongInput(f"The list {name} cannot be taken apart: {error}.") from error
    rows = [row for row in rows if any(cell.strip() for cell in row)]
    header = [cell.strip().lower() for row in rows[:1] for cell in row]
    column = next((header.index(each) for each in COLUMNS if each in header), None)
    if column is not None:
        rows = [[row[column]] for row in rows[1:] if _has(row, column)]
    if not rows:
        raise WrongInput(f"The list {name} names no photo.")
    if max(map(len, rows)) > 1:
        # A path a line, some with commas in their names, is no table.
        if separator == "," and not name.lower().endswith(".csv"):
            return [line.strip() for line in text.splitlines() if line.strip()]
        raise WrongInput(
            f"The list {name} has {len(header)} columns, and its first line "
            f"({', '.join(header)[:80]}) calls none {', '.join(COLUMNS)}. Give that column a name."
        )
    return [row[0].strip() for row in rows]


def _has(row: list[str], column: int) -> bool:
    return column < len(row) and bool(row[column].strip())


def _text(content: bytes) -> str:
    for mark, encoding in _MARKS:
        if content.startswith(mark):
            return content.decode(encoding)
    for encoding in ("utf-8", "cp1252"):
        with suppress(UnicodeDecodeError):
            return content.decode(encoding)
    return content.decode("latin-1")
