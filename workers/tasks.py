"""The tasks: parse the message, call one stage, return a receipt or a result."""

import time
from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar

from celery import Task
from celery.signals import task_postrun

from contracts.errors import Refused
from contracts.records import Receipt
from workers import messages
from workers.app import app
from workers.lease import LEASE_S, RENEWALS, lease, who
from workers.messages import Envelope, Message
from workers.roots import Roots, roots_here
from workers.stages.assign import assign_shard
from workers.stages.extract import extract_shard
from workers.stages.join import join_channel
from workers.stages.merge import merge_words
from workers.stages.train import train_channel

Json = dict[str, Any]
Request = TypeVar("Request", bound=Message)

LANDED_KEPT_S = 3600


def landed_key(run_id: str) -> str:
    """Where a coordinator hears of its tasks that have ended."""
    return f"flaneur:landed:{run_id}"


@task_postrun.connect
def _tell(task_id: str, **_: object) -> None:
    """The result is stored: wake the coordinator that waits for it."""
    key = landed_key(task_id.split(".", 1)[0])
    pipeline = app.backend.client.pipeline(transaction=False)
    pipeline.lpush(key, task_id)
    pipeline.expire(key, LANDED_KEPT_S)
    pipeline.execute()


def _task(
    name: str, kind: type[Request]
) -> Callable[[Callable[[Request, Roots], Json]], Callable[[Request, Roots], Json]]:
    """Register a function of one request as the task `flaneur.<name>`, run under its lease."""

    def register(work: Callable[[Request, Roots], Json]) -> Callable[[Request, Roots], Json]:
        @app.task(name=f"flaneur.{name}", bind=True)
        @wraps(work)
        def run(self: Task, envelope: object) -> Json:
            started = time.perf_counter()
            try:
                sent = Envelope.opened(envelope)
                roots = Roots(sent.roots, roots_here())
                with lease(app.backend.client, self.request.id, sent.lease_s):
                    value = work(kind.parse(sent.message, roots), roots)
            except Refused:
                time.sleep(_pause(envelope))
                raise
            return {"value": value, "worker": who(), "seconds": time.perf_counter() - started}

        return work

    return register


@_task("extract", messages.ExtractMessage)
def extract(request: messages.ExtractMessage, roots: Roots) -> Json:
    return _brief(extract_shard(request.folder(), request.shard, roots.local))


@_task("train", messages.TrainMessage)
def train(request: messages.TrainMessage, _: Roots) -> Json:
    return _brief(train_channel(request.folder(), request.channel))


@_task("assign", messages.AssignMessage)
def assign(request: messages.AssignMessage, _: Roots) -> Json:
    return _brief(assign_shard(request.folder(), request.shard, request.first_image_id))


@_task("merge", messages.MergeMessage)
def merge(request: messages.MergeMessage, _: Roots) -> Json:
    words = range(request.first_word, request.stop_word)
    return _brief(merge_words(request.folder(), request.channel, words, request.n_images))


@_task("join", messages.JoinMessage)
def join(request: messages.JoinMessage, _: Roots) -> Json:
    folder, pieces = request.folder(), request.first_words
    return _brief(join_channel(folder, request.channel, pieces, request.n_images))


@_task("locate", messages.LocateMessage)
def locate(request: messages.LocateMessage, _: Roots) -> Json:
    from workers.stages.locate import locate_photo  # geopandas and pyproj stay out of extraction

    return locate_photo(request)


@_task("judge", messages.JudgeMessage)
def judge(request: messages.JudgeMessage, _: Roots) -> Json:
    from workers.stages.judge import judge_photo

    return judge_photo(request)


@_task("rehearse", messages.RehearseMessage)
def rehearse(request: messages.RehearseMessage, _: Roots) -> Json:
    from workers.stages.rehearse import rehearse_photo

    return rehearse_photo(request)


def _pause(envelope: object) -> float:
    """Seconds that a worker of another version waits, so that it does not drain the queue."""
    lease_s = envelope.get("lease_s") if isinstance(envelope, dict) else None
    return min(float(lease_s) if isinstance(lease_s, int | float) else 0.0, LEASE_S) / RENEWALS


def _brief(receipt: Receipt) -> Json:
    return {"stage": receipt.stage, "key": receipt.key, "counts": receipt.counts}
