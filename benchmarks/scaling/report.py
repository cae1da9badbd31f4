"""Tables of what was measured, and of what the simulation makes of it."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

from benchmarks.scaling.measured import Measured, RealJob
from benchmarks.scaling.simulation import Site, StageTook, Took, simulate
from benchmarks.scaling.tasks import Layout, work_of
from benchmarks.table import print_table
from coordinator.plan import shard_size_for

SURVEYS = (10_000, 100_000, 1_000_000)
WORKERS = (1, 2, 10, 20, 50, 100, 200)
FOLDER_BYTES_S, OPEN_S = 1e9, 1e-3
"""Assumed, not measured: a file server behind 10 Gbit/s, a millisecond for each file opened."""
_FORMER_SHARD_SIZE = 32
_BUSY = 0.7


def print_measured(measured: Measured) -> None:
    """Jobs, their stages, and the coordinator alone."""
    bare = {each.n_processes: each.images_a_second for each in measured.bare}
    whole = {each.n_workers: each.images_a_second for each in measured.jobs}
    rates = {"whole index job": whole, "bare extraction": bare}
    print("Images a second (ratios are of one run)\n")
    print_table(
        ("", "1 process", "2 processes", "ratio"),
        [
            (name, f"{rate[1]:.3f}", f"{rate[2]:.3f}", f"{rate[2] / rate[1]:.3f}")
            for name, rate in rates.items()
        ],
    )
    print(f"\nratio of ratios: {whole[2] / whole[1] / (bare[2] / bare[1]):.3f}")
    for job in measured.jobs:
        print(f"\n{job.n_images} images, shards of {job.shard_size}, workers: {job.n_workers}\n")
        print_table(
            ("stage", "tasks", "wall s", "s a task", "longest", "workers' CPU s",
             "coordinator's CPU s", "broker's CPU s", "commands", "MB read", "MB written"),
            list(_stage_rows(job)),
        )  # fmt: skip
    empty, n_empty = measured.empty, measured.n_empty
    print(
        f"\n{n_empty} tasks without images: {n_empty / empty.wall_s:.0f} a second; for each "
        f"{empty.coordinator_s / n_empty * 1e3:.2f} ms CPU of the coordinator, "
        f"{empty.server_s / n_empty * 1e3:.2f} ms of the broker, "
        f"{empty.commands / n_empty:.1f} commands\n"
    )
    print_table(
        ("coordinator alone: images", "shards", "plans, s", "commits, s", "survey read, MB",
         "planned, MB", "at most, MB"),
        [
            (f"{each.n_images:,}", f"{each.n_shards:,}", f"{each.planned_s:.1f}",
             f"{each.committed_s:.1f}", f"{each.read_mb:.0f}", f"{each.planned_mb:.0f}",
             f"{each.peak_mb:.0f}")
            for each in measured.alone
        ],
    )  # fmt: skip


def print_checked(measured: Measured) -> None:
    """Simulate the jobs that were run, and print both."""
    rates = {each.n_processes: each.images_a_second for each in measured.bare}
    rows = []
    for job in measured.jobs:
        work = work_of(measured, Layout(job.n_images, job.shard_size, job.n_workers))
        slowdown = job.n_workers * rates[1] / rates[job.n_workers]
        took = simulate(work, _site(measured, job.n_workers, slowdown=slowdown))
        rows.append(_held_against("whole job", job.n_workers, took.wall_s, job.spent.wall_s))
        rows += [
            _held_against(name, job.n_workers, stage.wall_s, job.stages[name].wall_s)
            for name, stage in took.stages.items()
        ]
    print("\nThe simulation of the jobs that were run\n")
    print_table(("", "workers", "predicted, s", "happened, s", "predicted / happened"), rows)


def print_simulated(measured: Measured) -> None:
    """How efficient more workers are, and what limits them."""
    print(
        f"\nSimulated: a folder of {FOLDER_BYTES_S / 1e9:g} GB/s, {OPEN_S * 1e3:g} ms to open a "
        "file; columns: share of all workers' time lost in a stage or alone"
    )
    for n_images in SURVEYS:
        now = Layout(n_images, shard_size_for(n_images))
        former = Layout(n_images, _FORMER_SHARD_SIZE, puts_aside=False, threaded=False)
        for told, layout in (("", now), ("; as it was before", former)):
            print(f"\n{n_images:,} images in shards of {layout.shard_size}{told}\n")
            print_table(
                ("workers", "hours", "efficiency", "plan", "extract", "train", "assign", "merge",
                 "join", "commit", "what limits"),
                list(_sweep(measured, layout)),
            )  # fmt: skip


@dataclass(frozen=True, slots=True)
class _Losses:
    """By stage, the share of all workers' time in which they did not compute."""

    took: Took
    n_workers: int

    def shares(self) -> dict[str, float]:
        lost = {"plan": self.took.plan_s * self.n_workers}
        for name, stage in self.took.stages.items():
            lost[name] = stage.wall_s * self.n_workers - stage.core_s
        lost["commit"] = self.took.commit_s * self.n_workers
        return {name: each / (self.took.wall_s * self.n_workers) for name, each in lost.items()}

    def limit(self) -> str:
        """The largest loss, and why."""
        shares = self.shares()
        name = max(shares, key=lambda each: shares[each])
        stage = self.took.stages.get(name)
        return f"{name}: {'the coordinator alone' if stage is None else self._why(name, stage)}"

    def _why(self, name: str, stage: StageTook) -> str:
        busy = {
            "the shared folder": stage.folder_s,
            "the coordinator's messages": stage.coordinator_s,
            "the broker": stage.server_s,
        }
        most = max(busy, key=lambda each: busy[each])
        if busy[most] > _BUSY * stage.wall_s:
            return most
        return {"train": "a channel is one task", "join": "a channel is one task"}.get(
            name, "waiting for files and the last tasks"
        )


