"""The tasks: parse the message, call one stage, return a receipt or a result."""

from collections.abc import Callable
from functools import wraps
from typing import Any

from celery import Task

from contracts.records import Receipt
from workers import messages
from workers.app import app
from workers.lease import lease
from workers.stages.assign import assign_shard
from workers.stages.extract import extract_shard
from workers.stages.join import join_channel
from workers.stages.merge import merge_words
from workers.stages.train import train_channel

Json = dict[str, Any]


def _task(name: str) -> Callable[[Callable[[object], Json]], Task]:
    """Register a function of one message as the task `flaneur.<name>`, run under its lease."""

    def register(work: Callable[[object], Json]) -> Task:
        @app.task(name=f"flaneur.{name}", bind=True)
        @wraps(work)
        def run(self: Task, message: object) -> Json:
            with lease(app.backend.client, self.request.id):
                return work(message)

        return run

    return register


@_task("extract")
def extract(message: object) -> Json:
    request = messages.ExtractMessage.parse(message)
    return _brief(extract_shard(request.folder(), request.shard))


@_task("train")
def train(message: object) -> Json:
    request = messages.TrainMessage.parse(message)
    return _brief(train_channel(request.folder(), request.channel))


@_task("assign")
def assign(message: object) -> Json:
    request = messages.AssignMessage.parse(message)
    return _brief(assign_shard(request.folder(), request.shard, request.first_image_id))


@_task("merge")
def merge(message: object) -> Json:
    request = messages.MergeMessage.parse(message)
    words = range(request.first_word, request.stop_word)
    return _brief(merge_words(request.folder(), request.channel, words, request.n_images))


@_task("join")
def join(message: object) -> Json:
    request = messages.JoinMessage.parse(message)
    folder, pieces = request.folder(), request.first_words
    return _brief(join_channel(folder, request.channel, pieces, request.n_images))


@_task("locate")
def locate(message: object) -> Json:
    from workers.stages.locate import locate_photo  # geopandas and pyproj stay out of extraction

    return locate_photo(messages.LocateMessage.parse(message))


@_task("judge")
def judge(message: object) -> Json:
    from workers.stages.judge import judge_photo

    return judge_photo(messages.JudgeMessage.parse(message))


@_task("rehearse")
def rehearse(message: object) -> Json:
    from workers.stages.rehearse import rehearse_photo

    return rehearse_photo(messages.RehearseMessage.parse(message))


def _brief(receipt: Receipt) -> Json:
    return {"stage": receipt.stage, "key": receipt.key, "counts": receipt.counts}
