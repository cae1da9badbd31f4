"""How a survey is to be read, what comes out, and what a reader of one format is."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from contracts.config import North
from contracts.globs import glob_matcher
from contracts.places import Place
from contracts.records import PosedImage, Skipped


@dataclass(frozen=True, slots=True)
class ReadOptions:
    """What the user says about a survey.

    crs : coordinate system of a pose table; None: only degrees named lon/lat are taken.
    north : which north headings count from; None: the format's own (each reader states it).
    no_pose : read the images alone, in a folder or in MCAP files; unless `format` names a reader,
        poses and metadata are not looked at, so neither are a survey's masks and the way it
        stores its images.
    include, exclude : globs on uris (`NAME/` included), see `selector`.
    format : a reader's name; None: recognised by content.
    make_upright, use_masks : whether rotated storage is put upright, vehicle masks applied.
    mapping : a TOML file that says what the columns of a table are (docs/surveys.md).
    max_gap_s : poses farther apart than this in time are not interpolated between.
    cut_panoramas : equirectangular panoramas become perspective views; False: used as they are.
    derive_headings : images of a sequence without headings get their track's direction.
    allow_ballpark : accept a conversion to WGS 84 whose accuracy nobody knows.
    name : prefix `NAME/` of the uris of a further survey.
    """

    crs: str | None = None
    north: North | None = None
    no_pose: bool = False
    include: tuple[str, ...] = ()
    exclude: tuple[str, ...] = ()
    format: str | None = None
    make_upright: bool = True
    use_masks: bool = True
    mapping: Path | None = None
    max_gap_s: float = 1.0
    cut_panoramas: bool = True
    derive_headings: bool = True
    allow_ballpark: bool = False
    name: str = ""

    def uri(self, local_uri: str) -> str:
        """The catalogue's uri of an image whose path within its survey is `local_uri`."""
        return f"{self.name}/{local_uri}" if self.name else local_uri


@dataclass(frozen=True, slots=True)
class Survey:
    """A survey as read: its images in the order of the bytes of their uris.

    crs : of every pose; None with `no_pose`. format : the reader's name. attribution : what the
    data itself asks to be shown beside results, or "". notes : what a person should know of how
    it was read.
    """

    images: tuple[PosedImage, ...]
    skipped: tuple[Skipped, ...]
    crs: str | None
    format: str
    attribution: str = ""
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Reading:
    """What one reader found, with uris local to the survey, in any order.

    crs : of every pose; compound or three-dimensional where the format says from what heights
    count. notes : what a person should know of how it was read, such as derived headings.
    """

    images: tuple[PosedImage, ...]
    skipped: tuple[Skipped, ...]
    crs: str | None
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Reader:
    """A survey format.

    recognises : whether the path holds this format, by content, without reading images.
    read : everything the path holds; `wanted` says which local uris are asked for, so that a
        reader that must open images opens only those.
    """

    name: str
    recognises: Callable[[Place], bool]
    read: Callable[[Place, ReadOptions, Callable[[str], bool]], Reading]


def selector(options: ReadOptions) -> Callable[[str], bool]:
    """Which local uris are asked for by `include` and `exclude`.

    Both are globs (contracts/globs.py).
    """
    include = [glob_matcher(pattern) for pattern in options.include]
    exclude = [glob_matcher(pattern) for pattern in options.exclude]

    def wanted(local_uri: str) -> bool:
        uri = options.uri(local_uri)
        if include and not any(matches(uri) for matches in include):
            return False
        return not any(matches(uri) for matches in exclude)

    return wanted
