"""The image files of a survey: found within its root and nowhere else."""

import os
import stat
import unicodedata
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from contracts.errors import BadSurvey
from contracts.places import Place
from contracts.records import Skipped
from survey.stored import objects_below

if TYPE_CHECKING:
    from upath import UPath

IMAGE_SUFFIXES = frozenset(
    {
        ".jpg",
        ".jpeg",
        ".png",
        ".tif",
        ".tiff",
        ".webp",
        ".heic",
        ".heif",
        ".bmp",
        ".jp2",
        ".ppm",
        ".pgm",
    }
)


@dataclass(frozen=True, slots=True)
class Listing:
    """Image files under a root.

    paths : local uri (relative to the root, NFC, with `/`) -> path that can be opened.
    skipped : what looks like an image and cannot be one, or is not inside the root.
    """

    paths: dict[str, str]
    skipped: tuple[Skipped, ...]


def list_images(root: Place) -> Listing:
    """Every regular file or object under `root` whose name ends like an image's.

    Hidden files and folders (names with a leading dot) are not looked at. Symbolic links to
    files are followed as long as they stay inside the root; links to folders inside it are not,
    since their files are found where they are.

    Raises
    ------
    BadSurvey : the root itself cannot be listed.
    """
    return _listed_folder(root) if isinstance(root, Path) else _listed_store(root)


def _listed_store(root: "UPath") -> Listing:
    found: dict[str, str] = {}
    skipped: list[Skipped] = []
    for name in visible_objects(root):
        if not is_image_name(name):
            continue
        uri = printable_uri(name)
        if {"", ".", ".."} & set(name.split("/")):
            reason = "its name has an empty part, . or .. between /; rename it in the store"
            skipped.append(Skipped(uri, reason))
        else:
            _add(found, skipped, uri, f"{str(root).rstrip('/')}/{name}")
    return Listing(found, tuple(skipped))


def visible_objects(root: "UPath") -> Iterator[str]:
    """Names of the objects of a survey in a store, relative to it, without hidden ones.

    Raises
    ------
    BadSurvey : the store cannot be listed.
    """
    try:
        names = objects_below(root)
    except OSError as error:
        raise BadSurvey(f"survey {root} cannot be listed: {error.strerror}") from error
    for name in names:
        if name and not any(part.startswith(".") and part.strip(".") for part in name.split("/")):
            yield name


def _listed_folder(root: Path) -> Listing:
    found: dict[str, str] = {}
    skipped: list[Skipped] = []
    real_root = os.path.realpath(root)
    folders = [(str(root), "")]
    while folders:
        folder, prefix = folders.pop()
        try:
            entries = sorted(os.scandir(folder), key=lambda entry: os.fsencode(entry.name))
        except OSError as error:
            if not prefix:
                raise BadSurvey(
                    f"survey {root} cannot be listed: {error.strerror}; "
                    "give a folder that this user may read"
                ) from error
            skipped.append(Skipped(prefix, f"folder cannot be listed: {error.strerror}"))
            continue
        for entry in entries:
            if entry.name.startswith("."):
                continue
            uri = prefix + printable_uri(entry.name)
            if entry.is_dir(follow_symlinks=False):
                folders.append((entry.path, f"{uri}/"))
                continue
            reason = _unusable(entry, real_root)
            if reason == "":
                _add(found, skipped, uri, entry.path)
            elif reason is not None:
                skipped.append(Skipped(uri, reason))
    return Listing(found, tuple(skipped))


def is_image_name(name: str) -> bool:
    """Whether a name ends like an image's."""
    return os.path.splitext(name)[1].lower() in IMAGE_SUFFIXES  # noqa: PTH122


def printable_uri(text: str) -> str:
    """NFC, with bytes that are not UTF-8 shown as U+FFFD so that the uri can be written."""
    return unicodedata.normalize("NFC", os.fsencode(text).decode("utf-8", "replace"))


def _unusable(entry: os.DirEntry[str], real_root: str) -> str | None:
    """Why an entry is left out; "" if it is a good file, None if it is of no interest."""
    is_image = is_image_name(entry.name)
    linked = entry.is_symlink()
    # `os.path.isdir` answers False to a link that leads to itself; the entry's own raises.
    if not is_image and not (linked and os.path.isdir(entry.path)):  # noqa: PTH112
        return None
    if not _is_utf8(entry.path):
        return "its path is not UTF-8 and cannot be written into an index; rename it"
    if linked:
        target = os.path.realpath(entry.path)
        if os.path.commonpath([real_root, target]) != real_root:
            return "symbolic link leads out of the survey's folder; copy the file into it"
    if not is_image:
        return None
    try:
        mode = entry.stat().st_mode
    except OSError as error:
        return f"cannot be looked up: {error.strerror}"
    return "" if stat.S_ISREG(mode) else "not a regular file"


def _is_utf8(path: str) -> bool:
    try:
        path.encode()
    except UnicodeEncodeError:  # Python keeps a foreign byte as a lone surrogate
        return False
    return True


def _add(found: dict[str, str], skipped: list[Skipped], uri: str, path: str) -> None:
    if uri in found:
        reason = "another file's name is the same once written in Unicode NFC; rename one of them"
        skipped.append(Skipped(uri, reason))
        return
    found[uri] = path
