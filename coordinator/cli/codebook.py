"""`flaneur codebook`: words trained for one survey, taken along to another."""

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from coordinator.cli.outputs import utf_8
from coordinator.cli.show import tell
from coordinator.cli.tables import print_line, print_table

if TYPE_CHECKING:  # faiss is imported when a verb runs
    from index.word_sets import WordSet, WordSource

NAME = "codebook"
HELP = "Words trained for one survey, taken along to another (flaneur index --codebooks)."

Source = Annotated[
    Path, typer.Argument(help="An index (its live generation), or a folder of imported words.")
]


def import_(
    source: Source,
    out: Annotated[Path, typer.Argument(metavar="OUT", help="A new folder.")],
) -> None:
    """Copy words into a folder of their own, comparing every file with its digest."""
    from index.importing import import_folder
    from index.word_sets import open_words

    found = open_words(source.absolute())
    import_folder(found, out.absolute())
    channels = found.words.config.features.channels()
    tell(f"{out}: words {found.words.digest} of {len(channels)} channels")


def show(
    path: Source,
    as_json: Annotated[bool, typer.Option("--json", help="As JSON on stdout.")] = False,
) -> None:
    """What words there are, for which features, and where they are from."""
    from index.word_sets import open_words

    found = open_words(path.absolute())
    words, channels = found.words, _channels(found)
    if as_json:
        typer.echo(utf_8(json.dumps(_report(words, channels), ensure_ascii=False)))
        return
    origin = words.origin
    print_line(f"words {words.digest}")
    print_line(f"from {origin.index}, generation {origin.generation} of {origin.created_at}")
    print_line(f"made of {', '.join(origin.surveys)}")
    print_line("")
    rows = [
        (each.channel, f"{each.words:,}", str(each.dimensions), f"{each.frames:,}")
        for each in channels
    ]
    print_table(("channel", "words", "dimensions", "frames an image"), rows)


@dataclass(frozen=True, slots=True)
class _Channel:
    """frames : of an image, at most. quantisation : None: not known."""

    channel: str
    words: int
    dimensions: int
    frames: int
    quantisation: float | None


def _channels(found: "WordSource") -> list[_Channel]:
    features = found.words.config.features
    frames = [features.frames_of(name) for name in features.detectors for _ in features.descriptors]
    return [
        _Channel(name, *found.size_of(name), n_frames, found.words.quantisation.get(name))
        for name, n_frames in zip(features.channels(), frames, strict=True)
    ]


def _report(words: "WordSet", channels: list[_Channel]) -> dict[str, object]:
    return {
        "digest": words.digest,
        "config_digest": words.config.digest(),
        "config": words.config.model_dump(mode="json"),
        "origin": words.origin.model_dump(mode="json"),
        "channels": [asdict(channel) for channel in channels],
    }


COMMANDS: dict[str, Callable[..., int | None]] = {"import": import_, "show": show}
