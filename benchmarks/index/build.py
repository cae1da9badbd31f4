"""Building the index of a simulated survey by the engine's own steps, timed one by one."""

import shutil
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.fusion.measured import PAIR
from benchmarks.fusion.simulated import SimulatedChannel
from benchmarks.index.fresh_process import in_fresh_process
from benchmarks.index.survey import Survey
from contracts.config import CodebookConfig, FeatureConfig, IndexConfig
from contracts.records import PosedImage
from index.catalogue import catalogue_row, write_catalogue
from index.codebooks import codebook_paths, codebooks_digest
from index.commits import writing
from index.files import map_array, write_array
from index.manifest import FileEntry, Generation, SegmentEntry
from index.segments import join_pieces, segment_paths, write_piece
from retrieval.merging import keys_of_words, merge_keys, word_ranges

_NAME = "0001"


@dataclass(frozen=True, slots=True)
class Built:
    """What building took. n_bytes : of the inverted indices.

    merge_mb, join_mb : most memory of the process that merges, and of the one that joins.
    """

    n_postings: int
    n_bytes: int
    merge_s: float
    merge_cpu_s: float
    merge_mb: float
    join_s: float
    join_mb: float
    commit_s: float

    @property
    def seconds(self) -> float:
        """From the partials of all shards to the generation committed."""
        return self.merge_s + self.join_s + self.commit_s


def build(root: Path, survey: Survey) -> Built:
    """Write and merge one channel after the other, as partials of all would fill a disk."""
    digests: dict[str, str] = {}
    n_postings, merges, joins = 0, [], []
    for name, channel in survey.channels.items():
        scratch = root / "jobs" / name
        made = in_fresh_process(_write_partials, scratch, channel)
        merged = in_fresh_process(_merge, scratch, channel, made.result)
        joined = in_fresh_process(_join, root, name, channel)
        shutil.rmtree(scratch)
        digests.update(joined.result)
        n_postings += made.result
        merges.append(merged)
        joins.append(joined)
    committed = in_fresh_process(_commit, root, survey, digests, n_postings)
    return Built(
        n_postings=n_postings,
        n_bytes=sum((root / name).stat().st_size for name in digests),
        merge_s=sum(merged.seconds for merged in merges),
        merge_cpu_s=sum(merged.cpu_s for merged in merges),
        merge_mb=max(merged.peak_mb for merged in merges),
        join_s=sum(joined.seconds for joined in joins),
        join_mb=max(joined.peak_mb for joined in joins),
        commit_s=committed.seconds,
    )


def _write_partials(scratch: Path, channel: SimulatedChannel) -> int:
    """A copy of the streets is a shard. Gives the number of postings."""
    scratch.mkdir(parents=True)
    n_postings = 0
    for copy in range(channel.n_copies):
        keys = channel.keys(copy)
        np.save(scratch / f"{copy:06d}.npy", keys, allow_pickle=False)
        n_postings += len(keys)
    return n_postings


def _merge(scratch: Path, channel: SimulatedChannel, n_postings: int) -> None:
    """The work of all of a channel's merge tasks, as workers/stages/merge.py does it."""
    for first, stop in word_ranges(channel.n_words, n_postings):
        runs = []
        for copy in range(channel.n_copies):
            keys = map_array(scratch / f"{copy:06d}.npy", np.uint64, 1)
            runs.append(keys_of_words(keys.astype(np.uint64, copy=False), first, stop).copy())
        merged = merge_keys(runs, first, stop - first)
        write_piece(scratch / f"{first:07d}.npz", merged, channel.n_images)


def _join(root: Path, name: str, channel: SimulatedChannel) -> dict[str, str]:
    pieces = sorted((root / "jobs" / name).glob("*.npz"))
    paths = segment_paths(root, _NAME, name)
    written, _ = join_pieces(paths, pieces, channel.n_words, channel.n_images)
    return {path.relative_to(root).as_posix(): digest for path, digest in written.items()}


def _commit(root: Path, survey: Survey, digests: dict[str, str], n_postings: int) -> None:
    """Write the catalogue and codebooks that nobody searches, and make it all live."""
    catalogue = root / "catalogue" / f"{_NAME}.parquet"
    rows = [
        catalogue_row(
            image_id, "", PosedImage(f"{image_id:07d}.jpg", ""), f"{image_id:064x}", 1024, 1024
        )
        for image_id in range(survey.n_images)
    ]
    files = {**digests, f"catalogue/{_NAME}.parquet": write_catalogue(catalogue, rows, None)}
    words = {}
    for name in survey.channels:
        path = codebook_paths(root, _NAME, name)["words"]
        words[name] = write_array(path, np.zeros((survey.n_words, 1), dtype=np.uint8))
        files[path.relative_to(root).as_posix()] = words[name]
    config = IndexConfig(
        features=FeatureConfig(detectors=PAIR), codebooks=CodebookConfig(max_words=survey.n_words)
    )
    segment = SegmentEntry(
        name=_NAME,
        jobs=(),
        n_images=survey.n_images,
        n_postings=n_postings,
        n_skipped=0,
        surveys=(),
        quantisation={},
    )
    with writing(root) as writer:
        writer.commit(
            Generation(
                number=writer.next_number(),
                made_by="index",
                created_at="2026-01-01T00:00:00+00:00",
                config=config,
                config_digest=config.digest(),
                crs=None,
                codebooks=_NAME,
                codebooks_digest=codebooks_digest(words),
                segments=(segment,),
                files={
                    name: FileEntry(sha256=digest, size=(root / name).stat().st_size)
                    for name, digest in files.items()
                },
            )
        )