def _sweep(measured: Measured, layout: Layout) -> Iterator[tuple[str, ...]]:
    one = None
    for n_workers in WORKERS:
        work = work_of(measured, replace(layout, n_workers=n_workers))
        took = simulate(work, _site(measured, n_workers, FOLDER_BYTES_S, OPEN_S))
        one = one or took.wall_s
        losses = _Losses(took, n_workers)
        yield (
            f"{n_workers}",
            f"{took.wall_s / 3600:.2f}",
            f"{one / n_workers / took.wall_s:.2f}",
            *(f"{share:.1%}" for share in losses.shares().values()),
            losses.limit(),
        )


def _site(
    measured: Measured,
    n_workers: int,
    folder_bytes_s: float = float("inf"),
    open_s: float = 0.0,
    slowdown: float = 1.0,
) -> Site:
    return Site(
        n_workers=n_workers,
        message_s=measured.empty.coordinator_s / measured.n_empty,
        server_s=measured.empty.server_s / measured.n_empty,
        folder_bytes_s=folder_bytes_s,
        open_s=open_s,
        slowdown=slowdown,
    )


def _held_against(name: str, n_workers: int, predicted: float, happened: float) -> tuple[str, ...]:
    return (
        name,
        f"{n_workers}",
        f"{predicted:.1f}",
        f"{happened:.1f}",
        f"{predicted / happened:.2f}" if happened else "",
    )


def _stage_rows(job: RealJob) -> Iterable[tuple[str, ...]]:
    for name, spent in job.stages.items():
        seconds = list(job.tasks.get(name, {}).values())
        yield (
            name,
            f"{len(seconds)}",
            f"{spent.wall_s:.1f}",
            f"{sum(seconds) / len(seconds):.2f}" if seconds else "",
            f"{max(seconds):.2f}" if seconds else "",
            f"{spent.workers_s:.1f}",
            f"{spent.coordinator_s:.2f}",
            f"{spent.server_s:.2f}",
            f"{spent.commands}",
            f"{spent.read / 1e6:.0f}",
            f"{spent.written / 1e6:.0f}",
        )
