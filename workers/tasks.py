"""The tasks: parse the message, call one stage, return a receipt or a result."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from typing import Any, TypeVar

from celery import Task
from celery.exceptions import Ignore
from celery.signals import task_postrun
from redis import RedisError

from contracts.errors import Cancelled, Refused, TaskFailed
from contracts.records import Receipt
from index.control import read_wish
from index.jobs import JobFolder
from workers import messages
from workers.app import app
from workers.lease import LEASE_S, RENEWALS, GivenUp, Withdrawn, lease, release, who
from workers.messages import Envelope, JobMessage, Message, our_version
from workers.presence import listening, processes_on
from workers.roots import Roots, roots_here
from workers.stages.assign import assign_shard
from workers.stages.extract import extract_shard, probe_rows
from workers.stages.join import join_channel
from workers.stages.merge import merge_words
from workers.stages.train import train_channel

MOST_THREADS = 8
"""Of one task, however many processes there are."""

Json = dict[str, Any]
Request = TypeVar("Request", bound=Message)


@task_postrun.connect
def _end(task_id: str, **_: object) -> None:
    """The result is stored: the coordinator may have it."""
    release(app.backend.client, task_id)


def task(
    name: str, kind: type[Request]
) -> Callable[[Callable[[Request, Roots], Json]], Callable[[Request, Roots], Json]]:
    """Register a function of one request as the task `flaneur.<name>`, run under its lease."""

    def register(work: Callable[[Request, Roots], Json]) -> Callable[[Request, Roots], Json]:
        @app.task(name=f"flaneur.{name}", bind=True)
        @wraps(work)
        def run(self: Task, envelope: object) -> Json:
            started = time.perf_counter()
            told: Json
            try:
                sent = Envelope.opened(envelope)
                roots = Roots(sent.roots, roots_here())
                with lease(app.backend.client, self.request.id, sent.lease_s):
                    told = {"value": work(kind.parse(sent.message, roots), roots)}
            except Withdrawn as error:
                raise Ignore from error
            except (Refused, Cancelled) as error:
                time.sleep(_pause(envelope))
                told = {"refused": str(error)}
            except MemoryError as error:  # Celery would end the whole worker
                raise GivenUp("it needs more memory than its worker may have.") from error
            return {**told, "worker": who(), "seconds": time.perf_counter() - started}

        return work

    return register


@task("extract", messages.ExtractMessage)
def extract(request: messages.ExtractMessage, roots: Roots) -> Json:
    with _wanted(request) as job:
        done = job.valid_receipt("extract", f"{request.shard:06d}")
        return _brief(done or extract_shard(job, request.shard, roots.local), anew=done is None)


@task("probe", messages.ProbeMessage)
def probe(request: messages.ProbeMessage, roots: Roots) -> Json:
    with _wanted(request) as job:
        probe_rows(job, request.shard, range(request.first_row, request.stop_row), roots.local)
    return {}


@task("train", messages.TrainMessage)
def train(request: messages.TrainMessage, _: Roots) -> Json:
    with _wanted(request) as job:
        done = job.valid_receipt("train", request.channel)
        if done is not None:
            return _brief(done, anew=False)
        n_threads = _threads_each(len(job.read_plan().config.features.channels()))
        return _brief(train_channel(job, request.channel, n_threads))


@task("assign", messages.AssignMessage)
def assign(request: messages.AssignMessage, _: Roots) -> Json:
    first_id = request.first_image_id
    with _wanted(request) as job:
        words = job.words_digest(job.read_plan().config.features.channels())
        done = job.assigned(request.shard, words)
        if done is not None and done.counts["first_image_id"] == first_id:
            return _brief(done, anew=False)
        return _brief(assign_shard(job, request.shard, first_id))


@task("merge", messages.MergeMessage)
def merge(request: messages.MergeMessage, _: Roots) -> Json:
    words = range(request.first_word, request.stop_word)
    with _wanted(request) as job:
        return _brief(merge_words(job, request.channel, words, request.n_images))


@task("join", messages.JoinMessage)
def join(request: messages.JoinMessage, _: Roots) -> Json:
    pieces = request.first_words
    with _wanted(request) as job:
        return _brief(join_channel(job, request.channel, pieces, request.n_images))


@task("locate", messages.LocateMessage)
def locate(request: messages.LocateMessage, _: Roots) -> Json:
    from workers.stages.locate import locate_photo  # geopandas and pyproj stay out of extraction

    return locate_photo(request)


@task("judge", messages.JudgeMessage)
def judge(request: messages.JudgeMessage, _: Roots) -> Json:
    from workers.stages.judge import judge_photo

    return judge_photo(request)


@task("rehearse", messages.RehearseMessage)
def rehearse(request: messages.RehearseMessage, _: Roots) -> Json:
    from workers.stages.rehearse import rehearse_photo

    return rehearse_photo(request)


def _pause(envelope: object) -> float:
    """Seconds that a worker of another version waits, so that it does not drain the queue."""
    lease_s = envelope.get("lease_s") if isinstance(envelope, dict) else None
    return min(float(lease_s) if isinstance(lease_s, int | float) else 0.0, LEASE_S) / RENEWALS


@contextmanager
def _wanted(request: JobMessage) -> Iterator[JobFolder]:
    """The folder of a job that is still wanted, to work in.

    Raises
    ------
    Cancelled, TaskFailed : it is not. Refused : as `JobMessage.folder`.
    """
    job = request.folder()
    if read_wish(job.path) == "cancel":
        raise Cancelled(f"job {job.job} is cancelled.")
    if job.is_closed:
        raise TaskFailed(f"job {job.job} is finished. Run the same command again to see it.")
    try:
        yield job
    finally:
        if job.is_closed:  # another did the same, and sooner
            job.drop_scratch()


def _threads_each(n_tasks: int) -> int:
    """Threads for each of the few tasks of a stage, where more processes would only wait for it.

    One where the server is away.
    """
    try:
        processes = processes_on(listening(app.backend.client), ("train",), our_version())
    except RedisError:
        return 1
    return min(max(processes // n_tasks, 1), MOST_THREADS)


def _brief(receipt: Receipt, *, anew: bool = True) -> Json:
    """What the coordinator needs to know. anew : it was not done already."""
    return {"counts": receipt.counts, "anew": anew}
