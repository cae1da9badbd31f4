"""Words that another survey can use: an index's own, or a folder that holds nothing else.

Such a folder has the codebook files of every channel and `codebooks.json`, which says what they
are for, where they are from, and the size and digest of each.
"""

import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from contracts.config import DESCRIPTOR_SIZES, IndexConfig
from contracts.errors import BadIndex
from contracts.faults import first_fault
from index.codebooks import codebook_paths, codebooks_digest
from index.files import map_array, read_text_file
from index.manifest import FORMAT_VERSION, FileEntry, Generation, read_generation

MANIFEST = "codebooks.json"
_LARGEST_MANIFEST = 1 << 20
AGAIN = "Restore it, or import the words again."


class _Record(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class Origin(_Record):
    """The index that words were trained in, as far as it tells."""

    index: str
    generation: Annotated[int, Field(ge=1)]
    created_at: str
    surveys: tuple[str, ...]


class WordSet(_Record):
    """What words are for and where they are from.

    digest : tells these words from all others. quantisation : by channel, the mean squared
    distance of their own survey's descriptors to them. files : by name, of every channel.
    """

    format_version: int = FORMAT_VERSION
    config: IndexConfig
    digest: Annotated[str, Field(pattern=r"^[0-9a-f]{16}$")]
    origin: Origin
    quantisation: dict[str, Annotated[float, Field(ge=0, allow_inf_nan=False)]]
    files: dict[str, FileEntry]

    @model_validator(mode="after")
    def _makes_sense(self) -> Self:
        channels = self.config.features.channels()
        expected = {name for channel in channels for name in file_names(channel).values()}
        odd = sorted(expected ^ set(self.files))
        if odd:
            problem = "missing" if odd[0] in expected else "no file of these channels"
            raise ValueError(f"files: {odd[0][:60]!r} is {problem}")
        if self.digest != self.digest_of(channels):
            raise ValueError(f"digest {self.digest} is not that of the files")
        return self

    def digest_of(self, channels: Iterable[str]) -> str:
        """What tells the words of some channels from others."""
        words = {channel: file_names(channel)["words"] for channel in channels}
        return codebooks_digest({each: self.files[name].sha256 for each, name in words.items()})


@dataclass(frozen=True, slots=True)
class WordSource:
    """Words, and the folder where their files are."""

    folder: Path
    words: WordSet

    def size_of(self, channel: str) -> tuple[int, int]:
        """Words and dimensions of a channel.

        Raises
        ------
        BadIndex : the file is missing or damaged.
        """
        n_words, dimensions = map_array(
            self.folder / file_names(channel)["words"], np.uint8, 2
        ).shape
        return n_words, dimensions


def file_names(channel: str) -> dict[str, str]:
    """The names of a channel's codebook files, by what they hold."""
    return {what: path.name for what, path in codebook_paths(Path(), "", channel).items()}


def dimensions_of(channel: str) -> int:
    """The dimensions of a channel's descriptors, and so of its words."""
    return next(size for name, size in DESCRIPTOR_SIZES.items() if channel.endswith(f"-{name}"))


def open_words(source: Path) -> WordSource:
    """Open the words of an index's live generation, or of a folder that an import wrote.

    Raises
    ------
    BadIndex : neither, or what says so is damaged or of another format. The files are looked at
        when they are imported (index/importing.py).
    """
    if (source / MANIFEST).is_file():
        return WordSource(source, read_manifest(source / MANIFEST))
    if (source / "CURRENT").exists():
        generation = read_generation(source)
        return WordSource(source / "codebooks" / generation.codebooks, _own(source, generation))
    raise BadIndex(
        f"{source} holds no words to use: neither {MANIFEST} (written by `flaneur codebook "
        "import`) nor a finished index (CURRENT). Check the path."
    )


def read_manifest(path: Path) -> WordSet:
    """Read a `codebooks.json`.

    Raises
    ------
    BadIndex : it is damaged or of another format.
    """
    try:
        content = json.loads(read_text_file(path, _LARGEST_MANIFEST))
    except (OSError, ValueError, RecursionError) as error:
        raise BadIndex(f"{path} cannot be read ({error}). {AGAIN}") from error
    version = content.get("format_version") if isinstance(content, dict) else None
    if version != FORMAT_VERSION:
        raise BadIndex(
            f"{path} has format version {str(version)[:20]}; this Flaneur reads {FORMAT_VERSION}. "
            "Import the words again, from an index of that format."
        )
    try:
        return WordSet.model_validate(content)
    except ValidationError as error:
        where, what = first_fault(error)
        raise BadIndex(f"{path}: {where}: {what}. {AGAIN}") from error


def _own(root: Path, generation: Generation) -> WordSet:
    channels = generation.config.features.channels()
    paths = [
        path
        for channel in channels
        for path in codebook_paths(root, generation.codebooks, channel).values()
    ]
    try:
        files = {path.name: generation.files[path.relative_to(root).as_posix()] for path in paths}
        return WordSet(
            config=generation.config,
            digest=generation.codebooks_digest,
            origin=Origin(
                index=str(root),
                generation=generation.number,
                created_at=generation.created_at,
                surveys=tuple(survey.name or survey.path for survey in generation.surveys),
            ),
            quantisation=generation.segments[0].quantisation if generation.segments else {},
            files=files,
        )
    except KeyError as error:
        raise BadIndex(
            f"Generation {generation.number} of {root} names no file {error}. Restore it or index "
            "again."
        ) from error
    except ValidationError as error:
        where, what = first_fault(error)
        raise BadIndex(
            f"The words of generation {generation.number} of {root} do not hold: {where} {what}. "
            "Restore it or index again."
        ) from error
