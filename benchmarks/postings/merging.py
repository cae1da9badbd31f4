"""How fast partial indices become a piece of a segment."""

import time
import tracemalloc
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from benchmarks.fusion.simulated import SimulatedChannel
from benchmarks.postings.made import runs_of
from benchmarks.table import print_table
from index.files import map_array
from index.segments import write_piece
from retrieval.merging import merge_keys, word_ranges
from retrieval.packing import pack

_ROUNDS = 3


def print_merging(folder: Path, partials: Sequence[Path], channel: SimulatedChannel) -> None:
    """Merge a range of words: in memory, to a file, and by sorting."""
    n_postings = sum(len(map_array(path, np.uint64, 1)) for path in partials)
    ranges = word_ranges(channel.n_words, n_postings)
    first, stop = ranges[len(ranges) // 2]  # the simulated words are in order of frequency

    def merged() -> object:
        return pack(merge_keys(runs_of(partials, first, stop), first, stop - first))

    def written() -> object:
        lists = merge_keys(runs_of(partials, first, stop), first, stop - first)
        return write_piece(folder / "piece.npz", lists, channel.n_images)

    def shuffled() -> object:
        return pack(merge_keys(runs_of(partials[::-1], first, stop), first, stop - first))

    def sorted_once() -> object:
        return np.sort(np.concatenate(runs_of(partials, first, stop)))

    ways = {
        "merged and packed": merged,
        "and written with sha256 and fsync": written,
        "merged and packed, shards in reverse": shuffled,
        "np.sort of all keys, no more": sorted_once,
    }
    in_range = sum(map(len, runs_of(partials, first, stop)))
    print(
        f"Merging words {first} to {stop - 1} of {channel.n_words} from {len(partials)} partial "
        f"indices: {in_range / 1e6:.1f} M postings of {n_postings / 1e6:.1f} M\n"
    )
    rows = [(name, *_measured(work, in_range)) for name, work in ways.items()]
    print_table(("", "M postings/s, CPU", "wall", "peak bytes a posting"), rows)
    print(flush=True)


def _measured(work: Callable[[], object], n_postings: int) -> tuple[str, str, str]:
    """The best round in CPU and in wall time, and the peak of what was allocated."""
    tracemalloc.start()
    work()  # compiles, too
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    rounds = []
    for _ in range(_ROUNDS):
        wall, cpu = time.perf_counter(), time.process_time()
        work()
        rounds.append((time.process_time() - cpu, time.perf_counter() - wall))
    cpu_s, wall_s = np.min(rounds, axis=0)
    return (
        f"{n_postings / cpu_s / 1e6:.0f}",
        f"{n_postings / wall_s / 1e6:.0f}",
        f"{peak / n_postings:.1f}",
    )
