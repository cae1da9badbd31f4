"""Words trained elsewhere for a new index: what they are made for decides what it can be."""

from collections.abc import Mapping, Sequence

from contracts.config import FeatureConfig, IndexConfig
from contracts.errors import BadConfig
from index.codebooks import Words
from index.commits import working
from index.importing import import_words
from index.jobs import JobFolder
from index.word_sets import WordSet, WordSource
from retrieval.codebooks import outgrown

_OTHERWISE = "Choose from these, or index without --codebooks to train words."


def config_of_words(
    words: WordSet,
    detectors: Sequence[str],
    descriptors: Sequence[str],
    limits: Mapping[str, object],
) -> IndexConfig:
    """The configuration of an index that uses `words`.

    Parameters
    ----------
    detectors, descriptors : asked for; none: all that the words are for.
    limits : settings of `FeatureConfig` on the number of frames that were asked for.

    Raises
    ------
    BadConfig : the words are for other detectors, descriptors or numbers of frames; names them.
    """
    made = words.config.features
    for option, asked, has in (
        ("--detectors", detectors, made.detectors),
        ("--descriptors", descriptors, made.descriptors),
    ):
        missing = [name for name in asked if name not in has]
        if missing:
            raise BadConfig(
                f"{option}: the words of --codebooks are not for {', '.join(missing)}; they are "
                f"for {', '.join(has)}. {_OTHERWISE}"
            )
    chosen = {
        "detectors": tuple(detectors or made.detectors),
        "descriptors": tuple(descriptors or made.descriptors),
    }
    here = {name: n for name, n in made.max_frames_of.items() if name in chosen["detectors"]}
    features = FeatureConfig.of(**{**made.model_dump(), **chosen, "max_frames_of": here})
    if limits:
        _refuse_other_frames(features, FeatureConfig.of(**chosen, **limits))
    return IndexConfig(features=features, codebooks=words.config.codebooks)


def take_over(job: JobFolder, source: WordSource, words: Words) -> None:
    """Copy the words of a planned job into its index; run again, only what is missing.

    Raises
    ------
    BadIndex : a file of `source` is not what it was.
    """
    with working(job):  # or pruning would take them for leftovers
        import_words(job.root, source, words)


def misfit(
    there: Mapping[str, float],
    here: Mapping[str, float],
    mend: str,
    points_per_word: Mapping[str, float] | None = None,
) -> str | None:
    """A warning where words fit other images clearly worse than those that they were made of.

    Parameters
    ----------
    there, here : by channel, the mean squared distance to their words of the descriptors of the
        images that words were made of, and of the others. points_per_word : as `outgrown`.
    mend : how to have words that fit.
    """
    told = [
        f"{name} ({here[name] / there[name]:.1f} times)"
        for name in outgrown(there, here, points_per_word)
    ]
    if not told:
        return None
    return (
        "The words do not fit the new images well: the mean squared distance of their descriptors "
        f"to words is larger than it was, in {', '.join(told)}. They can be found all the same, "
        f"but less surely; {mend}."
    )


def _refuse_other_frames(made: FeatureConfig, asked: FeatureConfig) -> None:
    for detector in made.detectors:
        if asked.frames_of(detector) != made.frames_of(detector):
            raise BadConfig(
                f"--max-frames: the words of --codebooks are for {made.frames_of(detector)} frames "
                f"of {detector} an image, not {asked.frames_of(detector)}. Leave --max-frames "
                "away, or index without --codebooks to train words."
            )
