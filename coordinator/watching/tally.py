"""What a coordinator knows of its job while it works: counts and paces, no files and no server."""

import os
import socket
from collections import Counter
from collections.abc import Iterable
from dataclasses import replace

from coordinator.following.events import Event
from coordinator.watching.journal import MAX_TOLD, Record, utc_now
from coordinator.watching.pace import Pace
from coordinator.watching.progress import AtWork, JobProgress, StageProgress, State
from index.jobs import JobPlan

LAST = "join"
"""Only seconds are left after it."""

_STATES: dict[str, State] = {
    "paused": "paused",
    "resumed": "at work",
    "waiting": "waiting",
    "back": "at work",
    "alone": "alone",
    "joined": "at work",
}


class Tally:
    """Counts what happens to the orders of a job.

    former : the journal of its earlier runs. command : that works on it.
    """

    def __init__(self, plan: JobPlan, former: Iterable[Record], command: str) -> None:
        self._plan, self._command = plan, command
        self._stage = ""
        self._stages: dict[str, StageProgress] = {}
        self._state: State = "at work"
        self._counts: Counter[str] = Counter()
        self._told = ""
        self._orders, self._images = Pace(), Pace()
        self._skipped = {record.key: record.skipped for record in former if record.skipped}
        self._begun_at = utc_now()
        self._beat = 0

    def begin(self, stage: str, total: int, done: int) -> None:
        """A stage begins, with orders that earlier runs have done."""
        self._stage = stage
        self._stages[stage] = StageProgress(stage, total, done)
        self._orders = Pace()
        if stage == "extract":
            self._images = Pace()

    def advance(self, stage: str) -> None:
        """One order of a stage is done."""
        there = self._stages[stage]
        self._stages[stage] = replace(there, done=there.done + 1)
        self._orders.add()

    def extracted(self, key: str, images: int, skipped: int) -> None:
        """Of a shard so many images were read just now, and so many could not be."""
        self._images.add(images + skipped)
        self._skipped[key] = skipped

    def hear(self, event: Event) -> None:
        """Something happened."""
        self._counts[event.kind] += 1
        if event.kind in _STATES:
            self._state = _STATES[event.kind]
            self._orders, self._images = Pace(), Pace()  # the time of standing still says nothing
        if event.told:
            self._told = event.told[:MAX_TOLD]

    def _images_done(self) -> int:
        shards = self._stages["extract"].done if "extract" in self._stages else 0
        return min(shards * self._plan.shard_size, self._plan.n_images)

    def end(self, state: State, told: str = "") -> None:
        """The run is over."""
        self._state = state
        self._told = told[:MAX_TOLD] or self._told

    def progress(self, workers: tuple[AtWork, ...]) -> JobProgress:
        """How far the job is now. workers : what they are at."""
        self._beat += 1
        works = self._state == "at work"
        at = self._stages.get(self._stage, StageProgress("", 0, 0))
        counts = self._counts
        stage_left_s = self._orders.left_s(at.total - at.done) if works else None
        return JobProgress(
            job=self._plan.job,
            verb=self._plan.verb,
            state=self._state,
            stage=self._stage,
            stages=tuple(self._stages.values()),
            images=self._plan.n_images,
            images_done=self._images_done(),
            images_per_s=self._images.per_s() if works and self._stage == "extract" else None,
            stage_left_s=stage_left_s,
            left_s=stage_left_s if self._stage == LAST else None,
            skipped=sum(self._skipped.values()),
            lost=counts["lost"],
            refused=counts["refused"],
            failed=counts["failed"] + counts["given_up"],
            workers=workers if works else (),
            told=self._told,
            host=socket.gethostname(),
            pid=os.getpid(),
            begun_at=self._begun_at,
            updated_at=utc_now(),
            beat=self._beat,
            command=self._command,
        )
