"""Globs on uris, the same wherever images are chosen by their names."""

import fnmatch
import re
import unicodedata
from collections.abc import Callable


def glob_matcher(pattern: str) -> Callable[[str], bool]:
    """Whether a uri is like a pattern.

    As in `fnmatch`, `*` also crosses `/`; `**/` also stands for no folder at all. A pattern
    without `/` may match the file's name alone. Case counts.
    """
    pieces = [
        fnmatch.translate(piece) for piece in unicodedata.normalize("NFC", pattern).split("**/")
    ]
    bodies = [
        piece.removeprefix("(?s:").removesuffix(")\\Z").removesuffix(")\\z") for piece in pieces
    ]
    expression = re.compile("(?:.*/)?".join(bodies), re.DOTALL)
    by_name = "/" not in pattern

    def matches(uri: str) -> bool:
        if expression.fullmatch(uri):
            return True
        return by_name and expression.fullmatch(uri.rpartition("/")[2]) is not None

    return matches
