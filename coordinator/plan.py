"""Planning: images are cut into shards of minutes of work, and a job is found or begun."""

import hashlib
from collections.abc import Iterable, Sequence
from itertools import chain
from pathlib import Path

from contracts.config import IndexConfig
from contracts.errors import BadIndex
from contracts.records import PosedImage, Receipt
from coordinator.intake import Intake
from index.codebooks import Words
from index.commits import writing
from index.jobs import JobFolder, JobPlan, Verb, jobs_of
from survey.stored import forget_listings, state_of

SMALLEST_SHARD = 8
"""Images: seconds of one core, still many times what sending a task and its files cost."""
LARGEST_SHARD = 128
"""Two minutes of one core, so that a lost worker costs little, and 0.4 GB of its memory."""
MANY_SHARDS = 8192
"""Beyond so many, shards grow instead: merging opens each of them for every range of words."""


def make_plan(
    root: Path,
    intake: Intake,
    config: IndexConfig,
    shard_size: int | None = None,
    words: Words | None = None,
) -> tuple[JobFolder, JobPlan]:
    """Find or write the job that makes an index of these images by this configuration.

    shard_size : None: by the number of images.
    words : already in the index, to be used instead of training some.

    Raises
    ------
    BadIndex : `root` is a file or another folder's, or the plan of a job in it is damaged.
    """
    _refuse_foreign(root)
    return plan_images(root, "index", intake.images, config, shard_size, words)


def plan_images(
    root: Path,
    verb: Verb,
    images: Sequence[PosedImage],
    config: IndexConfig,
    shard_size: int | None,
    words: Words | None,
    again: int = 0,
) -> tuple[JobFolder, JobPlan]:
    """Find or write the job that makes a segment of images.

    The job's id is a digest of every image's uri, pose, size and time of change, of the
    configuration and of words that are there: the same survey comes back to the same job, a
    changed one gets a new job. A job keeps the shard size it was begun with.

    again : tells jobs apart that are alike in all this.
    """
    told = (verb, str(again), config.digest(), words.digest if words else "")
    job = JobFolder(root, job_id(chain(told, _states(images))))
    forget_listings()
    with writing(root):  # or two jobs begun at once would take the same segment
        if job.has_plan():
            return job, job.read_plan()
        segment = free_segment(root)
        size = shard_size or shard_size_for(len(images))
        plan = JobPlan(
            job=job.job,
            verb=verb,
            config=config,
            config_digest=config.digest(),
            segment=segment,
            codebooks=words.name if words else segment,
            trains=words is None,
            n_images=len(images),
            shard_size=size,
            n_shards=-(-len(images) // size),
        )
        if words is not None:
            write_train_receipts(job, words)
        firsts = range(0, len(images), size)
        job.write_plan(plan, (images[first : first + size] for first in firsts))
    return job, plan


def shard_size_for(n_images: int) -> int:
    """Images a shard where nobody says otherwise; the finished index does not depend on it."""
    wanted = max(-(-n_images // MANY_SHARDS), SMALLEST_SHARD)
    return min(1 << (wanted - 1).bit_length(), LARGEST_SHARD)


def job_id(parts: Iterable[str]) -> str:
    """The id of a job of which these lines say all that it depends on."""
    digest = hashlib.sha256()
    for part in parts:
        digest.update(f"{part}\n".encode())
    return digest.hexdigest()[:16]


def write_train_receipts(job: JobFolder, words: Words) -> None:
    """Say of words that are there already what training them would have said."""
    for channel, outputs in words.files.items():
        counts = {"words": words.n_words[channel], "points": 0}
        job.write_receipt(Receipt("train", channel, outputs, counts))


def free_segment(root: Path) -> str:
    """The next number that no job has taken."""
    taken = [int(job.read_plan().segment) for job in jobs_of(root) if job.has_plan()]
    folders = [path.name for path in (root / "segments").glob("[0-9]*")]
    return f"{max((*taken, *map(int, folders)), default=0) + 1:04d}"


def _states(images: Sequence[PosedImage]) -> Iterable[str]:
    # Many images may lie in one file.
    states = {path: state_of(path) for path in {image.path for image in images}}
    for image in images:
        state = states[image.path]
        yield f"{image!r} {state.size} {state.mark}"


def _refuse_foreign(root: Path) -> None:
    if root.exists() and not root.is_dir():
        raise BadIndex(f"{root} is a file; an index is a folder. Name a new one.")
    if root.exists() and not jobs_of(root) and any(each.name != ".lock" for each in root.iterdir()):
        raise BadIndex(
            f"{root} is not empty and not a Flaneur index; nothing was written there. "
            "Name a new folder."
        )
