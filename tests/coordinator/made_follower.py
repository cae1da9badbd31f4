"""A job with a plan, and the events a follower would tell of it."""

from pathlib import Path

from contracts.config import FeatureConfig, IndexConfig
from contracts.records import Receipt, Skipped
from coordinator.following.events import Event, Order
from coordinator.watching.watch import Watch
from index.jobs import JobFolder, JobPlan

N_SHARDS = 4
SHARD_SIZE = 3
N_IMAGES = 11
WORKERS = ("north:11", "south:22")


def made_job(root: Path) -> tuple[JobFolder, JobPlan]:
    """Eleven images in four shards."""
    job = JobFolder(root, "ab" * 8)
    config = IndexConfig(features=FeatureConfig.of(detectors=("star",), descriptors=("sift",)))
    plan = JobPlan(
        job=job.job,
        verb="index",
        config=config,
        config_digest=config.digest(),
        segment="0001",
        codebooks="0001",
        trains=True,
        n_images=N_IMAGES,
        shard_size=SHARD_SIZE,
        n_shards=N_SHARDS,
    )
    job.write_plan(plan, ())
    return job, plan


def order(stage: str, number: int) -> Order:
    return Order(stage, f"{number:06d}", {})


def extract(job: JobFolder, watch: Watch, shard: int, *skipped: Skipped, anew: bool = True) -> None:
    """A shard is extracted: its receipt is there, and then the follower hears of it."""
    n_images = min(SHARD_SIZE, N_IMAGES - shard * SHARD_SIZE)
    counts = {"images": n_images - len(skipped), "skipped": len(skipped)}
    job.write_receipt(Receipt("extract", f"{shard:06d}", {}, counts, skipped))
    watch.hear(Event("sent", order("extract", shard)))
    worker = WORKERS[shard % 2]
    value = {"counts": counts, "anew": anew}
    watch.hear(Event("done", order("extract", shard), worker, 1.5 + shard, value=value))
    watch.advance("extract")
