"""The faults: each does something to a running job, and says what, or that it came too late."""

import os
import random
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import psutil
from proving_ground import LEASE_S, SKEW_S, Command, Ground, clock_library, kill_group

PAST_LEASE_S = 1.5 * LEASE_S


@dataclass(slots=True)
class Scene:
    """A job that is at work. skewed : whether a clock may be off."""

    command: Command
    rng: random.Random

    @property
    def ground(self) -> Ground:
        return self.command.ground

    def skew_s(self) -> int:
        """How far the clock of the next machine is off."""
        return self.rng.choice((-SKEW_S, 0, 0, SKEW_S)) if clock_library() else 0

    def child(self) -> int | None:
        """A worker's process that works on a task, or else any of them."""
        busy = [pid for pid in self.ground.server.at_work() if psutil.pid_exists(pid)]
        return self.rng.choice(sorted(busy) or self._children() or [None])

    def _children(self) -> list[int]:
        found = []
        for worker in self.ground.workers:
            with suppress(psutil.NoSuchProcess):
                found += [child.pid for child in psutil.Process(worker.pid).children()]
        return sorted(found)


Fault = Callable[[Scene], None]


def kill_child(scene: Scene) -> None:
    """A process of a worker is killed; the worker starts another."""
    child = scene.child()
    if child is not None:
        with suppress(ProcessLookupError):
            os.kill(child, signal.SIGKILL)


def kill_worker(scene: Scene) -> None:
    """A machine loses power: a worker and its pool. Another one comes."""
    worker = scene.rng.choice(scene.ground.workers)
    kill_group(worker)
    scene.ground.replenish(scene.skew_s())


def kill_main(scene: Scene) -> None:
    """The main process of a worker alone; its pool is on its own. Another worker comes."""
    worker = scene.rng.choice(scene.ground.workers)
    worker.kill()
    worker.wait()
    scene.ground.replenish(scene.skew_s())


def kill_coordinator(scene: Scene) -> None:
    """The command is killed; who runs it again sees to it."""
    scene.command.kill()


def freeze_worker(scene: Scene) -> None:
    """A worker stands still past its lease, wakes, and goes on as if nothing had been."""
    worker = scene.rng.choice(scene.ground.workers)
    with suppress(ProcessLookupError):
        os.killpg(worker.pid, signal.SIGSTOP)
        time.sleep(PAST_LEASE_S)
        os.killpg(worker.pid, signal.SIGCONT)


def restart_server(scene: Scene) -> None:
    """The server loses power and comes back with its data."""
    scene.ground.server.stop()
    time.sleep(scene.rng.uniform(0, 1))
    scene.ground.server.start(with_data=True)


def lose_server(scene: Scene) -> None:
    """The server loses power and comes back with nothing."""
    scene.ground.server.stop()
    time.sleep(scene.rng.uniform(0, 1))
    scene.ground.server.start(with_data=False)


def freeze_server(scene: Scene) -> None:
    """The server stands still until all leases have lapsed."""
    scene.ground.server.freeze(frozen=True)
    time.sleep(PAST_LEASE_S)
    scene.ground.server.freeze(frozen=False)


def deliver_twice(scene: Scene) -> None:
    """Each task that waits is delivered twice."""
    scene.ground.server.deliver_twice()


def fill_disk(scene: Scene) -> None:
    """The disk is full until the command has ended, or has been at it for some seconds."""
    with filled(scene.ground.disk):
        until = time.monotonic() + 2 * LEASE_S
        while not scene.command.is_over and time.monotonic() < until:
            time.sleep(0.02)


@contextmanager
def filled(disk: Path) -> Iterator[None]:
    """Leave no room on a disk."""
    ballast = disk / "ballast"
    try:
        with suppress(OSError), ballast.open("wb", buffering=0) as stream:
            while True:
                stream.write(bytes(1 << 16))
        yield
    finally:
        ballast.unlink()


def slow_folder(scene: Scene) -> None:
    """From now on the shared folder is slow."""
    scene.ground.switches.make_slow()


FAULTS: dict[str, Fault] = {
    "kill child": kill_child,
    "kill worker": kill_worker,
    "kill main": kill_main,
    "kill coordinator": kill_coordinator,
    "freeze worker": freeze_worker,
    "restart server": restart_server,
    "lose server": lose_server,
    "freeze server": freeze_server,
    "deliver twice": deliver_twice,
    "fill disk": fill_disk,
    "slow folder": slow_folder,
}
