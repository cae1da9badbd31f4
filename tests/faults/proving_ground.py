"""A server, workers and a disk of our own, to which things are done; all of them are real."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

import psutil
from own_server import OwnServer
from switches import STAGES, Switches
from waiting import PATIENCE_S, wait_until

REPOSITORY = Path(__file__).parents[2]
INSIDE = Path(__file__).parent / "inside_processes"
FLANEUR = (sys.executable, "-m", "coordinator.cli")
LEASE_S = 2
N_WORKERS = 2
DISK_MB = 48
SKEW_S = 3600


@dataclass(slots=True)
class Ground:
    """Everything there is. disk : where indices lie. can_fill : it is small and ours alone."""

    folder: Path
    disk: Path
    can_fill: bool
    server: OwnServer
    switches: Switches
    workers: "list[subprocess.Popen[bytes]]" = field(default_factory=list)
    _skewed: set[int] = field(default_factory=set)
    _n_started: int = 0

    def replenish(self, skew_s: int = 0) -> None:
        """Start as many workers as are missing. skew_s : how far their clocks are off."""
        self.workers = [each for each in self.workers if each.poll() is None]
        while len(self.workers) < N_WORKERS:
            self.workers.append(self._start_worker(skew_s))

    def stop_workers(self) -> None:
        """Kill all."""
        for worker in self.workers:
            kill_group(worker)
        self.workers.clear()

    def wait_for_workers(self) -> None:
        """Until all that should be there listen."""
        wanted = {worker.pid for worker in self.workers}
        wait_until(lambda: wanted <= self.server.listening(), "the workers")

    def wait_for_rest(self) -> None:
        """Until nobody has anything to do, not even with what dead workers had taken.

        Raises
        ------
        AssertionError : there is always something.
        """
        server = self.server
        wait_until(lambda: not server.queued() and not server.at_work(), "idle workers")
        server.deliver_untold()
        wait_until(
            lambda: not (server.queued() or server.at_work() or server.untold()),
            "workers that are idle again",
        )

    def put_right(self) -> None:
        """Fresh workers where some are missing or have wrong clocks; an idle server."""
        self.switches.all_off()
        for worker in self.workers:
            if worker.pid in self._skewed:
                kill_group(worker)
        self._skewed.clear()
        self.replenish()
        self.wait_for_workers()

    def start(self, arguments: tuple[str, ...], skew_s: int = 0, switches: str = "") -> "Started":
        """A `flaneur` process in a session of its own. switches : the folder that it heeds."""
        self._n_started += 1
        log = self.folder / f"{self._n_started:04d}-{arguments[0]}.log"
        with log.open("wb") as stream:
            process = subprocess.Popen(
                [*FLANEUR, *arguments, "--broker", self.server.url],
                stdin=subprocess.DEVNULL,
                stdout=stream,
                stderr=stream,
                start_new_session=True,
                env={
                    **os.environ,
                    "PYTHONPATH": f"{INSIDE}{os.pathsep}{REPOSITORY}",
                    "FLANEUR_LEASE_S": str(LEASE_S),
                    "FLANEUR_TEST_FAULTS": switches,
                    **(_skewed_clock(skew_s) if skew_s else {}),
                },
            )
        return Started(process, log)

    def _start_worker(self, skew_s: int) -> "subprocess.Popen[bytes]":
        arguments = ("worker", "--processes", "1")
        process = self.start(arguments, skew_s, str(self.switches.folder)).process
        if skew_s:
            self._skewed.add(process.pid)
        return process


@dataclass(frozen=True, slots=True)
class Started:
    """A process, and the file of what it says."""

    process: "subprocess.Popen[bytes]"
    log: Path


@dataclass(slots=True)
class Command:
    """A `flaneur index` that can be run again and again."""

    ground: Ground
    arguments: tuple[str, ...]
    root: Path
    _running: Started | None = None

    def begin(self, skew_s: int = 0) -> None:
        """Run it. skew_s : how far the coordinator's clock is off."""
        self._running = self.ground.start(self.arguments, skew_s)

    @property
    def started(self) -> Started:
        assert self._running is not None, "it was not begun"
        return self._running

    @property
    def is_over(self) -> bool:
        return self.started.process.poll() is not None

    def ended(self) -> int:
        """Its exit code, once it has ended."""
        try:
            return self.started.process.wait(PATIENCE_S)
        except subprocess.TimeoutExpired:
            raise AssertionError(f"it does not end, and told:\n{self.told()}") from None

    def kill(self) -> None:
        """As `kill -9` does, and all that it started."""
        if self._running is not None:
            kill_group(self._running.process)

    def told(self) -> str:
        return self.started.log.read_text(errors="replace")

    def receipts(self, stage: str) -> set[str]:
        """Keys of the tasks of a stage that are done."""
        return {path.stem for path in self.root.glob(f"jobs/*/receipts/{stage}/[!.]*.json")}

    def n_done(self) -> int:
        """How many tasks are done."""
        return sum(len(self.receipts(stage)) for stage in STAGES)


def clock_library() -> Path | None:
    """Debian's libfaketime, where it is installed."""
    return next(iter(sorted(Path("/usr/lib").glob("*/faketime/libfaketime.so.1"))), None)


def _skewed_clock(skew_s: int) -> dict[str, str]:
    """The environment of a process whose clock is off, as that of another machine may be."""
    return {
        "LD_PRELOAD": str(clock_library()),
        "FAKETIME": f"{skew_s:+d}s",
        "FAKETIME_DONT_FAKE_MONOTONIC": "1",
        "NO_FAKE_STAT": "1",
    }


def kill_group(process: "subprocess.Popen[bytes]") -> None:
    """Kill a process and all of its group."""
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def processes_of(session: int) -> list[int]:
    """Living processes of a session: of a command, or of a worker and its pool."""
    found = []
    for process in psutil.process_iter():
        with suppress(ProcessLookupError, psutil.NoSuchProcess):
            if os.getsid(process.pid) == session and process.status() != psutil.STATUS_ZOMBIE:
                found.append(process.pid)
    return found


@contextmanager
def _small_disk(place: Path) -> Iterator[bool]:
    """Mount a file system in memory; gives False where that is not allowed."""
    place.mkdir()
    mounting = ["mount", "-t", "tmpfs", "-o", f"size={DISK_MB}m", "tmpfs", str(place)]
    try:
        mounted = subprocess.run(mounting, capture_output=True, check=False).returncode == 0
    except FileNotFoundError:
        mounted = False
    try:
        yield mounted
    finally:
        if mounted:
            subprocess.run(["umount", "--lazy", str(place)], check=True)


@contextmanager
def running_ground(folder: Path) -> Iterator[Ground]:
    """A server and workers that are there for many tests, and nothing left of them afterwards."""
    switches = Switches(folder / "switches")
    switches.make()
    with _small_disk(folder / "disk") as can_fill, OwnServer(folder / "server") as server:
        ground = Ground(folder, folder / "disk", can_fill, server, switches)
        try:
            yield ground
        finally:
            switches.all_off()
            ground.stop_workers()
