"""Whole jobs by real workers, watched stage by stage and task by task."""

import os
import tempfile
import time
from contextlib import nullcontext, suppress
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import psutil

from benchmarks.scaling.measured import Channel, RealJob, Spent
from contracts.config import DESCRIPTOR_SIZES, IndexConfig
from coordinator.building import STAGES
from coordinator.engine.running import Engine, running_engine
from coordinator.following.events import Event, Order
from coordinator.following.follow import go_on
from coordinator.indexing import run_job
from coordinator.intake import Intake
from coordinator.plan import make_plan
from index.jobs import JobFolder, JobPlan
from workers.messages import job_message


class Watch:
    """Progress and listener of a job: what was spent when each stage began."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self.begun: dict[str, Spent] = {}
        self.tasks: dict[str, dict[str, float]] = {name: {} for name in STAGES}
        self._n_joined = self._n_joins = 0

    def begin(self, stage: str, total: int, done: int) -> None:
        self.begun[stage] = spent(self._engine)
        self._n_joins = total

    def advance(self, stage: str) -> None:
        self._n_joined += stage == "join"
        if self._n_joined == self._n_joins:
            self.begun["commit"] = spent(self._engine)

    def hear(self, event: Event) -> None:
        """Note how long a task took."""
        if event.kind == "done" and event.order is not None:
            self.tasks[event.order.name][event.order.key] = event.seconds

    def stages(self, ended: Spent) -> dict[str, Spent]:
        """What each stage took, the last one until `ended`."""
        marks = [*self.begun.items(), ("", ended)]
        return {name: after.since(before) for (name, before), (_, after) in pairwise(marks)}


def whole_job(intake: Intake, config: IndexConfig, n_workers: int) -> RealJob:
    """Index a survey in a folder that is thrown away."""
    with (
        tempfile.TemporaryDirectory() as scratch,
        running_engine(None, n_workers) as engine,
    ):
        watch = Watch(engine)
        heard = replace(engine, follower=engine.follower.heeding(go_on, watch.hear))
        _wait_for(engine, n_workers)
        began = spent(engine)
        job, plan = make_plan(Path(scratch), intake, config)
        report = run_job(job, plan, intake, nullcontext(heard), watch)
        ended = spent(engine)
        return RealJob(
            n_workers=n_workers,
            n_images=report.images_extracted,
            shard_size=plan.shard_size,
            spent=ended.since(began),
            stages=watch.stages(ended),
            tasks=watch.tasks,
            channels=_channels(job, plan, watch.tasks["train"]),
        )


def empty_tasks(n_tasks: int, n_workers: int) -> Spent:
    """Follow tasks that have nothing to do: shards without images."""
    with (
        tempfile.TemporaryDirectory() as scratch,
        running_engine(None, n_workers) as engine,
    ):
        job, plan = _empty_job(Path(scratch), n_tasks)
        _wait_for(engine, n_workers)
        began = spent(engine)
        orders = (
            Order("extract", f"{shard:06d}", job_message(job, plan, shard=shard))
            for shard in range(n_tasks)
        )
        for _ in engine.follower.results(orders):
            pass
        return spent(engine).since(began)


def spent(engine: Engine) -> Spent:
    """What coordinator, workers and broker have used so far."""
    server = engine.app.backend.client.info()
    own = os.times()
    cpu_s, read, written = 0.0, 0, 0
    for process in psutil.Process().children(recursive=True):
        with suppress(psutil.NoSuchProcess, psutil.ZombieProcess):
            if "python" in process.name():
                used, io = process.cpu_times(), process.io_counters()
                cpu_s += used.user + used.system
                read += io.read_chars
                written += io.write_chars
    return Spent(
        wall_s=time.perf_counter(),
        coordinator_s=own.user + own.system,
        workers_s=cpu_s,
        server_s=server["used_cpu_user"] + server["used_cpu_sys"],
        commands=server["total_commands_processed"],
        read=read,
        written=written,
    )


def _wait_for(engine: Engine, n_workers: int) -> None:
    """Let workers start, each with one task that does nothing."""
    with tempfile.TemporaryDirectory() as scratch:
        job, plan = _empty_job(Path(scratch), n_workers)
        orders = (
            Order("extract", f"{shard:06d}", job_message(job, plan, shard=shard))
            for shard in range(n_workers)
        )
        for _ in engine.follower.results(orders):
            pass


def _empty_job(root: Path, n_shards: int) -> tuple[JobFolder, JobPlan]:
    config = IndexConfig()
    job = JobFolder(root, "0" * 16)
    plan = JobPlan(
        job=job.job,
        verb="index",
        config=config,
        config_digest=config.digest(),
        segment="0001",
        codebooks="0001",
        trains=True,
        n_images=n_shards,
        shard_size=1,
        n_shards=n_shards,
    )
    job.write_plan(plan, ([] for _ in range(n_shards)))
    return job, plan


def _channels(job: JobFolder, plan: JobPlan, train_s: dict[str, float]) -> list[Channel]:
    """The channels, each with the seconds its training took."""
    found = []
    for name in plan.config.features.channels():
        trained, joined = job.read_receipt("train", name), job.read_receipt("join", name)
        if trained is None or joined is None:
            raise RuntimeError(f"{name} has no receipt")
        points, words = trained.counts["points"], trained.counts["words"]
        postings = joined.counts["postings"]
        dimensions = DESCRIPTOR_SIZES[name.split("-")[1]]
        found.append(Channel(name, dimensions, points, words, postings, train_s[name]))
    return found
