"""Extract: a shard's images, each decoded once, become one feature file."""

import platform
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import faiss
import numpy as np
from numpy.typing import NDArray

from contracts.config import DESCRIPTOR_SIZES, FeatureConfig
from contracts.errors import UnusableImage
from contracts.records import PosedImage, Receipt, Skipped
from index.files import read_member, write_arrays
from index.jobs import IndexedImage, JobFolder
from retrieval.features import Features, extract
from survey import DecodedImage, decode_image, decode_mask
from workers.stages.sample import put_aside


def instruction_set() -> str:
    """What this process is compiled for; mixed jobs may differ in the last bit."""
    return f"{platform.machine()} {faiss.get_compile_options().strip()}"


def extract_shard(job: JobFolder, shard: int, local: Callable[[str], str]) -> Receipt:
    """Write the shard's features; an image that cannot be read is recorded and passed over.

    local : where this machine has a path of the plan.
    """
    plan = job.read_plan()
    config = plan.config.features
    excluded = job.read_excluded(shard)
    indexed: list[IndexedImage] = []
    skipped: list[Skipped] = []
    found: list[Features] = []
    for row, image in enumerate(job.read_images(shard)):
        if row in excluded:
            skipped.append(Skipped(image.uri, excluded[row]))
            continue
        try:
            decoded, features = image_features(_here(image, local), config)
        except UnusableImage as error:
            skipped.append(Skipped(image.uri, str(error)))
            continue
        indexed.append(IndexedImage(row, decoded.sha256, decoded.width_px, decoded.height_px))
        found.append(features)
    arrays = _columns(found, config)
    path = job.features(shard)
    outputs = {
        job.relative(path): write_arrays(path, {**arrays, **put_aside(indexed, arrays, plan)}),
        job.relative(job.indexed_of_shard(shard)): job.write_indexed(shard, indexed),
    }
    frames = sum(int(arrays[f"{det}/counts"].sum()) for det in config.detectors)
    blank = sum(1 for features in found if not any(map(len, features.frames.values())))
    receipt = Receipt(
        stage="extract",
        key=f"{shard:06d}",
        outputs=outputs,
        counts={
            "images": len(indexed),
            "skipped": len(skipped),
            "frames": frames,
            "without_frames": blank,
        },
        skipped=tuple(skipped),
        instruction_set=instruction_set(),
    )
    job.write_receipt(receipt)
    return receipt


def probe_rows(job: JobFolder, shard: int, rows: range, local: Callable[[str], str]) -> None:
    """Work on some images of a shard as `extract_shard` does, and keep nothing of it."""
    config = job.read_plan().config.features
    images = job.read_images(shard)
    for row in rows:
        with suppress(UnusableImage):
            image_features(_here(images[row], local), config)


def _here(image: PosedImage, local: Callable[[str], str]) -> PosedImage:
    mask = image.mask_path
    return replace(image, path=local(image.path), mask_path=None if mask is None else local(mask))


def image_features(image: PosedImage, config: FeatureConfig) -> tuple[DecodedImage, Features]:
    """Decode one image as the survey says it is stored, and describe it."""
    decoded = decode_image(
        image.path,
        fragment=image.fragment,
        quarter_turns=image.quarter_turns,
        max_side_px=config.max_side_px,
        max_pixels=config.max_pixels,
    )
    usable: NDArray[np.bool_] | None = None
    if image.mask_path is not None:
        height, width = decoded.rgb.shape[:2]
        usable = decode_mask(
            image.mask_path,
            fragment=image.fragment,
            quarter_turns=image.quarter_turns,
            width=width,
            height=height,
        )
    return decoded, extract(decoded.rgb, usable, config)


def _columns(found: list[Features], config: FeatureConfig) -> dict[str, NDArray[np.generic]]:
    """Lay a shard's features end to end: `<detector>/counts` per image, `<channel>` descriptors."""
    arrays: dict[str, NDArray[np.generic]] = {}
    for detector in config.detectors:
        arrays[f"{detector}/counts"] = np.array(
            [len(features.frames[detector]) for features in found], dtype=np.int32
        )
        for descriptor in config.descriptors:
            channel = f"{detector}-{descriptor}"
            empty = np.zeros((0, DESCRIPTOR_SIZES[descriptor]), dtype=np.uint8)
            arrays[channel] = np.concatenate(
                [empty, *(features.descriptors[channel] for features in found)]
            )
    return arrays


def read_channel(path: Path, channel: str) -> list[NDArray[np.uint8]]:
    """One channel of a feature file: descriptors (n, d) uint8 of each image of the shard."""
    detector = channel.split("-")[0]
    counts = read_member(path, f"{detector}/counts", np.int32, 1)
    descriptors = read_member(path, channel, np.uint8, 2)
    return np.split(descriptors, np.cumsum(counts)[:-1]) if len(counts) else []
