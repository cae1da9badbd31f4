"""Which surveys are simulated."""

from collections.abc import Mapping
from dataclasses import dataclass

from benchmarks.fusion.simulated import SimulatedChannel
from benchmarks.fusion.word_use import WordUse
from contracts.config import CodebookConfig, FeatureConfig
from retrieval.codebooks import n_words_for


@dataclass(frozen=True, slots=True)
class Scale:
    """A survey's images, and the `max_words` that someone would index so many with.

    measured_words : size of the codebooks of which the use of words was measured.
    has_peer : a bag of words in memory is built beside it.
    """

    n_images: int
    max_words: int
    measured_words: int
    has_peer: bool

    @property
    def n_words(self) -> int:
        """Words of each channel, if every image has all its frames."""
        n_points = self.n_images * FeatureConfig().max_frames
        return n_words_for(n_points, CodebookConfig(max_words=self.max_words))


SCALES = (
    Scale(10_000, 20_000, 20_000, True),
    Scale(100_000, 100_000, 100_000, True),
    Scale(1_000_000, 1_000_000, 100_000, False),
)


@dataclass(frozen=True, slots=True)
class Survey:
    """A simulated survey: its size and its channels."""

    n_images: int
    n_words: int
    channels: Mapping[str, SimulatedChannel]

    @property
    def n_copies(self) -> int:
        return next(iter(self.channels.values())).n_copies

    @property
    def n_photos(self) -> int:
        return next(iter(self.channels.values())).use.n_photos


def simulated(scale: Scale, measured: Mapping[str, WordUse]) -> Survey:
    """Make a survey of this scale from what was measured."""
    return Survey(
        scale.n_images,
        scale.n_words,
        {
            name: SimulatedChannel(use, scale.n_images, scale.n_words, seed)
            for seed, (name, use) in enumerate(measured.items())
        },
    )
