"""Descriptors of real images: some for words to be made from, others to be looked up.

The keypoints of all detectors are pooled, as a million words need more than one detector finds
in these images. Held out are whole places: of every collection the last fifth, by position along
the street where that is known, by name elsewhere.
"""

from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from rich.progress import track

from contracts.config import DESCRIPTORS, DETECTORS, Descriptor, FeatureConfig
from contracts.records import PosedImage
from survey import ReadOptions, read_survey
from workers.stages.extract import image_features

OUT = Path(__file__).parents[2] / "benchmarks-out" / "codebooks"
_FOLDERS = {
    "stereopolis-paris6": ReadOptions(),
    "kth-buildings": ReadOptions(no_pose=True),
    "wxbs": ReadOptions(no_pose=True),
    "san-francisco-toy": ReadOptions(no_pose=True),
    "gps-photos": ReadOptions(no_pose=True),
    "budaors": ReadOptions(no_pose=True),
}
_HELD_OUT = 0.2
_PROCESSES = 2

_Described = dict[Descriptor, NDArray[np.uint8]]


@dataclass(frozen=True, slots=True)
class Points:
    """Descriptors of one kind, shuffled. training, held_out : (n, D) uint8, of other images."""

    training: NDArray[np.uint8]
    held_out: NDArray[np.uint8]


def described_points(data: Path) -> Mapping[Descriptor, Points]:
    """Describe all images of the data folder, once: what is in `benchmarks-out` is read."""
    if not all(_path(name, part).is_file() for name in DESCRIPTORS for part in ("train", "held")):
        _describe(data)
    return {
        name: Points(np.load(_path(name, "train")), np.load(_path(name, "held")))
        for name in DESCRIPTORS
    }


def _describe(data: Path) -> None:
    OUT.mkdir(parents=True, exist_ok=True)
    training: list[PosedImage] = []
    held_out: list[PosedImage] = []
    for folder, options in _FOLDERS.items():
        images = sorted(read_survey(data / folder, options).images, key=_along_the_street)
        last = round(len(images) * (1 - _HELD_OUT))
        training += images[:last]
        held_out += images[last:]
    with ProcessPoolExecutor(_PROCESSES, mp_context=get_context("spawn")) as processes:
        for part, images in (("train", training), ("held", held_out)):
            found = list(track(processes.map(_pooled, images), part, total=len(images)))
            for name in DESCRIPTORS:
                points = np.concatenate([each[name] for each in found])
                np.save(_path(name, part), np.random.default_rng(0).permutation(points))


def _path(name: Descriptor, part: str) -> Path:
    return OUT / f"{name}-{part}.npy"


def _along_the_street(image: PosedImage) -> tuple[float, str]:
    """Order of capture where a pose tells of one: cameras of one position stay together."""
    return (image.pose.easting if image.pose else 0.0, image.uri)


def _pooled(image: PosedImage) -> _Described:
    cv2.setNumThreads(1)
    _, features = image_features(image, FeatureConfig())
    return {
        name: np.concatenate([features.descriptors[f"{detector}-{name}"] for detector in DETECTORS])
        for name in DESCRIPTORS
    }
