"""Following tasks: a bounded number in flight, lost ones sent again, the first failure told.

What is done is read from receipts and results; what is lost is noticed by its lease.
"""

import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from functools import partial
from typing import Any, TypeVar

from celery import Celery, states
from redis import Redis, RedisError

from contracts.errors import BadConfig, BadIndex, BrokerUnreachable, TaskFailed
from coordinator.events import Order
from workers.lease import LEASE_S, lease_key, starts_key
from workers.messages import Envelope, our_version
from workers.roots import roots_here

T = TypeVar("T")

POLL_S = 0.05
LEASE_CHECK_S = 5.0
OUTAGE_S = 60.0
"""How long a server may be away before the job gives up."""


@dataclass(slots=True)
class _Flight:
    order: Order
    task_id: str
    sent_at: float = field(default_factory=time.monotonic)


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came back of an order: `value`, or `error` where its task failed.

    wrong_index : the failure, where it is the index's or the options' and so every task's.
    """

    order: Order
    value: dict[str, Any] | None
    error: str | None
    wrong_index: BadIndex | BadConfig | None = None


class Follower:
    """Sends orders to the workers and yields what comes back, in the order of completion."""

    def __init__(self, app: Celery, run_id: str, in_flight: int, watch: Callable[[], None]) -> None:
        self._app = app
        self._run_id = run_id
        self._n_begun = 0
        self._in_flight = in_flight
        self._watch = watch
        """Called at every poll; raises if the local workers have died."""
        self._server: Redis = app.backend.client
        self._server_run = self._server_run_id()

    def outcomes(self, orders: Iterable[Order]) -> Iterator[Outcome]:
        """Send `orders`, a bounded number at a time; memory is bounded by what is in flight."""
        waiting = iter(orders)
        flying: deque[_Flight] = deque()
        exhausted = False
        checked_at = time.monotonic()
        while True:
            while not exhausted and len(flying) < self._in_flight:
                order = next(waiting, None)
                if order is None:
                    exhausted = True
                else:
                    flying.append(self._begin(order))
            if not flying:
                return
            landed = [flight for flight in flying if self._is_done(flight)]
            for flight in landed:
                flying.remove(flight)
                yield self._outcome(flight)
            if landed:
                continue
            self._watch()
            if time.monotonic() - checked_at > LEASE_CHECK_S:
                self._patiently(lambda: self._send_lost(flying))
                checked_at = time.monotonic()
            time.sleep(POLL_S)

    def results(self, orders: Iterable[Order]) -> Iterator[tuple[Order, dict[str, Any]]]:
        """Like `outcomes`, but the first failed task ends it.

        Raises
        ------
        TaskFailed : names the task and says why. BadIndex, BadConfig : as the task found.
        """
        for outcome in self.outcomes(orders):
            if outcome.wrong_index is not None:
                raise outcome.wrong_index
            if outcome.value is None:
                order = outcome.order
                raise TaskFailed(f"{order.name} {order.key} failed: {outcome.error}")
            yield outcome.order, outcome.value

    def _begin(self, order: Order) -> _Flight:
        self._n_begun += 1  # an engine may run several jobs, whose keys are alike
        flight = _Flight(order, f"{self._run_id}.{self._n_begun}.{order.name}.{order.key}")
        self._patiently(partial(self._send, flight))
        return flight

    def _send(self, flight: _Flight) -> None:
        # The result object is let go: it would listen, and we ask (a bounded number of keys).
        self._app.send_task(
            f"flaneur.{flight.order.name}",
            args=[self._envelope(flight.order).model_dump(mode="json")],
            task_id=flight.task_id,
            retry=False,
        )

    def _envelope(self, order: Order) -> Envelope:
        return Envelope(
            version=our_version(), lease_s=LEASE_S, roots=roots_here(), message=order.message
        )

    def _is_done(self, flight: _Flight) -> bool:
        state = self._patiently(partial(self._app.backend.get_state, flight.task_id))
        return state in states.READY_STATES

    def _outcome(self, flight: _Flight) -> Outcome:
        meta = self._patiently(partial(self._app.backend.get_task_meta, flight.task_id))
        self._patiently(partial(self._app.backend.forget, flight.task_id))
        value = meta["result"]
        if meta["status"] == states.SUCCESS:
            return Outcome(flight.order, value["value"], None)
        wrong_index = value if isinstance(value, BadIndex | BadConfig) else None
        return Outcome(flight.order, None, f"{type(value).__name__}: {value}", wrong_index)

    def _send_lost(self, flying: Iterable[_Flight]) -> None:
        """Send again what was begun and is held no longer, and all if the server lost its data."""
        server_run = self._server_run_id()
        restarted = server_run != self._server_run
        self._server_run = server_run
        now = time.monotonic()
        for flight in flying:
            begun = self._server.exists(starts_key(flight.task_id))
            held = self._server.exists(lease_key(flight.task_id))
            gone = begun and not held and now - flight.sent_at > LEASE_S
            if (gone or (restarted and not held)) and not self._is_done(flight):
                self._send(flight)
                flight.sent_at = now

    def _server_run_id(self) -> str:
        info: dict[str, Any] = self._server.info("server")
        return str(info.get("run_id"))

    def _patiently(self, call: Callable[[], T]) -> T:
        """Call the server, waiting while it restarts."""
        gives_up_at = time.monotonic() + OUTAGE_S
        while True:
            try:
                return call()
            except (RedisError, ConnectionError, OSError) as error:
                self._watch()
                if time.monotonic() > gives_up_at:
                    raise BrokerUnreachable(
                        f"The broker went away and did not come back in {OUTAGE_S:.0f} s "
                        f"({error}). Run the same command again once it is up."
                    ) from error
                time.sleep(0.5)
