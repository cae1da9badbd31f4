"""Following orders through Celery: who follows them, by what priority, heeding and telling whom."""

import os
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from itertools import count
from typing import Any

from celery import Celery

from contracts.errors import BadConfig, TaskFailed
from coordinator.following.courier import RedisCourier
from coordinator.following.events import Event, Listener, Order, unheard
from coordinator.following.flow import Ears, Flow, Outcome, Terms
from index.control import Wish
from workers.lease import LEASE_S

LEASE_VARIABLE = "FLANEUR_LEASE_S"
"""How many seconds a worker that is not heard of is believed to be at work."""


def go_on() -> Wish:
    """The wish where nobody can wish otherwise."""
    return "run"


@dataclass(frozen=True, slots=True)
class Follower:
    """Sends orders to the workers and yields what comes back, in the order of completion.

    run_id : of its own, for it begins the ids of tasks. in_flight : how many orders, until a
    worker tells of itself. watch : called at least once a second; raises if all is for nothing.
    priority : of all that it sends, 0 before 9. wish : asked about once a second.
    """

    app: Celery
    run_id: str
    in_flight: int
    watch: Callable[[], None]
    priority: int = 0
    wish: Callable[[], Wish] = go_on
    listen: Listener = unheard
    _numbers: Iterator[int] = field(default_factory=lambda: count(1))
    """Of flows: an engine may run several jobs, whose orders have the same keys."""

    def heeding(self, wish: Callable[[], Wish], listen: Listener = unheard) -> "Follower":
        """The same for one piece of work: it heeds `wish`, and tells `listen` as well."""

        def tell_both(event: Event) -> None:
            self.listen(event)
            listen(event)

        return replace(self, wish=wish, listen=tell_both)

    def outcomes(self, orders: Iterable[Order | None]) -> Iterator[Outcome]:
        """Send `orders`, a bounded number at a time; memory is bounded by what is in flight.

        orders : may be endless; None: there is none to send just now, but ask again.

        Raises
        ------
        Cancelled : that was wished. BrokerUnreachable : it was away for too long.
        """
        name = f"{self.run_id}-{next(self._numbers)}"
        terms = Terms(in_flight=self.in_flight, lease_s=lease_s())
        courier = RedisCourier(self.app, name, terms.lease_s, self.priority)
        return Flow(courier, name, terms, Ears(self.wish, self.listen, self.watch)).outcomes(orders)

    def results(self, orders: Iterable[Order | None]) -> Iterator[tuple[Order, dict[str, Any]]]:
        """Like `outcomes`, but the first failed task ends it.

        Raises
        ------
        TaskFailed : names the task and says why. BadIndex, BadConfig : as the task found.
        """
        for outcome in self.outcomes(orders):
            yield outcome.order, value_of(outcome)


def value_of(outcome: Outcome) -> dict[str, Any]:
    """What a task returned.

    Raises
    ------
    TaskFailed : it failed; names it and says why. BadIndex, BadConfig : as the task found.
    """
    if outcome.wrong_index is not None:
        raise outcome.wrong_index
    if outcome.value is None:
        order = outcome.order
        raise TaskFailed(f"{order.name} {order.key} failed: {outcome.error}")
    return outcome.value


def lease_s() -> float:
    """The lease that this machine's environment asks for.

    Raises
    ------
    BadConfig : it is no number of seconds from 0.5 to 3600.
    """
    text = os.environ.get(LEASE_VARIABLE) or str(LEASE_S)
    try:
        seconds = float(text)
    except ValueError:
        seconds = 0.0
    if not 0.5 <= seconds <= 3600:
        raise BadConfig(f"{LEASE_VARIABLE} is {text!r}; it takes seconds, from 0.5 to 3600.")
    return seconds
