"""What a job did, over all its runs: made of its journal whenever it is asked for."""

import heapq
import json
from collections import Counter, defaultdict, deque
from collections.abc import Iterator
from dataclasses import asdict, replace
from datetime import datetime

from coordinator.watching.journal import Record, read_journal
from coordinator.watching.reasons import grouped, skipped_by
from coordinator.watching.report_records import (
    JobReport,
    Run,
    StageTimes,
    TaskTime,
    Trouble,
    WorkerShare,
)
from coordinator.watching.telling import TROUBLE_IN_WORDS, in_words
from index.files import write_bytes
from index.jobs import JobFolder

SLOWEST = 10
TROUBLES = 50
"""Troubles that are told one by one, the last; all are counted."""

_OF_SHARDS = ("extract", "assign")


def report_of(job: JobFolder) -> JobReport:
    """Report on a job, whether it has ended or goes on.

    Raises
    ------
    BadIndex : its plan cannot be read.
    """
    plan = job.read_plan()
    sums = _Sums()
    for record in read_journal(job.path):
        sums.add(record)
    wall_s = sums.wall_s.get("extract", 0.0)
    runs = sums.runs()
    return JobReport(
        job=job.job,
        verb=plan.verb,
        images=plan.n_images,
        images_extracted=sums.images,
        images_per_s=sums.images / wall_s if wall_s > 0 else None,
        seconds=sum(run.seconds for run in runs),
        runs=runs,
        stages=tuple(sums.stages()),
        slowest=tuple(sums.slowest()),
        skipped=grouped(skipped_by(job, sums.skipping)),
        counts=dict(sums.counts),
        troubles=tuple(sums.troubles),
        workers=tuple(sums.workers()),
    )


def write_report(job: JobFolder) -> None:
    """Write a job's `report.json` and `report.txt` into its folder."""
    report = report_of(job)
    text = json.dumps(asdict(report), indent=1, ensure_ascii=False)
    write_bytes(job.path / "report.json", text.encode(errors="backslashreplace"))
    write_bytes(job.path / "report.txt", in_words(report).encode(errors="backslashreplace"))


class _Sums:
    """Adds up a journal record by record: of tasks only the slowest are kept."""

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()
        self.troubles: deque[Trouble] = deque(maxlen=TROUBLES)
        self.images = 0
        self.skipping: list[str] = []
        self.wall_s: dict[str, float] = defaultdict(float)
        self._tasks: Counter[str] = Counter()
        self._task_s: dict[str, float] = defaultdict(float)
        self._of_worker: dict[str, tuple[int, float]] = {}
        self._slowest: dict[bool, list[tuple[float, int, TaskTime]]] = {True: [], False: []}
        self._runs: list[Run] = []
        self._last_at = ""
        self._begun: dict[str, str] = {}
        """When the present run came to each stage, or when its last order was done."""

    def add(self, record: Record) -> None:
        """Take one more record."""
        if record.kind == "run" or not self._runs:  # or its first lines were lost
            self._close_run()
            self._runs.append(Run(record.at, record.worker, record.told, 0.0, "", ""))
            self._begun = {}
        self._last_at = record.at
        if record.kind == "stage":
            self._begun[record.stage] = record.at
        elif record.kind == "done":
            self._done(record)
        elif record.kind in TROUBLE_IN_WORDS:
            task = f"{record.stage} {record.key}".strip()
            self.counts[record.kind] += 1
            self.troubles.append(Trouble(record.at, record.kind, task, record.worker, record.told))
        elif record.kind == "end":
            self._runs[-1] = replace(self._runs[-1], how=record.stage, told=record.told)

    def _close_run(self) -> None:
        if self._runs:
            run = self._runs[-1]
            self._runs[-1] = replace(run, seconds=_between(run.begun_at, self._last_at))

    def _done(self, record: Record) -> None:
        stage = record.stage
        self.images += record.images
        if record.skipped:
            self.skipping.append(record.key)
        self._tasks[stage] += 1
        self._task_s[stage] += record.seconds
        number, seconds = self._of_worker.get(record.worker, (0, 0.0))
        self._of_worker[record.worker] = number + 1, seconds + record.seconds
        self.wall_s[stage] += _between(self._begun.get(stage, record.at), record.at)
        self._begun[stage] = record.at
        task = TaskTime(stage, record.key, record.seconds, record.worker)
        kept = self._slowest[stage in _OF_SHARDS]
        heapq.heappush(kept, (record.seconds, -self._tasks.total(), task))
        if len(kept) > SLOWEST:
            heapq.heappop(kept)

    def runs(self) -> tuple[Run, ...]:
        self._close_run()
        return tuple(self._runs)

    def stages(self) -> Iterator[StageTimes]:
        for stage, number in self._tasks.items():
            yield StageTimes(stage, number, self.wall_s[stage], self._task_s[stage])

    def slowest(self) -> list[TaskTime]:
        kept = self._slowest[True] or self._slowest[False]
        return [task for _, _, task in sorted(kept, key=lambda each: each[:2], reverse=True)]

    def workers(self) -> Iterator[WorkerShare]:
        ranked = sorted(self._of_worker.items(), key=lambda item: (-item[1][1], item[0]))
        for worker, (number, seconds) in ranked:
            yield WorkerShare(worker, number, seconds)


def _between(begun_at: str, ended_at: str) -> float:
    """Seconds, by one machine's clock; none where it was put back meanwhile."""
    ended, begun = datetime.fromisoformat(ended_at), datetime.fromisoformat(begun_at)
    return max((ended - begun).total_seconds(), 0.0)
