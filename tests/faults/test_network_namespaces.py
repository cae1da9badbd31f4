"""One of two workers is cut off from coordinator and Redis in the middle of a job, and comes back.

Three machines, simulated by network namespaces; the disk is shared, as a folder over a network
that stayed up.
"""

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path

import pytest
from machines import FLANEUR, REPOSITORY, Machine, redis_server, running, wait_until, worker
from namespaces import HUB, Network, network
from redis import Redis

from index.opened import OpenedIndex

URL = f"redis://:a-secret@{HUB}:6379/0"
OPTIONS = ("--crs", "EPSG:2154", "--shard-size", "1", "--max-words", "60")


@dataclass(frozen=True, slots=True)
class Town:
    """Three machines. server : its socket, which this process reaches as well."""

    net: Network
    server: str
    survey: Path
    folder: Path

    def worker_on(self, machine: str) -> AbstractContextManager[Machine]:
        return worker(
            self.server,
            self.folder / f"{machine}.log",
            before=self.net.on(machine),
            FLANEUR_BROKER_URL=URL,
        )

    def index(self, name: str) -> AbstractContextManager[Machine]:
        command = (*FLANEUR, "index", str(self.survey), str(self.folder / name), *OPTIONS)
        environment = {"FLANEUR_LEASE_S": "3", "FLANEUR_BROKER_URL": URL}
        return running((*self.net.on("hub"), *command), self.folder / f"{name}.log", environment)

    def content(self, name: str) -> dict[str, str]:
        files = OpenedIndex(self.folder / name).generation.files
        return {path: file.sha256 for path, file in files.items()}


@pytest.fixture
def town(small_survey: Path, tmp_path: Path) -> Iterator[Town]:
    socket = tmp_path / "redis.sock"
    with network(("left", "right")) as net:
        options = (
            *("--bind", HUB, "--port", "6379", "--requirepass", "a-secret"),
            *("--unixsocket", str(socket), "--unixsocketperm", "700"),
        )
        address = f"redis+socket://{socket}?password=a-secret"
        before = net.on("hub")
        with redis_server(tmp_path / "server", address, *options, before=before):
            yield Town(net, address, small_survey, tmp_path)


def done(job: Machine, patience_s: float) -> None:
    assert job.process.wait(patience_s) == 0, job.told()


def processes_of(worker_: Machine) -> set[int]:
    children = Path(f"/proc/{worker_.process.pid}/task/{worker_.process.pid}/children")
    return {int(each) for each in children.read_text().split()}


@pytest.mark.faults
@pytest.mark.parametrize("cut_s", [10.0, 120.0])
def test_a_job_outlives_a_worker_that_is_cut_off_and_the_worker_outlives_it_too(
    town: Town, cut_s: float
) -> None:
    client = Redis(unix_socket_path=str(town.folder / "redis.sock"), password="a-secret")  # noqa: S106

    def right_is_at_work() -> bool:
        leases = client.mget(list(client.scan_iter("flaneur:lease:*")) or ["none"])
        at_work = {int(json.loads(each)["worker"].split(":")[1]) for each in leases if each}
        return not at_work.isdisjoint(processes_of(right))

    with town.worker_on("right") as right:
        with town.worker_on("left") as left:
            with town.index("undisturbed") as job:
                done(job, 120)
            with town.index("disturbed") as job:
                wait_until(right_is_at_work, "the right worker to begin")
                town.net.cut_off("right")
                cut_at = time.monotonic()
                done(job, 120)
                assert town.content("disturbed") == town.content("undisturbed")
            time.sleep(max(0.0, cut_at + cut_s - time.monotonic()))
            town.net.join("right")
            left.process.terminate()
            left.process.wait(30)
        with town.index("by the right alone") as job:
            done(job, 240)
        assert town.content("by the right alone") == town.content("undisturbed")
        assert right.process.poll() is None, right.told()
    assert not client.hlen("unacked")
    assert not [queue for queue in ("extract", "train", "merge") if client.llen(queue)]
    client.close()


EXPOSED = """
import sys
from coordinator.engine.exposure import exposure
from workers.server import connect
print(exposure(sys.argv[1], connect(sys.argv[1])))
"""


@pytest.mark.parametrize(
    ("address", "password", "told"),
    [
        ("1.2.3.4", "", "listens on 1.2.3.4 without a password"),
        ("1.2.3.4", "a-secret", "None"),
        ("10.1.2.3", "", "None"),
    ],
)
def test_a_server_on_a_public_address_without_a_password_is_warned_of(
    tmp_path: Path, address: str, password: str, told: str
) -> None:
    socket = tmp_path / "redis.sock"
    options = (
        *("--bind", address, "--port", "6379", "--protected-mode", "no"),
        *("--unixsocket", str(socket), "--requirepass", password),
    )
    by_socket = f"redis+socket://{socket}?password={password}"
    url = f"redis://:{password}@{address}:6379" if password else f"redis://{address}:6379"
    with network(()) as net:
        net.own_address(address)
        with redis_server(tmp_path, by_socket, *options, before=net.on("hub")):
            asked = subprocess.run(
                (*net.on("hub"), sys.executable, "-c", EXPOSED, url),
                capture_output=True,
                text=True,
                check=True,
                env={**os.environ, "PYTHONPATH": str(REPOSITORY)},
            )
    assert told in asked.stdout
