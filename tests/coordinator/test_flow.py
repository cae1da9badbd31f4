"""The bookkeeping of orders, with couriers that do what servers and workers may do."""

import tracemalloc
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace

import pytest

from benchmarks.flow.memory import MemoryCourier, shards
from contracts.errors import BadIndex, BrokerUnreachable, Cancelled
from coordinator.following import flow as flow_module
from coordinator.following.carrying import BrokerAway, Landing, Sighting
from coordinator.following.events import Event, Order
from coordinator.following.flow import Ears, Flow, Outcome, Terms
from index.control import Wish

TERMS = Terms(lease_s=0.06, outage_s=0.1)


@dataclass
class Scripted:
    """Does what the queue of a test does to each order: `does` says what comes of its n-th try.

    'done', 'failed', 'refused', 'died', 'lost': that lands. 'vanished': it is neither queued nor
    begun any more. 'frozen': it was begun and is held no longer. 'unheard': it is done, and nobody
    is told.
    """

    does: Mapping[str, list[str]] = field(default_factory=dict)
    away: int = 0
    """Calls that fail before the broker is back."""
    tries: dict[str, int] = field(default_factory=dict)
    sent: list[str] = field(default_factory=list)
    most: int = 0
    withdrawn: bool = False
    _there: dict[str, str] = field(default_factory=dict)

    rooms: list[int] = field(default_factory=lambda: [4])
    """What it has room for when it is asked, the last number for good."""

    def room(self) -> int:
        self._reach()
        return self.rooms.pop(0) if len(self.rooms) > 1 else self.rooms[0]

    def send(self, orders: Mapping[str, Order]) -> None:
        self._reach()
        for task_id, order in orders.items():
            turn = self.tries.get(order.key, 0)
            self.tries[order.key] = turn + 1
            script = self.does.get(order.key, ["done"])
            self._there[task_id] = script[min(turn, len(script) - 1)]
            self.sent.append(order.key)
        self.most = max(self.most, len(self._there))

    def landed(self, wait_s: float) -> list[Landing]:
        self._reach()
        return self._take(("done", "failed", "refused", "died", "lost"))

    def look(self, orders: Mapping[str, Order]) -> tuple[list[Landing], dict[str, Sighting]]:
        self._reach()
        landings = self._take(("unheard",))
        left = orders.keys() - {landing.task_id for landing in landings}
        return landings, {task_id: self._sighting(task_id) for task_id in left}

    def withdraw(self) -> None:
        self.withdrawn = True

    def _take(self, kinds: tuple[str, ...]) -> list[Landing]:
        taken = [(task_id, what) for task_id, what in self._there.items() if what in kinds]
        for task_id, _ in taken:
            del self._there[task_id]
        return [_landing(task_id, what) for task_id, what in taken]

    def _sighting(self, task_id: str) -> Sighting:
        return Sighting(int(self._there.get(task_id) == "frozen"), held=False, waiting=0)

    def _reach(self) -> None:
        if self.away:
            self.away -= 1
            raise BrokerAway("Connection refused")


def _landing(task_id: str, what: str) -> Landing:
    if what in ("done", "unheard"):
        return Landing(task_id, "done", {"of": task_id}, worker="a:1", seconds=0.5)
    if what == "refused":
        return Landing(task_id, "refused", told="another version", worker="b:2")
    if what == "lost":
        return Landing(task_id, "lost", told="ConnectionError")
    if what == "died":
        return Landing(task_id, "died", told="its process died")
    return Landing(task_id, "failed", error=BadIndex("no words"), told="BadIndex: no words")


@dataclass
class Told:
    """Keeps what is told, and wishes what it is given to wish, the last thing for good."""

    wishes: list[Wish] = field(default_factory=lambda: ["run"])
    events: list[Event] = field(default_factory=list)

    def wish(self) -> Wish:
        return self.wishes.pop(0) if len(self.wishes) > 1 else self.wishes[0]

    def kinds(self) -> list[str]:
        return [event.kind for event in self.events if event.kind not in ("sent", "done")]


def follow(
    courier: Scripted, n: int = 10, told: Told | None = None, terms: Terms = TERMS
) -> list[Outcome]:
    told = told or Told()
    ears = Ears(told.wish, told.events.append, lambda: None)
    return list(Flow(courier, "flow", terms, ears).outcomes(shards(n)))


def keys(outcomes: list[Outcome]) -> list[str]:
    return sorted(outcome.order.key for outcome in outcomes)


ALL = [f"{number:06d}" for number in range(10)]


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(flow_module, "POLL_S", 0.002)
    monkeypatch.setattr(flow_module, "RETRY_S", 0.005)


def test_every_order_comes_back_once_and_no_more_than_fit_are_in_flight() -> None:
    courier = Scripted()
    outcomes = follow(courier)
    assert keys(outcomes) == ALL == sorted(courier.sent)
    assert courier.most <= 4
    assert {outcome.worker for outcome in outcomes} == {"a:1"}


def test_orders_are_asked_for_when_they_can_be_sent() -> None:
    asked: list[int] = []

    def orders() -> Iterator[Order | None]:
        for number, order in enumerate(shards(1000)):
            asked.append(number)
            yield order
            yield None

    outcomes = Flow(
        Scripted(), "flow", TERMS, Ears(lambda: "run", lambda _: None, lambda: None)
    ).outcomes(orders())
    next(outcomes)
    assert len(asked) <= 5
    assert sum(1 for _ in outcomes) == 999


