"""Which orders are with the workers: what to send, what was lost, what is given up.

Pure: a courier carries the orders, and neither Celery nor Redis is known here. Memory is bounded
by what is in flight, however many orders there are.
"""

import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, TypeVar

from contracts.errors import BadConfig, BadIndex, BrokerUnreachable, Cancelled
from coordinator.following.carrying import BrokerAway, Courier, Landing, Sighting
from coordinator.following.events import Event, Kind, Listener, Order
from index.control import Wish

T = TypeVar("T")
Json = dict[str, Any]

POLL_S = 1.0
"""How long to wait for something to land before looking around: at wishes, at local workers."""
FILL_S = 0.2
"""How long to look for the next order before looking around."""
RETRY_S = 0.5


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came back of an order: `value`, or `error` where its task failed.

    wrong_index : the failure, where it is the index's or the options' and so every task's.
    seconds : that `worker` took. given_up : each process that began it died.
    """

    order: Order
    value: Json | None
    error: str | None
    wrong_index: BadIndex | BadConfig | None = None
    worker: str = ""
    seconds: float = 0.0
    given_up: bool = False


@dataclass(frozen=True, slots=True)
class Terms:
    """How patient to be.

    lease_s : with a worker that is not heard of. outage_s : with a broker that is away.
    alone_s : without any worker, before that is told: one that starts needs a moment.
    in_flight : orders, until a worker tells of itself. refusals : how often an order may be
    refused.
    """

    in_flight: int = 4
    alone_s: float = 20.0
    lease_s: float = 60.0
    outage_s: float = 600.0
    refusals: int = 10
    checks: int = 6
    """Times a lease that is looked for what was lost, and for workers that came or went."""


@dataclass(frozen=True, slots=True)
class Ears:
    """Whom a flow heeds and tells. watch : called at least once a second; may raise."""

    wish: Callable[[], Wish]
    listen: Listener
    watch: Callable[[], None]


@dataclass(slots=True)
class _Flight:
    """number : its place among all that was sent. starts : times it was begun before."""

    order: Order
    number: int = 0
    sent_at: float = 0.0
    starts: int = 0
    refusals: int = 0
    again: bool = False


@dataclass(slots=True)
class Flow:
    """One stream of orders. name : begins the id of each task."""

    courier: Courier
    name: str
    terms: Terms
    ears: Ears
    _flying: dict[str, _Flight] = field(default_factory=dict)
    _n_sent: int = 0
    _room: int = 0
    _paused: bool = False
    _alone: bool = False
    _joined_at: float = 0.0
    """When a worker was last seen to listen."""
    _refusing: set[str] = field(default_factory=set)
    _furthest: dict[str, int] = field(default_factory=dict)
    """By kind of order, the last sent one that has landed: a queue is first in, first out."""
    _overtaken: dict[str, int] = field(default_factory=dict)
    """`_furthest`, as it was at the last check."""
    _check_at: float = 0.0
    _ask_at: float = 0.0

    def outcomes(self, orders: Iterable[Order | None]) -> Iterator[Outcome]:
        """Send `orders`, and yield what comes back as it comes.

        orders : may be endless; None: there is none to send just now, but ask again.

        Raises
        ------
        Cancelled : that was wished. BrokerUnreachable : it was away for too long.
        """
        waiting = iter(orders)
        more = True
        self._joined_at = time.monotonic()
        self._check_at = self._joined_at + self._check_every_s
        self._room = self.terms.in_flight
        try:
            self._look_around()
            while True:
                self._heed()
                looking = more and not self._paused
                if looking:
                    more = self._fill(waiting)
                if not (more or self._flying):
                    return
                busy = looking and more and len(self._flying) < self._room
                for landing in self._arrivals(0.0 if busy else POLL_S):
                    outcome = self._land(landing)
                    if outcome is not None:
                        yield outcome
                self.ears.watch()
        finally:
            if self._n_sent:  # what is left was delivered twice, or nobody wants it any more
                with suppress(BrokerAway):
                    self.courier.withdraw()

    @property
    def _check_every_s(self) -> float:
        return self.terms.lease_s / self.terms.checks

    def _heed(self) -> None:
        now = time.monotonic()
        if now < self._ask_at:
            return
        self._ask_at = now + POLL_S
        wish = self.ears.wish()
        if wish == "cancel":
            raise Cancelled("Cancelled. What is done stays: the same command again goes on.")
        if (wish == "pause") != self._paused:
            self._paused = wish == "pause"
            self.ears.listen(Event("paused" if self._paused else "resumed"))

    def _fill(self, waiting: Iterator[Order | None]) -> bool:
        """Send while there is room; whether there may be more to send."""
        until = time.monotonic() + FILL_S
        more = True
        fresh: list[Order] = []
        while len(self._flying) + len(fresh) < self._room and time.monotonic() < until:
            try:
                order = next(waiting)
            except StopIteration:
                more = False
                break
            if order is not None:
                fresh.append(order)
        self._send(
            {
                f"{self.name}.{number}.{order.name}.{order.key}": _Flight(order)
                for number, order in enumerate(fresh, self._n_sent + 1)
            }
        )
        return more

    def _send(self, flights: Mapping[str, _Flight]) -> None:
        if not flights:
            return
        orders = {task_id: flight.order for task_id, flight in flights.items()}
        self._patiently(lambda: self.courier.send(orders))
        for task_id, flight in flights.items():
            self._n_sent += 1
            flight.again = task_id in self._flying
            flight.number, flight.sent_at = self._n_sent, time.monotonic()
            self._flying[task_id] = flight
            self.ears.listen(Event("sent", flight.order))

    def _arrivals(self, wait_s: float) -> Sequence[Landing]:
        if time.monotonic() >= self._check_at:
            return self._check()
        wait_s = min(wait_s, self._check_every_s)
        return self._patiently(lambda: self.courier.landed(wait_s))

    def _check(self) -> Sequence[Landing]:
        """Look at all that is in flight: what landed unheard, and what is lost."""
        self._look_around()
        orders = {task_id: flight.order for task_id, flight in self._flying.items()}
        landings, seen = self._patiently(lambda: self.courier.look(orders))
        lost: dict[str, _Flight] = {}
        for task_id, sighting in seen.items():
            flight = self._flying[task_id]
            if self._is_lost(flight, sighting):
                self.ears.listen(Event("lost", flight.order))
                flight.starts = sighting.starts
                lost[task_id] = flight
        self._send(lost)
        self._overtaken = dict(self._furthest)
        self._check_at = time.monotonic() + self._check_every_s
        return landings

    def _look_around(self) -> None:
        """Make room for the workers that listen; what is sent waits while none does."""
        room = self._patiently(self.courier.room)
        now = time.monotonic()
        if room:
            self._room, self._joined_at = room, now
        alone = now - self._joined_at > self.terms.alone_s
        if alone != self._alone and not self._paused:
            self._alone = alone
            self.ears.listen(Event("alone" if alone else "joined"))

    def _is_lost(self, flight: _Flight, seen: Sighting) -> bool:
        """Begun and held no longer; or never begun, and not in the queue any more."""
        if seen.held:
            return False
        if seen.starts > flight.starts:
            return True
        overtaken = flight.number < self._overtaken.get(flight.order.name, 0)
        late = time.monotonic() - flight.sent_at > self.terms.lease_s
        return late and (overtaken or not seen.waiting)

    def _land(self, landing: Landing) -> Outcome | None:
        flight = self._flying.get(landing.task_id)
        if flight is None:  # it was sent twice, and has landed
            return None
        order, worker = flight.order, landing.worker
        if not flight.again:
            self._furthest[order.name] = max(flight.number, self._furthest.get(order.name, 0))
        if landing.kind in ("refused", "lost") and not self._is_refused(landing, flight):
            return None
        del self._flying[landing.task_id]
        if landing.kind == "done":
            self._tell("done", order, landing)
            return Outcome(order, landing.value, None, None, worker, landing.seconds)
        died, error = landing.kind == "died", landing.error
        self._tell("given_up" if died else "failed", order, landing)
        wrong_index = error if isinstance(error, BadIndex | BadConfig) else None
        return Outcome(order, None, landing.told, wrong_index, worker, landing.seconds, died)

    def _is_refused(self, landing: Landing, flight: _Flight) -> bool:
        """Whether it came back too often to be sent again, as it is otherwise."""
        if landing.kind == "lost":
            self._tell("lost", flight.order, landing)
        elif landing.worker not in self._refusing:  # told once: it refuses all that it is sent
            self._refusing.add(landing.worker)
            self._tell("refused", flight.order, landing)
        flight.refusals += 1
        if flight.refusals >= self.terms.refusals:
            return True
        self._send({landing.task_id: flight})
        return False

    def _tell(self, kind: Kind, order: Order, landing: Landing) -> None:
        told = (landing.worker, landing.seconds, landing.told, landing.value)
        self.ears.listen(Event(kind, order, *told))

    def _patiently(self, call: Callable[[], T]) -> T:
        """Call the courier, waiting while the broker is away."""
        away_since: float | None = None
        while True:
            try:
                result = call()
            except BrokerAway as error:
                if away_since is None:
                    away_since = time.monotonic()
                    self.ears.listen(Event("waiting", told=str(error)))
                if time.monotonic() - away_since > self.terms.outage_s:
                    raise BrokerUnreachable(
                        f"The broker went away and did not come back in {self.terms.outage_s:.0f} "
                        f"s ({error}). Run the same command again once it is up."
                    ) from error
                self.ears.watch()
                self._heed()
                time.sleep(RETRY_S)
            else:
                if away_since is not None:
                    self.ears.listen(Event("back"))
                    # Workers need a moment to tell that they still hold what they hold.
                    self._joined_at = time.monotonic()
                    self._check_at = self._joined_at + 2 * self._check_every_s
                return result
