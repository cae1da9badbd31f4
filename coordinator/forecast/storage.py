"""What lies on disk while a job runs, and what stays."""

from collections.abc import Sequence
from dataclasses import dataclass

from coordinator.forecast.costs import (
    CATALOGUE_BYTES_AN_IMAGE,
    JOB_BYTES_AN_IMAGE,
    MODELLED_BYTES_WITHIN,
    POSTING_KEY_BYTES,
    search_structure_bytes,
)
from coordinator.forecast.postings_bytes import packed_bytes
from coordinator.forecast.ranges import Range, exactly, total
from coordinator.forecast.vocabulary import Channel

_BYTES_A_WORD = 12
"""Its place, int64, and its number of images, uint32: index/segments.py."""
_BYTES_AN_IMAGE = 4
"""Its number of words in a channel, uint32."""


@dataclass(frozen=True, slots=True)
class Storage:
    """Bytes on disk.

    words, searches, postings, tables, catalogue : of the finished index: visual words, their
    search structures, packed postings, their places and counts and the words of every image,
    and the catalogue. lists : what the job keeps in `jobs/`: images, receipts.
    features : of all images until they are assigned. partials : of all shards until merged.
    pieces : merged and not yet joined.
    """

    words: Range
    searches: Range
    postings: Range
    tables: Range
    catalogue: Range
    lists: Range
    features: Range
    partials: Range
    pieces: Range

    @property
    def codebooks(self) -> Range:
        return self.words + self.searches

    @property
    def index(self) -> Range:
        """The finished index, without what the job keeps."""
        return total((self.codebooks, self.postings, self.tables, self.catalogue))

    @property
    def scratch(self) -> Range:
        """Beside the codebooks, at the worst moment: all features, or all partials and pieces."""
        merging = self.partials + self.pieces + self.postings + self.tables
        return self.features if self.features.likely > merging.likely else merging

    @property
    def at_most(self) -> Range:
        """What the index folder must have room for."""
        return total((self.codebooks, self.scratch, self.lists, self.catalogue))


def foresee_storage(channels: Sequence[Channel], n_images: int) -> Storage:
    """Bytes of an index of `n_images` images with these channels."""
    postings = total(_packed(channel, n_images) for channel in channels)
    tables = sum(
        _BYTES_A_WORD * channel.n_words + _BYTES_AN_IMAGE * n_images for channel in channels
    )
    searches = sum(
        search_structure_bytes(channel.n_words, channel.dimensions) for channel in channels
    )
    return Storage(
        words=exactly(sum(channel.n_words * channel.dimensions for channel in channels)),
        searches=exactly(searches),
        postings=postings,
        tables=exactly(tables),
        catalogue=exactly(CATALOGUE_BYTES_AN_IMAGE * n_images).within(MODELLED_BYTES_WITHIN),
        lists=exactly(JOB_BYTES_AN_IMAGE * n_images).within(MODELLED_BYTES_WITHIN),
        features=total(channel.points.times(channel.dimensions) for channel in channels),
        partials=total(channel.postings.times(POSTING_KEY_BYTES) for channel in channels),
        pieces=postings + exactly(tables),
    )


def _packed(channel: Channel, n_images: int) -> Range:
    likely = channel.postings.likely
    if not likely:
        return exactly(0.0)
    bytes_a_posting = packed_bytes(likely, channel.n_words, n_images) / likely
    return channel.postings.times(bytes_a_posting).within(MODELLED_BYTES_WITHIN)
