"""What a ground truth says, in the names it uses: nothing is looked up yet."""

from dataclasses import dataclass
from pathlib import Path

from contracts.errors import BadTruth

Box = tuple[float, float, float, float]
"""x1 y1 x2 y2 in pixels from the upper left corner of a photo."""

FORMATS = (
    "a JSON file with one object, query path -> list of relevant references; "
    "a folder of Oxford/Paris files (NAME_query.txt, NAME_good.txt, NAME_ok.txt, NAME_junk.txt); "
    "or an INRIA Holidays list, one image a line such as 100000.jpg"
)


@dataclass(frozen=True, slots=True)
class WrittenQuery:
    """One query as its truth writes it.

    query : its name in reports, once in a truth. photo : the name of its photo. relevant, junk :
    names of images. box : the part of the photo that is searched for.
    """

    query: str
    photo: str
    relevant: tuple[str, ...]
    junk: tuple[str, ...] = ()
    box: Box | None = None


def decoded_text(path: Path, content: bytes) -> str:
    """The text of a file, without a byte order mark.

    Raises
    ------
    BadTruth : it is not UTF-8.
    """
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise BadTruth(
            f"{path} is not UTF-8 text (byte {error.start}); save it as UTF-8."
        ) from error


def filled_lines(text: str) -> list[tuple[int, str]]:
    """Line number from 1, and line without surrounding spaces; empty lines are passed over."""
    lines = ((number, line.strip()) for number, line in enumerate(text.splitlines(), start=1))
    return [(number, line) for number, line in lines if line]
