"""A whole small index, written by the engine's own functions in milliseconds."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from contracts.config import DESCRIPTOR_SIZES, CodebookConfig, FeatureConfig, IndexConfig
from contracts.records import PosedImage
from index.catalogue import catalogue_row, write_catalogue
from index.codebooks import codebook_paths, codebooks_digest, write_codebook
from index.commits import writing
from index.files import sha256_of
from index.manifest import FileEntry, Generation, SegmentEntry, SurveyEntry
from index.segments import join_pieces, map_segment, segment_paths, write_piece
from index.tombstones import count_left, tombstones_folder, write_tombstones
from retrieval.codebooks import train_codebook
from retrieval.merging import merge_keys, posting_keys
from retrieval.packing import Part

FEATURES = FeatureConfig(detectors=("hesaff",), descriptors=("sift", "sc"), max_frames=50)
N_WORDS = 20


def made_index(
    root: Path, sizes: tuple[int, ...] = (6, 4), removed: tuple[int, ...] = (), seed: int = 0
) -> Generation:
    """Commit an index of segments of `sizes` images of random words.

    removed : of the first segment. seed : of the words and of who has which.
    """
    config = IndexConfig(features=FEATURES, codebooks=CodebookConfig(max_words=N_WORDS, seed=seed))
    rng = np.random.default_rng(seed)
    written: dict[Path, str] = {}
    words = {}
    for channel in FEATURES.channels():
        size = next(n for name, n in DESCRIPTOR_SIZES.items() if channel.endswith(f"-{name}"))
        sample = rng.integers(0, 256, (200, size), dtype=np.uint8)
        paths = codebook_paths(root, "0001", channel)
        written |= write_codebook(paths, train_codebook(sample, N_WORDS, seed))
        words[channel] = written[paths["words"]]
    entries = [
        _segment(root, f"{number:04d}", n_images, rng, written)
        for number, n_images in enumerate(sizes, start=1)
    ]
    if removed:
        entries[0] = _without(root, entries[0], removed, written)
    with writing(root) as writer:
        generation = Generation(
            number=writer.next_number(),
            made_by="index",
            created_at="2026-01-01T00:00:00+00:00",
            config=config,
            config_digest=config.digest(),
            crs=None,
            codebooks="0001",
            codebooks_digest=codebooks_digest(words),
            segments=tuple(entries),
            files=entries_of(root, written),
        )
        writer.commit(generation)
    return generation


def entries_of(root: Path, written: dict[Path, str]) -> dict[str, FileEntry]:
    """The files as a generation names them."""
    return {
        path.relative_to(root).as_posix(): FileEntry(sha256=sha256, size=path.stat().st_size)
        for path, sha256 in written.items()
    }


def named_anew(root: Path, generation: Generation, **changes: object) -> Generation:
    """Commit a generation like `generation` whose digests are those of the files as they are."""
    files = {root / name: sha256_of(root / name) for name in generation.files}
    with writing(root) as writer:
        update = {"number": writer.next_number(), "files": entries_of(root, files), **changes}
        later = generation.model_copy(update=update)
        writer.commit(later)
    return later


def _segment(
    root: Path, name: str, n_images: int, rng: np.random.Generator, written: dict[Path, str]
) -> SegmentEntry:
    n_postings = 0
    for channel in FEATURES.channels():
        image_ids = rng.integers(0, n_images, 12 * n_images).astype(np.uint32)
        word_ids = rng.integers(0, N_WORDS, len(image_ids)).astype(np.int32)
        lists = merge_keys([posting_keys(word_ids, image_ids, N_WORDS)], 0, N_WORDS)
        piece = root / "piece.npz"
        write_piece(piece, lists, n_images)
        files, n = join_pieces(segment_paths(root, name, channel), [piece], N_WORDS, n_images)
        piece.unlink()
        written |= files
        n_postings += n
    catalogue = root / "catalogue" / f"{name}.parquet"
    rows = [
        catalogue_row(row, "", PosedImage(f"{name}/{row:03d}.jpg", "/nowhere.jpg"), "0" * 64, 9, 9)
        for row in range(n_images)
    ]
    written[catalogue] = write_catalogue(catalogue, rows, None)
    survey = SurveyEntry(name="", path="/surveys/rue Édouard", format="plain", n_images=n_images)
    return SegmentEntry(
        name=name,
        jobs=(f"{int(name):016x}",),
        n_images=n_images,
        n_postings=n_postings,
        n_skipped=0,
        surveys=(survey,),
        quantisation=dict.fromkeys(FEATURES.channels(), 100.0),
    )


def _without(
    root: Path, entry: SegmentEntry, removed: tuple[int, ...], written: dict[Path, str]
) -> SegmentEntry:
    gone: NDArray[np.bool_] = np.isin(np.arange(entry.n_images), removed)
    left = {}
    for channel in FEATURES.channels():
        paths = segment_paths(root, entry.name, channel)
        part = Part(map_segment(paths, N_WORDS, entry.n_images), 0, entry.n_images)
        left[channel] = count_left(part, gone)
    written |= write_tombstones(tombstones_folder(root, "000001", entry.name), gone, left)
    return entry.model_copy(update={"n_removed": int(gone.sum()), "tombstones": "000001"})
