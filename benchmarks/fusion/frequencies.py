"""How often words are used, by images and by photos."""

from collections.abc import Mapping

from benchmarks.fusion.word_use import WordUse
from benchmarks.table import print_table

_SHARES = (0.001, 0.01, 0.05, 0.1, 0.25, 0.5, 1.0)


def print_frequencies(channels: Mapping[str, WordUse]) -> None:
    """Print rank frequency and document frequency of every channel."""
    header = ("most frequent words", *channels)
    print("Share of the photos' words (rank frequency)\n")
    rows = [
        (
            f"{share:.1%}",
            *(
                f"{(use.words < share * len(use.frequency)).mean():.3f}"
                for use in channels.values()
            ),
        )
        for share in _SHARES
    ]
    print_table(header, rows)
    print("\nImages that have the last of them, as a multiple of the mean (document frequency)\n")
    rows = [
        (
            f"{share:.1%}",
            *(
                f"{use.relative_frequency()[int(share * (len(use.frequency) - 1))]:.2f}"
                for use in channels.values()
            ),
        )
        for share in _SHARES
    ]
    print_table(header, rows)
    print()
    print_table(
        ("channel", "words", "an image", "images a word", "images a photo's word"),
        [
            (
                name,
                len(use.frequency),
                f"{use.words_per_image:.0f}",
                f"{use.frequency.mean():.1f}",
                f"{use.frequency[use.words].mean():.1f}",
            )
            for name, use in channels.items()
        ],
    )
