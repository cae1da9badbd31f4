"""Removing: images are no longer found; what is left is counted anew, word by word.

Nothing is rewritten: a tombstone beside each segment says which of its images are gone, and how
many images of each word are left. `flaneur compact` then makes segments without them.
"""

import difflib
import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from contracts.config import Where
from contracts.errors import BadConfig
from contracts.progress import Progress
from coordinator.committing import file_entries, now
from index.codebooks import count_words
from index.commits import Writer, writing
from index.manifest import FileEntry, Generation, read_generation
from index.opened import OpenedIndex
from index.segments import map_segment, segment_paths
from index.selecting import selected
from index.tombstones import count_left, tombstones_folder, write_tombstones
from retrieval.packing import Part

COMPARED = 20_000
"""Uris among which one like a wrong one is sought: a second or two."""


@dataclass(frozen=True, slots=True)
class Removal:
    """What a removal did, or would do. uris : of the images, in the order of their ids.

    n_live : images that are left. generation : None: nothing was written.
    """

    uris: tuple[str, ...]
    n_live: int
    generation: Generation | None


def foresee_removal(
    root: Path, where: Where, uris: Sequence[str], image_ids: Sequence[int]
) -> Removal:
    """What `remove_images` would remove.

    Raises
    ------
    BadConfig, BadIndex : as `remove_images`.
    """
    index = OpenedIndex(root)
    return _removal(index, images_meant(index, where, uris, image_ids), None)


def remove_images(
    root: Path, where: Where, uris: Sequence[str], image_ids: Sequence[int], progress: Progress
) -> Removal:
    """Remove the images for which all that is given holds, and commit.

    Parameters
    ----------
    where : conditions. uris, image_ids : these alone, of live images; empty: of all.

    Raises
    ------
    BadConfig : nothing is given, an image named is not there, or no image would be left.
    BadIndex : not an index, damaged, or held by another writer.
    """
    read_generation(root)  # or a lock would be made in what is no index
    with writing(root) as writer:
        index = OpenedIndex(root)
        meant = images_meant(index, where, uris, image_ids)
        generation = _without(writer, index, meant, progress) if meant.any() else None
        if generation is not None:
            writer.commit(generation)
    return _removal(index, meant, generation)


def images_meant(
    index: OpenedIndex, where: Where, uris: Sequence[str], image_ids: Sequence[int]
) -> NDArray[np.bool_]:
    """Which live images are to be removed; (n_images,) bool.

    Raises
    ------
    BadConfig : nothing is given, an image named is not there, or no image would be left.
    """
    if where == Where() and not uris and not image_ids:
        raise BadConfig(
            "Say which images are to be removed: their uris, or conditions such as --glob, "
            "--survey, --since or --within."
        )
    meant = selected(index, where)
    if uris or image_ids:
        named = np.zeros(index.n_images, dtype=np.bool_)
        named[_ids_of_uris(index, uris)] = True
        named[_live(index, image_ids)] = True
        meant = meant & named
    if meant.sum() == index.n_live:
        raise BadConfig(
            f"That is every one of the {index.n_live} images of {index.root}, and none would be "
            "left to search. Delete the folder if that is meant."
        )
    return meant


def _removal(
    index: OpenedIndex, meant: NDArray[np.bool_], generation: Generation | None
) -> Removal:
    uris = index.catalogue.column("uri") if meant.any() else []
    gone = tuple(uris[number] for number in np.flatnonzero(meant).tolist())
    return Removal(gone, index.n_live - len(gone), generation)


def _without(
    writer: Writer, index: OpenedIndex, meant: NDArray[np.bool_], progress: Progress
) -> Generation:
    live, number = index.generation, writer.next_number()
    files = dict(live.files)
    segments = list(live.segments)
    touched = [
        (position, segment, meant[ids])
        for position, (segment, ids) in enumerate(live.placed)
        if meant[ids].any()
    ]
    progress.begin("remove", len(touched), 0)
    for position, segment, here in touched:
        former = f"tombstones/{segment.tombstones}/{segment.name}/"
        files = {name: entry for name, entry in files.items() if not name.startswith(former)}
        removed = index.removed_of(segment) | here
        files.update(_bury(index, position, f"{number:06d}", removed))
        segments[position] = segment.model_copy(
            update={"n_removed": int(removed.sum()), "tombstones": f"{number:06d}"}
        )
        progress.advance("remove")
    return live.model_copy(
        update={
            "number": number,
            "made_by": "remove",
            "created_at": now(),
            "segments": tuple(segments),
            "files": files,
        }
    )


def _bury(
    index: OpenedIndex, position: int, name: str, removed: NDArray[np.bool_]
) -> dict[str, FileEntry]:
    """Write the tombstones of a segment; returns their files."""
    segment = index.generation.segments[position]
    left = {}
    for channel in index.config.features.channels():
        paths = segment_paths(index.root, segment.name, channel)
        n_words = count_words(index.root, index.generation.codebooks, channel)
        packed = map_segment(paths, n_words, segment.n_images)
        left[channel] = count_left(Part(packed, 0, segment.n_images), removed)
    written = write_tombstones(tombstones_folder(index.root, name, segment.name), removed, left)
    return file_entries(
        index.root, {path.relative_to(index.root).as_posix(): sha for path, sha in written.items()}
    )


def _ids_of_uris(index: OpenedIndex, uris: Sequence[str]) -> list[int]:
    if not uris:
        return []
    ids = index.ids_by_uri()
    for uri in uris:
        if uri not in ids:
            near = difflib.get_close_matches(uri, itertools.islice(ids, COMPARED), n=1)
            hint = f" Is {near[0]!r} meant?" if near else ""
            raise BadConfig(f"{index.root} has no image {uri!r}.{hint}")
    return [ids[uri] for uri in uris]


def _live(index: OpenedIndex, image_ids: Sequence[int]) -> list[int]:
    for number in image_ids:
        if not 0 <= number < index.n_images:
            raise BadConfig(
                f"{index.root} has no image {number}; ids run from 0 to {index.n_images - 1}."
            )
        if index.kept is not None and not index.kept[number]:
            raise BadConfig(f"The image {number} of {index.root} has been removed already.")
    return list(image_ids)
