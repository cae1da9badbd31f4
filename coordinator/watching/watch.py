"""Watching a job while it works: its journal, the file of its progress, and the report at the end.

Nothing that goes wrong here ends the job: it is told once, and the work goes on.
"""

import shlex
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path

from redis import Redis, RedisError
from structlog.contextvars import bound_contextvars

from contracts.errors import BadIndex, Cancelled
from contracts.progress import Progress
from coordinator.engine.running import Engine
from coordinator.following.events import Event
from coordinator.following.follow import Follower
from coordinator.watching.at_work import at_work
from coordinator.watching.journal import Journal, Record, read_journal, utc_now
from coordinator.watching.progress import AtWork, State, write_progress
from coordinator.watching.report import write_report
from coordinator.watching.tally import Tally
from index.control import read_wish
from index.jobs import JobFolder, JobPlan
from workers.lease import who
from workers.logs import logger
from workers.server import without_password

EVERY_S = 2.0


class Watch:
    """Hears of the orders of a job, and of its stages, which it passes on to be shown."""

    def __init__(self, job: JobFolder, plan: JobPlan, shown: Progress) -> None:
        self._job, self._shown = job, shown
        self._journal = Journal(job.path)
        self._command = _command(plan.verb)
        self._tally = Tally(plan, read_journal(job.path), self._command)
        self._asked: tuple[Redis, str] | None = None
        self._lock = threading.Lock()
        self._over = threading.Event()
        self._writer = threading.Thread(target=self._keep_writing, name="progress", daemon=True)
        self._complained = False
        self._began = time.monotonic()

    def begin(self, stage: str, total: int, done: int) -> None:
        """A stage begins (contracts/progress.py)."""
        with self._lock:
            self._tally.begin(stage, total, done)
        self._write(Record(utc_now(), "stage", stage, total=total, done=done))
        self._shown.begin(stage, total, done)

    def advance(self, stage: str) -> None:
        """One order of it is done."""
        with self._lock:
            self._tally.advance(stage)
        self._shown.advance(stage)

    @contextmanager
    def at(self, stage: str) -> Iterator[None]:
        """A stage that the coordinator does itself, as one piece."""
        self.begin(stage, 1, 0)
        began = time.monotonic()
        yield
        self.advance(stage)
        took_s = time.monotonic() - began
        self._write(Record(utc_now(), "done", stage, worker=who(), seconds=took_s))

    def followed(self, engine: Engine) -> Follower:
        """The engine's follower, of which the watch hears, and which heeds wishes for the job."""
        self._asked = engine.app.backend.client, engine.follower.run_id
        return engine.follower.heeding(partial(read_wish, self._job.path), self.hear)

    def hear(self, event: Event) -> None:
        """Something happened to an order: a `Listener`."""
        images = skipped = 0
        stage, key = (event.order.name, event.order.key) if event.order else ("", "")
        if event.kind == "done" and stage == "extract" and event.value is not None:
            counts = event.value["counts"]
            images, skipped = counts["images"] if event.value["anew"] else 0, counts["skipped"]
        with self._lock:
            self._tally.hear(event)
            if images or skipped:
                self._tally.extracted(key, images, skipped)
        if event.kind != "sent":
            told = (event.kind, stage, key, event.worker, event.seconds, event.told)
            self._write(Record(utc_now(), *told, images=images, skipped=skipped))

    def start(self) -> None:
        """A coordinator begins to work on the job."""
        self._write(Record(utc_now(), "run", worker=who(), told=self._command))
        self._writer.start()

    def end(self, state: State, told: str = "") -> None:
        """It ends."""
        self._over.set()
        self._writer.join()
        with self._lock:
            self._tally.end(state, told)
        seconds = time.monotonic() - self._began
        self._write(Record(utc_now(), "end", state, seconds=seconds, told=told))
        self._journal.close()
        self._write_progress(())
        try:
            write_report(self._job)
        except (OSError, BadIndex) as error:
            self._complain(error)

    def _keep_writing(self) -> None:
        while True:
            self._write_progress(self._ask_workers())
            if self._over.wait(EVERY_S):
                return

    def _ask_workers(self) -> tuple[AtWork, ...]:
        try:
            return at_work(*self._asked) if self._asked is not None else ()
        except RedisError:  # whoever follows the orders tells of it
            return ()

    def _write_progress(self, workers: tuple[AtWork, ...]) -> None:
        with self._lock:
            progress = self._tally.progress(workers)
        try:
            write_progress(self._job.path, progress)
        except OSError as error:
            self._complain(error)

    def _write(self, record: Record) -> None:
        try:
            self._journal.write(record)
        except OSError as error:
            self._complain(error)

    def _complain(self, error: Exception) -> None:
        if not self._complained:
            logger().warning(
                "What happens to the job cannot be noted; the job goes on",
                job=self._job.job,
                error=str(error),
            )
        self._complained = True


@contextmanager
def watching(job: JobFolder, plan: JobPlan, shown: Progress) -> Iterator[Watch]:
    """Watch a job until the block ends, and note how it ended."""
    watch = Watch(job, plan, shown)
    watch.start()
    try:
        with bound_contextvars(job=plan.job, verb=plan.verb):
            yield watch
    except Cancelled:
        watch.end("cancelled")
        raise
    except KeyboardInterrupt:
        watch.end("stopped")
        raise
    except Exception as error:
        watch.end("failed", str(error))
        raise
    watch.end("finished")


def _command(verb: str) -> str:
    """The command that this process was started by, for any folder; "" : another program's."""
    given = sys.argv[1:]
    if verb not in given:
        return ""
    there = f"cd {shlex.quote(str(Path.cwd()))} && " if any(map(_is_relative, given[1:])) else ""
    return there + without_password(shlex.join(["flaneur", *given]))


def _is_relative(argument: str) -> bool:
    """Whether it names something by where we are: FOLDER, --option=FOLDER or NAME=FOLDER."""
    path = Path(argument.rpartition("=")[2])
    with suppress(OSError, ValueError):  # too long for a path, say
        return not path.is_absolute() and path.name != "" and path.exists()
    return False
