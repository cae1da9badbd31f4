"""A few images of a survey, extracted here and now as a worker would."""

import hashlib
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import chain, pairwise

import numpy as np
from numpy.typing import NDArray

from contracts.config import Detector, FeatureConfig
from contracts.errors import BadSurvey, UnusableImage
from contracts.records import PosedImage, Skipped
from coordinator.forecast.process import Held, forget_peak, held, waited_for_a_core_s
from coordinator.forecast.ranges import Range, mean_of
from survey.fragments import parse_fragment
from workers.stages.extract import image_features

Group = tuple[PosedImage, ...]
"""Images that share a picture, such as the views of a panorama, which is decoded once for all."""


@dataclass(frozen=True, slots=True)
class Grown:
    """Bytes of its own that a process took, libraries it loaded left out. at_most : while it
    worked. kept : afterwards, for what comes next; the system does not get all of it back."""

    at_most: int
    kept: int


@dataclass(frozen=True, slots=True)
class Sample:
    """What extracting some images found. All that is measured counts unreadable images too.

    sizes : images of each group. seconds : of each group, on a core of its own: what other
    programs took is left out, waiting for the disk is not. waiting : share of its time, in all,
    that the process waited for either.
    frames : by detector, of each group.
    descriptors : by channel, of each readable image, (n, D) uint8.
    memory : what extracting added to the process; None: not known here.
    """

    sizes: tuple[int, ...]
    seconds: tuple[float, ...]
    waiting: float
    frames: dict[Detector, tuple[int, ...]]
    descriptors: dict[str, tuple[NDArray[np.uint8], ...]]
    skipped: tuple[Skipped, ...]
    memory: Grown | None

    @property
    def n_images(self) -> int:
        return sum(self.sizes)

    def seconds_an_image(self, n_all: int) -> Range:
        """Of a survey of `n_all` images."""
        return mean_of(self.seconds, self.sizes, n_all)

    def frames_an_image(self, detector: Detector, n_all: int) -> Range:
        """Of a survey of `n_all` images."""
        return mean_of(self.frames[detector], self.sizes, n_all)


def draw(images: Sequence[PosedImage], n_wanted: int) -> tuple[Group, ...]:
    """Draw images spread evenly over a survey, the same ones every time.

    The survey, in the order of its uris, is cut into `n_wanted` equal parts, and of each the uri
    of the smallest hash is drawn, with those that share its picture. Panoramas bring several
    images each, so fewer are drawn, by the smallest hashes.
    """
    n_parts = min(n_wanted, len(images))
    bounds = [len(images) * part // n_parts for part in range(n_parts + 1)]
    drawn = [min(range(*part), key=lambda row: _hash(images[row])) for part in pairwise(bounds)]
    groups: dict[range, None] = {}
    for row in sorted(drawn, key=lambda row: _hash(images[row])):
        if sum(map(len, groups)) < n_wanted:
            groups[_sharing(images, row)] = None
    in_order = sorted(groups, key=lambda rows: rows.start)
    return tuple(tuple(images[row] for row in rows) for rows in in_order)


def extract_sample(
    groups: Sequence[Group], config: FeatureConfig, advance: Callable[[], None]
) -> Sample:
    """Extract every image drawn, one after the other. advance : called after each.

    Raises
    ------
    BadSurvey : not one of them can be read.
    """
    before = held()
    forget_peak()
    began = _clocks()
    seconds: list[float] = []
    frames: dict[Detector, list[int]] = {detector: [] for detector in config.detectors}
    descriptors: dict[str, list[NDArray[np.uint8]]] = {name: [] for name in config.channels()}
    skipped: list[Skipped] = []
    for group in groups:
        group_began = _clocks()
        for of_detector in frames.values():
            of_detector.append(0)
        for image in group:
            try:
                _, features = image_features(image, config)
            except UnusableImage as error:
                skipped.append(Skipped(image.uri, str(error)))
            else:
                for detector, found in features.frames.items():
                    frames[detector][-1] += len(found)
                for channel, described in features.descriptors.items():
                    descriptors[channel].append(described)
            advance()
        elapsed, crowded, _ = _clocks() - group_began
        seconds.append(elapsed - crowded)
    sizes = tuple(map(len, groups))
    if len(skipped) == sum(sizes):
        raise BadSurvey(
            f"Not one of the {len(skipped)} images sampled can be read; the first, "
            f"{skipped[0].uri}: {skipped[0].reason}. Check the survey's files."
        )
    elapsed, _, worked = _clocks() - began
    return Sample(
        sizes=sizes,
        seconds=tuple(seconds),
        waiting=max(1.0 - worked / elapsed, 0.0),
        frames={detector: tuple(counts) for detector, counts in frames.items()},
        descriptors={channel: tuple(found) for channel, found in descriptors.items()},
        skipped=tuple(skipped),
        memory=_grown(before, held(), sum(each.nbytes for each in chain(*descriptors.values()))),
    )


def _clocks() -> NDArray[np.float64]:
    """Seconds so far: of the clock, waited for a core, worked."""
    return np.array([time.perf_counter(), waited_for_a_core_s(), time.process_time()])


def _grown(before: Held | None, after: Held | None, returned_bytes: int) -> Grown | None:
    """What was taken in between, without what is returned."""
    if before is None or after is None:
        return None
    peak = after.peak - max(before.mapped, after.mapped)
    return Grown(
        max(peak - before.own - returned_bytes, 0), max(after.own - before.own - returned_bytes, 0)
    )


def _hash(image: PosedImage) -> bytes:
    return hashlib.sha256(image.uri.encode()).digest()


def _sharing(images: Sequence[PosedImage], row: int) -> range:
    """The rows around `row` whose images are cut from the same picture."""
    picture = _picture(images[row])
    first, stop = row, row + 1
    if picture is not None:
        while first > 0 and _picture(images[first - 1]) == picture:
            first -= 1
        while stop < len(images) and _picture(images[stop]) == picture:
            stop += 1
    return range(first, stop)


def _picture(image: PosedImage) -> tuple[object, ...] | None:
    """What a view is cut from; None for an image that is a picture of its own."""
    part = parse_fragment(image.fragment)
    return None if part.view is None else (image.path, part.message)
