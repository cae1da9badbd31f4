"""Following a batch to its end, in this process or in one of its own."""

import os
import subprocess
import sys

from contracts.errors import Cancelled
from contracts.places import Place
from contracts.progress import Progress
from coordinator.batches.batch import BatchFolder
from coordinator.batches.fetching import Fetcher
from coordinator.batches.running import open_pinned, run_batch
from coordinator.batches.watch import Watch
from coordinator.engine.broker import BROKER_VARIABLE
from coordinator.engine.running import available_cores, running_engine

QUEUES = ("locate",)


def follow_batch(
    folder: BatchFolder,
    index: Place,
    broker: str | None,
    n_workers: int | None,
    progress: Progress,
) -> None:
    """Work on a batch until all its photos are answered, and tell how it goes in its folder.

    broker, n_workers : as of `running_engine`.

    Raises
    ------
    BadConfig : another process works on it. BadIndex, Cancelled : as `run_batch`.
    BrokerUnreachable : as `running_engine`.
    """
    plan = folder.read()
    with folder.worked_on():
        watch = Watch(folder, plan)
        try:
            opened = open_pinned(index, plan)
            count = min(n_workers or plan.n_photos, plan.n_photos, available_cores())
            engine = running_engine(
                broker,
                max(count, 1),
                QUEUES,
                priority=plan.priority,
                wish=watch.wish,
                listen=watch.hear,
            )
            with Fetcher() as fetcher:
                run_batch(folder, plan, opened, engine, fetcher, progress, watch.count)
        except Cancelled:
            watch.end("cancelled")
            raise
        except KeyboardInterrupt:
            watch.end("stopped")
            raise
        except BaseException as error:
            watch.end("failed", str(error))
            raise
        watch.end("finished")


def follow_apart(
    folder: BatchFolder, index: Place, broker: str | None, n_workers: int | None
) -> "subprocess.Popen[bytes]":
    """Follow a batch in a process that goes on when the terminal closes; it writes `folder.log`.

    broker : by the environment, for a command line can be read by all users.
    """
    command = [sys.executable, "-m", "coordinator.cli", "batch", "resume", folder.name, "--wait"]
    command += ["--index", str(index), "--batches", str(folder.place)]
    command += [] if n_workers is None else ["--workers", str(n_workers)]
    environment = {**os.environ, **({} if broker is None else {BROKER_VARIABLE: broker})}
    with folder.log.open("ab") as log:
        return subprocess.Popen(  # noqa: S603 - our own interpreter and module
            command,
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=log,
            start_new_session=True,
            env=environment,
        )
