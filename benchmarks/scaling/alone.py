"""What the coordinator does alone, before the first task and after the last one.

A simulated survey is planned and committed by the engine's own functions; what workers would have
left in the job's folder is written in between.
"""

import time
from contextlib import nullcontext
from pathlib import Path

from benchmarks.scaling.measured import Alone
from contracts.config import IndexConfig
from contracts.records import Camera, Pose, PosedImage, Receipt
from coordinator.indexing import run_job
from coordinator.intake import Intake, NamedSurvey
from coordinator.plan import make_plan
from index.codebooks import codebook_paths
from index.files import write_bytes
from index.jobs import IndexedImage, JobFolder, JobPlan
from index.segments import segment_paths
from survey import Survey

_N_FILES = 1000
"""Files that the images are said to lie in; one that is looked at costs microseconds more."""


class Silent:
    """Nobody watches."""

    def begin(self, stage: str, total: int, done: int) -> None: ...
    def advance(self, stage: str) -> None: ...


def plan_and_commit(folder: Path, n_images: int) -> Alone:
    """Plan and commit a survey of so many images; run it in a process of its own."""
    intake = made_intake(folder, n_images)
    read_mb = held_mb()
    config = IndexConfig()
    began = time.perf_counter()
    job, plan = make_plan(folder / "index", intake, config)
    planned_s, planned_mb = time.perf_counter() - began, held_mb()
    intake = intake.without_images()
    leave_receipts(job, plan)
    began = time.perf_counter()
    run_job(job, plan, intake, nullcontext(), Silent())
    committed_s = time.perf_counter() - began
    return Alone(
        n_images, plan.n_shards, read_mb, planned_s, planned_mb, committed_s, held_mb("VmHWM")
    )


def made_intake(folder: Path, n_images: int) -> Intake:
    """A survey as readers give it: each image with texts and numbers of its own."""
    files = [str(folder / f"{number:04d}.jpg") for number in range(_N_FILES)]
    for path in files:
        write_bytes(Path(path), b"")
    camera, crs = Camera("300", 60.0, 2048, 2048), "EPSG:2154"
    images = tuple(
        PosedImage(
            uri=f"drive-{number // 1000:05d}/Paris-140616_0740-300-{number:09d}.jpg",
            path="".join(files[number % _N_FILES]),
            pose=Pose(650000.0 + number / 7, 6860000.0 + number / 11, crs, 40.0 + number / 13,
                      number / 17 % 360.0, number / 19 % 5.0, number / 23 % 5.0),
            camera=camera,
            captured_at=f"2014-06-16T{number // 3600 % 24:02d}:{number // 60 % 60:02d}:00+00:00",
        )
        for number in range(n_images)
    )  # fmt: skip
    survey = Survey(images, (), crs, "made")
    return Intake((NamedSurvey("", folder, survey),), images, ("",) * n_images, (), crs, (), False)


def leave_receipts(job: JobFolder, plan: JobPlan) -> None:
    """Leave in a job's folder what the coordinator reads of finished stages."""
    channels = plan.config.features.channels()
    counts = {f"{name}/{what}": 1000 for name in channels for what in ("points", "sq_dist")}
    for shard in range(plan.n_shards):
        first = shard * plan.shard_size
        n_images = min(plan.shard_size, plan.n_images - first)
        rows = [IndexedImage(row, f"{first + row:064x}", 2048, 2048) for row in range(n_images)]
        outputs = {job.relative(job.indexed_of_shard(shard)): job.write_indexed(shard, rows)}
        done = {"images": n_images, "skipped": 0, "frames": 6000, "without_frames": 0}
        job.write_receipt(Receipt("extract", f"{shard:06d}", outputs, done))
        job.write_receipt(Receipt("assign", f"{shard:06d}", {}, counts))
    for channel in channels:
        words = codebook_paths(job.root, plan.codebooks, channel)["words"]
        packed = segment_paths(job.root, plan.segment, channel).packed
        for stage, path, what in (("train", words, "words"), ("join", packed, "postings")):
            outputs = {job.relative(path): write_bytes(path, channel.encode())}
            job.write_receipt(Receipt(stage, channel, outputs, {what: 20_000}))


def held_mb(key: str = "VmRSS") -> float:
    """Memory of this process. key : VmRSS, now; VmHWM, the most there was."""
    status = Path("/proc/self/status").read_text(encoding="ascii")
    return int(status.split(f"{key}:")[1].split()[0]) / 1024
