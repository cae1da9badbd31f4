"""Leases on a real server: who holds a task, how often it was begun, whether it is wanted."""

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from redis import Redis

from coordinator.engine.embedded import embedded_server
from workers.lease import (
    MAX_STARTS,
    GivenUp,
    Withdrawn,
    landed_key,
    lease,
    lease_key,
    release,
    starts_key,
    who,
    withdrawn_key,
)
from workers.server import connect

TASK = "run-1.7.extract.000012"


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Redis]:
    with embedded_server(tmp_path_factory.mktemp("server")) as url:
        yield connect(url)


@pytest.fixture
def server(running: Redis) -> Redis:
    running.flushall()
    return running


def test_a_lease_says_who_is_at_what_and_lapses_by_itself(server: Redis) -> None:
    with lease(server, TASK, 60.0):
        told = json.loads(server.get(lease_key(TASK)))
        assert told == {"worker": who(), "task": "extract 000012"}
        assert 50_000 < server.pttl(lease_key(TASK)) <= 60_000


def test_a_lease_outlives_its_time_while_the_work_goes_on(server: Redis) -> None:
    with lease(server, TASK, 0.3):
        server.delete(lease_key(TASK))  # a server that lost its data
        while not server.exists(lease_key(TASK)):
            pass


def test_a_task_that_ends_leaves_only_the_word_that_it_has(server: Redis) -> None:
    with lease(server, TASK, 60.0):
        pass
    release(server, TASK)
    assert [key.decode() for key in server.scan_iter()] == [landed_key("run-1")]
    assert server.lpop(landed_key("run-1")) == f"{TASK} {who()}".encode()


def test_a_task_whose_processes_die_is_given_up(server: Redis) -> None:
    for _ in range(MAX_STARTS):
        with lease(server, TASK, 60.0):  # and dies: nothing is released
            pass
    with (
        pytest.raises(GivenUp, match="begun 3 times, and its worker process died each time"),
        lease(server, TASK, 60.0),
    ):
        pass
    release(server, TASK)
    assert not server.exists(starts_key(TASK))


def test_what_is_withdrawn_is_not_begun(server: Redis) -> None:
    server.set(withdrawn_key("run-1"), 1)
    with pytest.raises(Withdrawn), lease(server, TASK, 60.0):
        pass


def test_work_begins_though_the_server_is_away(tmp_path: Path) -> None:
    nobody = connect(f"redis+socket://{tmp_path}/nobody", patience_s=0.1)
    with lease(nobody, TASK, 60.0):
        pass
