"""An index opened for searching: everything mapped, nothing loaded before it is asked for."""

from collections.abc import Sequence
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pyproj.transformer import AreaOfInterest

from contracts.config import IndexConfig
from contracts.errors import BadConfig, BadIndex
from contracts.places import Place
from contracts.progress import Progress
from contracts.records import Postings
from geo.crs import ToWgs84
from index.catalogue import Catalogue
from index.codebooks import codebook_paths, count_words, read_searcher
from index.fetched import at_hand
from index.files import check_files, map_array
from index.manifest import Generation, SegmentEntry, generation_path, read_generation
from index.segments import map_segment, segment_paths
from index.tombstones import map_counts, map_removed, tombstones_folder
from retrieval.codebooks import WordSearcher
from retrieval.packing import Part, unpack
from retrieval.postings import inverse_document_frequency


class OpenedIndex:
    """One generation of an index, None: the live one; later commits do not touch what it reads.

    place : its folder, or the URL that it was published to, from where it is fetched first.

    Raises
    ------
    BadIndex : not an index, a later format, or files missing or of another size than written.
    """

    def __init__(
        self, place: Place, number: int | None = None, progress: Progress | None = None
    ) -> None:
        self.place = str(place.absolute())
        """Where any machine finds it."""
        self._held = at_hand(place, number, progress)
        self.root = root = self._held.root
        self.generation: Generation = read_generation(root, number)
        check_files(root, self.generation.sizes)
        self._check_numbers()
        self._searchers: dict[str, WordSearcher] = {}
        self._parts: dict[str, tuple[Part, ...]] = {}
        self._density: dict[str, float] = {}

    @property
    def config(self) -> IndexConfig:
        return self.generation.config

    @property
    def n_images(self) -> int:
        """Ids given: `kept` says which of them can be found."""
        return self.generation.n_images

    @property
    def n_live(self) -> int:
        return self.generation.n_live

    @cached_property
    def kept(self) -> NDArray[np.bool_] | None:
        """(n_images,) bool, False where an image was removed; None: none was."""
        if self.n_live == self.n_images:
            return None
        return np.concatenate([~self.removed_of(segment) for segment in self.generation.segments])

    @property
    def live_ids(self) -> NDArray[np.int64]:
        """The images that can be found, ascending; (n_live,) int64."""
        return np.arange(self.n_images) if self.kept is None else np.flatnonzero(self.kept)

    def ids_by_uri(self) -> dict[str, int]:
        """The id of every uri that can be found, in the order of the ids."""
        uris = self.catalogue.column("uri")
        return {uris[image_id]: image_id for image_id in self.live_ids.tolist()}

    def removed_of(self, segment: SegmentEntry) -> NDArray[np.bool_]:
        """Which images of a segment are removed; (its n_images,) bool."""
        if segment.tombstones is None:
            return np.zeros(segment.n_images, dtype=np.bool_)
        folder = tombstones_folder(self.root, segment.tombstones, segment.name)
        return map_removed(folder, segment.n_images)

    @cached_property
    def to_wgs84(self) -> ToWgs84 | None:
        """How all its positions become WGS 84, by one operation; None where nothing has a pose."""
        generation = self.generation
        if generation.crs is None or generation.area is None:
            return None
        area = AreaOfInterest(*generation.area)
        return ToWgs84(generation.crs, area, generation.allow_ballpark)

    @cached_property
    def catalogue(self) -> Catalogue:
        segments = self.generation.segments
        return Catalogue(
            [self.root / "catalogue" / f"{segment.name}.parquet" for segment in segments],
            [segment.n_images for segment in segments],
        )

    def images_of_file(self, sha256: str) -> tuple[int, ...]:
        """Ids of the live images whose file has this digest, ascending."""
        found = self.catalogue.is_among("sha256", [sha256])
        if self.kept is not None:
            found &= self.kept
        return tuple(np.flatnonzero(found).tolist())

    def searcher(self, channel: str) -> WordSearcher:
        """The nearest-word search of a channel."""
        if channel not in self._searchers:
            self._check(channel)
            paths = codebook_paths(self.root, self.generation.codebooks, channel)
            name = paths["search"].relative_to(self.root).as_posix()
            self._searchers[channel] = read_searcher(paths, self.generation.file(name).sha256)
        return self._searchers[channel]

    def parts(self, channel: str) -> tuple[Part, ...]:
        """The inverted index of a channel, of each segment, memory-mapped."""
        if channel not in self._parts:
            self._check(channel)
            n_words = count_words(self.root, self.generation.codebooks, channel)
            self._parts[channel] = tuple(
                Part(
                    map_segment(
                        segment_paths(self.root, segment.name, channel),
                        n_words,
                        segment.n_images,
                        scattered=True,
                    ),
                    ids.start,
                    segment.n_images,
                )
                for segment, ids in self.generation.placed
            )
        return self._parts[channel]

    def lists(
        self, channel: str, word_ids: NDArray[np.int64], kept: NDArray[np.bool_] | None = None
    ) -> Postings:
        """The images of some words, in the order of the words, without removed ones.

        Parameters
        ----------
        word_ids : (m,) int64. kept : (n_images,) bool, who is a candidate; None: all live images.
        """
        return unpack(self.parts(channel), word_ids, self.kept if kept is None else kept)

    def document_frequency(
        self, channel: str, word_ids: NDArray[np.int64] | None = None
    ) -> NDArray[np.int64]:
        """Live images of some words of the codebook, (m,), or of all, (V,) int64."""
        parts = self.parts(channel)
        words = slice(None) if word_ids is None else word_ids
        frequency = np.zeros(parts[0].packed.n_words, dtype=np.int64)[words]
        for segment, part in zip(self.generation.segments, parts, strict=True):
            counts = part.packed.counts
            if segment.tombstones is not None:
                folder = tombstones_folder(self.root, segment.tombstones, segment.name)
                counts = map_counts(folder, channel, part.packed.n_words)
            frequency += counts[words]
        return frequency

    def idf(self, channel: str, word_ids: NDArray[np.int64] | None = None) -> NDArray[np.float64]:
        """ln(N / df) over live images, 0 for a word in no image; of some words, (m,), or (V,)."""
        return inverse_document_frequency(self.document_frequency(channel, word_ids), self.n_live)

    def distinct_words(self, channels: Sequence[str]) -> NDArray[np.int64]:
        """Distinct words of each image summed over `channels`; (n_images,)."""
        total = np.zeros(self.n_images, dtype=np.int64)
        for channel in channels:
            self.parts(channel)  # checks how many images its files are of
            for segment, ids in self.generation.placed:
                path = segment_paths(self.root, segment.name, channel).words_per_image
                total[ids] += map_array(path, np.uint32, 1)
        return total

    def density(self, channels: Sequence[str]) -> float:
        """Mean share of the live images that a word of these channels is in."""
        for channel in channels:
            if channel not in self._density:
                frequency = self.document_frequency(channel)
                n_pairs = max(len(frequency) * self.n_live, 1)
                self._density[channel] = int(frequency.sum()) / n_pairs
        return sum(self._density[channel] for channel in channels) / len(channels)

    def _check_numbers(self) -> None:
        """Numbers of images that no file bears out would be believed when memory is asked for."""
        if not self.generation.segments:
            path = generation_path(self.root, self.generation.number)
            raise BadIndex(f"{path} names no segments. Restore it or index again.")
        channel = self.config.features.channels()[0]
        for segment in self.generation.segments:
            path = segment_paths(Path(), segment.name, channel).words_per_image
            if self.generation.file(path.as_posix()).size < 4 * segment.n_images:
                raise BadIndex(
                    f"{self.root / path} is too short for the {segment.n_images} images of its "
                    "segment. Restore it or index again."
                )

    def _check(self, channel: str) -> None:
        channels = self.config.features.channels()
        if channel not in channels:
            raise BadConfig(
                f"{self.root} has no channel {channel!r}; it was indexed with "
                f"{', '.join(channels)}. Choose from these or index again."
            )
