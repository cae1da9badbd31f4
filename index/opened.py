"""An index opened for searching: everything mapped, nothing loaded before it is asked for."""

from collections.abc import Sequence
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pyproj.transformer import AreaOfInterest

from contracts.config import IndexConfig
from contracts.errors import BadConfig, BadIndex
from contracts.records import Postings
from geo.crs import ToWgs84
from index.catalogue import Catalogue
from index.codebooks import codebook_paths, read_searcher
from index.files import map_array
from index.manifest import Generation, live_generation
from index.segments import map_postings, segment_paths
from retrieval.codebooks import WordSearcher
from retrieval.postings import document_frequency, inverse_document_frequency


class OpenedIndex:
    """One generation of an index; later commits do not touch what it reads.

    Raises
    ------
    BadIndex : not an index, a later format, or files missing or of another size than written.
    """

    def __init__(self, root: Path) -> None:
        self.root = root
        self.generation: Generation = live_generation(root)
        for name, entry in self.generation.files.items():
            path = root / name
            if not path.is_file() or path.stat().st_size != entry.size:
                raise BadIndex(
                    f"{path} is missing or not {entry.size} bytes long. Restore it or index again."
                )
        self._searchers: dict[str, WordSearcher] = {}
        self._postings: dict[str, Postings] = {}
        self._idf: dict[str, NDArray[np.float64]] = {}

    @property
    def config(self) -> IndexConfig:
        return self.generation.config

    @property
    def n_images(self) -> int:
        return self.generation.n_images

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
        return Catalogue(self.root / "catalogue" / f"{self.generation.segment}.parquet")

    @cached_property
    def images_by_sha256(self) -> dict[str, tuple[int, ...]]:
        """Ids of the images whose file has this digest, ascending."""
        found: dict[str, tuple[int, ...]] = {}
        for image_id, sha256 in enumerate(self.catalogue.column("sha256")):
            found[sha256] = (*found.get(sha256, ()), image_id)
        return found

    def searcher(self, channel: str) -> WordSearcher:
        """The nearest-word search of a channel."""
        if channel not in self._searchers:
            self._check(channel)
            paths = codebook_paths(self.root, self.generation.segment, channel)
            name = paths["search"].relative_to(self.root).as_posix()
            self._searchers[channel] = read_searcher(paths, self.generation.files[name].sha256)
        return self._searchers[channel]

    def postings(self, channel: str) -> Postings:
        """The inverted index of a channel, memory-mapped."""
        if channel not in self._postings:
            self._check(channel)
            indptr, ids, _ = segment_paths(self.root, self.generation.segment, channel)
            self._postings[channel] = map_postings(indptr, ids)
        return self._postings[channel]

    def idf(self, channel: str) -> NDArray[np.float64]:
        """ln(N / df) of each word, 0 for a word in no image; (V,)."""
        if channel not in self._idf:
            frequency = document_frequency(self.postings(channel))
            self._idf[channel] = inverse_document_frequency(frequency, self.n_images)
        return self._idf[channel]

    def distinct_words(self, channels: Sequence[str]) -> NDArray[np.int64]:
        """Distinct words of each image summed over `channels`; (n_images,)."""
        total = np.zeros(self.n_images, dtype=np.int64)
        for channel in channels:
            self._check(channel)
            path = segment_paths(self.root, self.generation.segment, channel)[2]
            total += map_array(path, np.uint32, 1).astype(np.int64)
        return total

    def density(self, channels: Sequence[str]) -> float:
        """Mean share of the images that a word of these channels is in."""
        shares = []
        for channel in channels:
            postings = self.postings(channel)
            shares.append(len(postings.image_ids) / max(postings.n_words * self.n_images, 1))
        return sum(shares) / len(shares)

    def bytes_on_disk(self) -> int:
        return sum(entry.size for entry in self.generation.files.values())

    def _check(self, channel: str) -> None:
        channels = self.config.features.channels()
        if channel not in channels:
            raise BadConfig(
                f"{self.root} has no channel {channel!r}; it was indexed with "
                f"{', '.join(channels)}. Choose from these or index again."
            )
