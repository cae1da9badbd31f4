"""Telling how a batch goes: the file that `batch status` and `status --watch` read."""

import os
import socket
import time
from contextlib import suppress

from coordinator.batches.batch import BatchFolder, BatchPlan
from coordinator.batches.running import STAGE
from coordinator.following.events import Event
from coordinator.watching.journal import utc_now
from coordinator.watching.pace import Pace
from coordinator.watching.progress import (
    AtWork,
    JobProgress,
    StageProgress,
    State,
    write_progress,
)
from index.control import Wish, read_wish

EVERY_S = 2.0
HEARD_S = 120.0
"""A worker that no answer came from for so long is not counted as at work."""
_STATES: dict[str, State] = {
    "waiting": "waiting",
    "back": "at work",
    "alone": "alone",
    "joined": "at work",
}


class Watch:
    """Counts what happens to a batch while it is worked on, and tells it every two seconds."""

    def __init__(self, folder: BatchFolder, plan: BatchPlan) -> None:
        self._folder = folder
        self._plan = plan
        self._done = self._failed = self._lost = self._refused = self._beat = 0
        self._known_done: int | None = None
        self._pace = Pace()
        self._heard: dict[str, float] = {}
        self._told = ""
        self._state: State = "at work"
        self._begun_at = utc_now()
        self._written_at = 0.0

    def count(self, done: int, failed: int) -> None:
        """So many photos have their answer; for some it is an error."""
        if self._known_done is not None:
            self._pace.add(done - self._known_done)
        self._known_done = self._done = done
        self._failed = failed
        self._tell(self._state)

    def hear(self, event: Event) -> None:
        """What the follower tells of its orders."""
        self._lost += event.kind == "lost"
        self._refused += event.kind == "refused"
        self._told = event.told or self._told
        self._state = _STATES.get(event.kind, self._state)
        if event.worker:
            self._heard[event.worker] = time.monotonic()

    def wish(self) -> Wish:
        """What is wished of the batch; asked about once a second."""
        wish = read_wish(self._folder.path)
        self._tell("paused" if wish == "pause" else self._state)
        return wish

    def end(self, state: State, told: str = "") -> None:
        """Nobody works on it any more."""
        self._told = told or self._told
        self._heard.clear()
        self._written_at = 0.0
        self._tell(state)

    def _tell(self, state: State) -> None:
        now = time.monotonic()
        if self._written_at and now - self._written_at < EVERY_S:
            return
        self._written_at = now
        self._beat += 1
        with suppress(OSError):  # a full disk is told by the answers that cannot be kept
            write_progress(self._folder.path, self._progress(state, now))

    def _progress(self, state: State, now: float) -> JobProgress:
        n_photos = self._plan.n_photos
        left_s = self._pace.left_s(n_photos - self._done)
        heard = sorted(name for name, at in self._heard.items() if now - at < HEARD_S)
        return JobProgress(
            job=self._plan.name,
            verb="batch",
            state=state,
            stage=STAGE,
            stages=(StageProgress(STAGE, n_photos, self._done),),
            images=n_photos,
            images_done=self._done,
            images_per_s=self._pace.per_s(),
            stage_left_s=left_s,
            left_s=left_s,
            skipped=0,
            lost=self._lost,
            refused=self._refused,
            failed=self._failed,
            workers=tuple(AtWork(name, STAGE) for name in heard),
            told=self._told,
            host=socket.gethostname(),
            pid=os.getpid(),
            begun_at=self._begun_at,
            updated_at=utc_now(),
            beat=self._beat,
            command=f"flaneur batch resume {self._plan.name}",
        )
