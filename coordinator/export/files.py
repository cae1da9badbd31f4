"""Result files, written whole or not at all."""

from collections.abc import Iterable
from pathlib import Path

from contracts.errors import WrongInput
from index.files import write_atomic


def write_whole(out: Path, content: bytes) -> None:
    """Write `out` so that a reader sees the old file or the new one.

    Raises
    ------
    WrongInput : `out` cannot be written.
    """
    write_pieces(out, [content])


def write_pieces(out: Path, pieces: Iterable[bytes]) -> None:
    """Like `write_whole`, of content that is never in memory at once.

    Whatever `pieces` raises ends it: the old file stays, or none.

    Raises
    ------
    WrongInput : `out` cannot be written.
    """
    try:
        write_atomic(out, lambda stream: stream.writelines(pieces))
    except OSError as error:
        raise cannot_write(out, error.strerror) from error


def cannot_write(out: Path, reason: object) -> WrongInput:
    """What a person is told of a file that a system or a library would not write."""
    return WrongInput(
        f"cannot write {out}: {reason}; name a file (not a folder) where there is room and leave "
        "to write (--out)"
    )
