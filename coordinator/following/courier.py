"""The courier of real work: orders become Celery tasks, and Redis tells what comes of them.

A round of `landed` takes two trips to the server however many tasks have landed; Celery's own
result objects would listen to each task for themselves.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Literal

from celery import Celery, states
from celery.exceptions import TimeLimitExceeded
from kombu.exceptions import BatchPublishError, OperationalError
from kombu.messaging import Producer
from redis import Redis, RedisError

from coordinator.following.carrying import BrokerAway, Landing, Sighting
from coordinator.following.events import Order
from workers.app import QUEUES, queue_key
from workers.lease import (
    LANDED_KEPT_S,
    STARTS_KEPT_S,
    GivenUp,
    landed_key,
    lease_key,
    starts_key,
    withdrawn_key,
)
from workers.messages import Envelope, our_version
from workers.presence import listening, processes_on
from workers.roots import roots_here

EACH_PROCESS = 4
"""Orders in flight for each process: it never waits, and little is lost with a server."""
AT_ONCE = 1000


class RedisCourier:
    """Carries the orders of one flow."""

    def __init__(self, app: Celery, flow: str, lease_s: float, priority: int) -> None:
        self._app = app
        self._server: Redis = app.backend.client
        self._flow = flow
        self._lease_s = lease_s
        self._priority = priority
        self._roots = roots_here()
        self._queues: set[str] = set()
        """That anything was sent to."""

    def room(self) -> int:
        with _told_if_away():
            present = listening(self._server)
        return EACH_PROCESS * processes_on(present, sorted(self._queues) or QUEUES, our_version())

    def send(self, orders: Mapping[str, Order]) -> None:
        with (
            _told_if_away(),
            self._app.producer_or_acquire() as producer,
            producer.batch(),  # one trip for all of them
        ):
            for task_id, order in orders.items():
                self._put(producer, task_id, order)

    def _put(self, producer: Producer, task_id: str, order: Order) -> None:
        queue = self._queue(order)
        self._queues.add(queue)
        envelope = Envelope(
            version=our_version(), lease_s=self._lease_s, roots=self._roots, message=order.message
        )
        name = f"flaneur.{order.name}"
        # Not by `send_task`: it subscribes to the result of every task, for good.
        message = self._app.amqp.create_task_message(
            task_id,
            name,
            [envelope.sealed()],
            {},
            time_limit=order.limit_s,
            argsrepr=order.key,
            kwargsrepr="",
        )
        self._app.amqp.send_task_message(
            producer, name, message, queue=queue, priority=self._priority, retry=False
        )

    def landed(self, wait_s: float) -> list[Landing]:
        key = landed_key(self._flow)
        with _told_if_away():
            # A wait of 0 would be one for ever.
            first = self._server.blpop([key], timeout=wait_s) if wait_s else None
            with self._server.pipeline(transaction=False) as pipeline:
                pipeline.lpop(key, AT_ONCE)
                more = pipeline.execute()[0] or []
            told = [*([first[1]] if first else []), *more]
            workers = dict(_heard(each) for each in told)
            return self._collect(workers)

    def look(self, orders: Mapping[str, Order]) -> tuple[list[Landing], dict[str, Sighting]]:
        # Leases are read before results: a task that ends in between is seen to have landed.
        queues = sorted({self._queue(order) for order in orders.values()})
        with _told_if_away():
            with self._server.pipeline(transaction=False) as pipeline:
                for queue in queues:
                    pipeline.llen(queue_key(queue, self._priority))
                for task_id in orders:
                    pipeline.get(starts_key(task_id))
                    pipeline.exists(lease_key(task_id))
                told = pipeline.execute()
            landings = self._collect(dict.fromkeys(orders, ""))
        waiting = dict(zip(queues, told, strict=False))
        starts, held = told[len(queues) :: 2], told[len(queues) + 1 :: 2]
        seen = {
            task_id: Sighting(int(begun or 0), bool(is_held), waiting[self._queue(order)])
            for (task_id, order), begun, is_held in zip(orders.items(), starts, held, strict=True)
        }
        for landing in landings:
            del seen[landing.task_id]
        return landings, seen

    def withdraw(self) -> None:
        with _told_if_away():
            self._server.set(withdrawn_key(self._flow), 1, ex=STARTS_KEPT_S)
            self._server.expire(landed_key(self._flow), LANDED_KEPT_S)

    def _queue(self, order: Order) -> str:
        queue: str = self._app.conf.task_routes[f"flaneur.{order.name}"]["queue"]
        return queue

    def _collect(self, workers: Mapping[str, str]) -> list[Landing]:
        """Take the results of tasks off the server. workers : who did each, where it is known."""
        if not workers:
            return []
        keys = [self._app.backend.get_key_for_task(task_id) for task_id in workers]
        with self._server.pipeline(transaction=False) as pipeline:
            pipeline.mget(keys)
            pipeline.delete(*keys)
            stored, _ = pipeline.execute()
        return [
            self._landing(task_id, worker, content)
            for (task_id, worker), content in zip(workers.items(), stored, strict=True)
            if content is not None
        ]

    def _landing(self, task_id: str, worker: str, content: bytes) -> Landing:
        meta = self._app.backend.decode_result(content)
        result = meta["result"]
        if meta["status"] != states.SUCCESS:
            return Landing(task_id, _kind(result), None, result, _reason(result), worker)
        worker, seconds = result["worker"], result["seconds"]
        if (told := result.get("refused")) is not None:
            return Landing(task_id, "refused", told=told, worker=worker, seconds=seconds)
        return Landing(task_id, "done", result["value"], worker=worker, seconds=seconds)


@contextmanager
def _told_if_away() -> Iterator[None]:
    try:
        yield
    except (RedisError, OperationalError, OSError) as error:
        raise BrokerAway(str(error)) from error
    except BatchPublishError as error:  # what was put may be there, and is put again
        raise BrokerAway(str(error.__cause__)) from error


def _heard(told: bytes) -> tuple[str, str]:
    """The id of a task and its worker."""
    task_id, _, worker = told.decode().rpartition(" ")
    return task_id, worker


def _kind(error: BaseException) -> Literal["died", "failed", "lost"]:
    if isinstance(error, GivenUp | TimeLimitExceeded):
        return "died"
    # The server went away from the worker; it was not the work that failed.
    return "lost" if isinstance(error, RedisError | OperationalError) else "failed"


def _reason(error: BaseException) -> str:
    if isinstance(error, TimeLimitExceeded):
        return f"it did not end within {float(error.args[0]):.0f} s, and its process was killed."
    if isinstance(error, GivenUp):
        return str(error)
    return f"{type(error).__name__}: {error}"
