"""Packed postings: bytes and speed of unpacking and of merging, beside other ways to keep them."""

import tempfile
from pathlib import Path

from benchmarks.fusion.measured import measure
from benchmarks.fusion.simulated import SimulatedChannel
from benchmarks.postings.made import real_index, simulated_index, write_partials
from benchmarks.postings.merging import print_merging
from benchmarks.postings.unpacking import print_unpacking

_CHANNEL = "hesaff-sift"
_MEASURED_WORDS = (20_000, 100_000)
_N_IMAGES = 100_000
_SIZES = ((20_000, 20_000), (100_000, 100_000), (1_000_000, 100_000))
"""Words of a simulated index, and of the real one whose use of words it has."""


def run(data: Path) -> None:
    """Pack the postings of real images, and of surveys of 100,000 that are simulated from them."""
    measured = measure(data, _MEASURED_WORDS)
    uses = {n: each[_CHANNEL] for n, each in zip(_MEASURED_WORDS, measured, strict=True)}
    print(f"Channel {_CHANNEL}, one core, CPU time, best of several rounds\n")
    print_unpacking([real_index(use) for use in uses.values()], with_peers=True)
    for n_words, n_measured in _SIZES:
        channel = SimulatedChannel(uses[n_measured], _N_IMAGES, n_words, seed=0)
        with tempfile.TemporaryDirectory() as scratch:
            partials = write_partials(Path(scratch), channel)
            index = simulated_index(channel, partials)
            print_unpacking([index], with_peers=n_words == _N_IMAGES)
            if n_words == _N_IMAGES:
                print_merging(Path(scratch), partials, channel)