@pytest.mark.parametrize("what", ["vanished", "frozen", "lost"])
def test_what_is_lost_is_sent_again(what: str) -> None:
    courier, told = Scripted({"000003": [what, what, "done"]}), Told()
    assert keys(follow(courier, told=told)) == ALL
    assert courier.tries["000003"] == 3
    assert told.kinds() == ["lost", "lost"]


def test_what_landed_unheard_is_found_and_not_sent_again() -> None:
    courier = Scripted({"000003": ["unheard"], "000009": ["unheard"]})
    assert keys(follow(courier)) == ALL == sorted(courier.sent)


def test_a_task_that_waits_or_is_held_is_not_lost() -> None:
    @dataclass
    class Slow(Scripted):
        looks: int = 0

        def _sighting(self, task_id: str) -> Sighting:
            self.looks += 1
            if self.looks > 20:
                self._there[task_id] = "done"
            return Sighting(self.looks % 2, held=self.looks % 2 == 1, waiting=1)

    courier = Slow({"000000": ["vanished"]})
    assert keys(follow(courier, 1)) == ["000000"]
    assert courier.tries == {"000000": 1}


def test_a_task_that_those_behind_it_have_overtaken_is_lost_though_the_queue_is_never_empty() -> (
    None
):
    class Busy(Scripted):
        def _sighting(self, task_id: str) -> Sighting:
            return replace(super()._sighting(task_id), waiting=1000)

    courier = Busy({"000003": ["vanished", "done"]})
    assert keys(follow(courier)) == ALL
    assert courier.tries["000003"] == 2


def test_a_refusal_is_told_once_and_the_order_is_sent_again() -> None:
    courier = Scripted({"000003": ["refused", "done"], "000004": ["refused", "refused", "done"]})
    told = Told()
    assert keys(follow(courier, told=told)) == ALL
    assert [(event.worker, event.told) for event in told.events if event.kind == "refused"] == [
        ("b:2", "another version")
    ]


def test_an_order_that_all_refuse_fails_in_the_end() -> None:
    courier = Scripted({"000003": ["refused"]})
    failed = [outcome for outcome in follow(courier) if outcome.value is None]
    assert [(outcome.order.key, outcome.error) for outcome in failed] == [
        ("000003", "another version")
    ]
    assert courier.tries["000003"] == TERMS.refusals


def test_what_failed_or_died_says_so() -> None:
    courier, told = Scripted({"000003": ["failed"], "000004": ["died"]}), Told()
    outcomes = {outcome.order.key: outcome for outcome in follow(courier, told=told)}
    assert isinstance(outcomes["000003"].wrong_index, BadIndex)
    assert not outcomes["000003"].given_up
    assert outcomes["000004"].given_up
    assert sorted(told.kinds()) == ["failed", "given_up"]
    assert len(outcomes) == 10


def test_a_broker_that_is_away_is_waited_for_and_told_of_once() -> None:
    courier, told = Scripted(away=5), Told()
    assert keys(follow(courier, told=told)) == ALL
    assert told.kinds() == ["waiting", "back"]


def test_workers_that_are_all_gone_are_told_of_once_and_waited_for() -> None:
    class Deserted(Scripted):
        def landed(self, wait_s: float) -> list[Landing]:
            return super().landed(wait_s) if self.rooms == [4] else []

    courier, told = Deserted(rooms=[4, 0, 0, 4, 4]), Told()
    terms = Terms(lease_s=0.06, alone_s=0.0)
    assert keys(follow(courier, told=told, terms=terms)) == ALL
    assert [kind for kind in told.kinds() if kind != "lost"] == ["alone", "joined"]


def test_a_worker_that_starts_is_not_missed() -> None:
    courier, told = Scripted(rooms=[0]), Told()
    assert keys(follow(courier, told=told)) == ALL
    assert told.kinds() == []
    assert courier.most == TERMS.in_flight


def test_a_broker_that_stays_away_ends_the_work() -> None:
    with pytest.raises(BrokerUnreachable, match=r"did not come back in 0 s \(Connection refused"):
        follow(Scripted(away=10**6))


def test_cancelling_withdraws_what_was_sent() -> None:
    courier = Scripted({key: ["vanished"] for key in ALL})
    with pytest.raises(Cancelled, match="same command again goes on"):
        follow(courier, told=Told(["run", "run", "cancel"]))
    assert courier.withdrawn
    assert len(courier.sent) == 4


def test_a_broker_that_is_away_does_not_keep_anybody_from_cancelling() -> None:
    with pytest.raises(Cancelled):
        follow(Scripted(away=10**6), told=Told(["run", "cancel"]), terms=Terms(outage_s=60.0))


def test_while_paused_nothing_is_sent_and_what_is_in_flight_lands() -> None:
    told = Told(["pause"] * 5 + ["run"])
    courier = Scripted()
    assert keys(follow(courier, told=told)) == ALL
    assert [event.kind for event in told.events[:2]] == ["paused", "resumed"]


def test_whoever_wants_no_more_withdraws_the_rest() -> None:
    courier = Scripted()
    outcomes = Flow(
        courier, "flow", TERMS, Ears(lambda: "run", lambda _: None, lambda: None)
    ).outcomes(shards(10**9))
    next(outcomes)
    outcomes.close()  # type: ignore[attr-defined]
    assert courier.withdrawn


def test_memory_is_that_of_what_is_in_flight() -> None:
    ears = Ears(lambda: "run", lambda _: None, lambda: None)
    courier = MemoryCourier(100)
    outcomes = Flow(courier, "flow", Terms(), ears).outcomes(shards(20_000))
    tracemalloc.start()
    try:
        came = sum(1 for _ in outcomes)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert (came, courier.longest) == (20_000, 100)
    assert peak < 500_000
