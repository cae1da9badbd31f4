"""Several streams of work on one broker: what is urgent overtakes what is queued."""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from itertools import islice
from pathlib import Path

import pytest

from contracts.config import CodebookConfig, FeatureConfig, IndexConfig, SearchConfig
from contracts.errors import Cancelled
from coordinator.engine.running import Engine
from coordinator.following.events import Order
from coordinator.querying import locate_photos
from index.jobs import JobFolder
from index.opened import OpenedIndex
from workers.app import queue_key
from workers.lease import starts_key
from workers.messages import job_message

CONFIG = IndexConfig(
    features=FeatureConfig(detectors=("hesaff",), descriptors=("sift", "sc"), max_frames=100),
    codebooks=CodebookConfig(max_words=60),
)
JOB, BATCH = 7, 5
QUEUED = 12
"""Orders of jobs that are waiting when something urgent comes."""


@pytest.fixture(scope="module")
def index(indexed: Callable[[IndexConfig], OpenedIndex]) -> OpenedIndex:
    return indexed(CONFIG)


@pytest.fixture(autouse=True)
def job(index: OpenedIndex) -> Iterator[JobFolder]:
    """The job that made the index, as if there were work to do."""
    job = JobFolder(index.root, index.generation.segments[0].jobs[0])
    job.open_again()
    yield job
    job.close()


def probes(index: OpenedIndex) -> Iterator[Order]:
    """Endless work of a job, of which nothing is kept."""
    job = JobFolder(index.root, index.generation.segments[0].jobs[0])
    number = 0
    while True:
        message = job_message(job, job.read_plan(), shard=0, first_row=0, stop_row=4)
        yield Order("probe", f"{number:06d}", message)
        number += 1


class Jobs:
    """Jobs that work until the block ends, each in a thread of its own as in its own process."""

    def __init__(self, engine: Engine, index: OpenedIndex, n: int) -> None:
        over = threading.Event()
        follower = replace(engine.follower, priority=JOB)
        self._follower = follower.heeding(lambda: "cancel" if over.is_set() else "run")
        self._over, self._index = over, index
        self._threads = [threading.Thread(target=self._work) for _ in range(n)]
        self.done = 0

    def __enter__(self) -> "Jobs":
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        for thread in self._threads:
            thread.join()

    def _work(self) -> None:
        with suppress(Cancelled):
            for _ in self._follower.outcomes(probes(self._index)):
                self.done += 1


def test_what_is_urgent_overtakes_what_several_jobs_have_queued(
    engine: Engine, index: OpenedIndex, small_survey: Path
) -> None:
    server, queue = engine.app.backend.client, queue_key("extract", JOB)
    photos = [str(small_survey / "03.jpg")]
    batch = replace(engine.follower, priority=BATCH)
    with Jobs(engine, index, 3) as jobs:
        while server.llen(queue) < QUEUED:
            time.sleep(0.01)
        before = jobs.done
        (located,) = locate_photos(index, photos, SearchConfig(), engine.follower, lambda: None)
        assert jobs.done - before < QUEUED
        before = jobs.done
        outcomes = list(batch.outcomes(islice(probes(index), 4)))
        assert jobs.done - before < QUEUED
    assert located.error is None
    assert [outcome.error for outcome in outcomes] == [None] * 4


def test_work_that_nobody_wants_any_more_is_not_done(engine: Engine, index: OpenedIndex) -> None:
    server, ours = engine.app.backend.client, engine.follower.run_id
    with Jobs(engine, index, 3):
        while server.llen(queue_key("extract", JOB)) < QUEUED:
            time.sleep(0.01)
    results = f"celery-task-meta-{ours}*"
    known, last = len(list(server.scan_iter(results))), replace(engine.follower, priority=9)
    for order in islice(probes(index), 3):  # done when all before them has left the queues
        assert [outcome.error for outcome in last.outcomes([order])] == [None]
    assert server.llen(queue_key("extract", JOB)) == 0
    assert len(list(server.scan_iter(results))) - known <= engine.n_workers  # those at work
    assert not list(server.scan_iter(starts_key(f"{ours}*")))


def test_work_for_a_job_that_is_finished_fails_and_says_so(
    engine: Engine, index: OpenedIndex, job: JobFolder
) -> None:
    job.close()
    (outcome,) = engine.follower.outcomes(islice(probes(index), 1))
    assert outcome.error is not None
    assert "is finished. Run the same command again" in outcome.error
