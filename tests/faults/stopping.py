"""Child processes that are stopped, or find the disk full, when they are about to write.

What changes the disk is heard of by an audit hook (opening for writing, renaming, removing, making
folders) and, for `os.fsync` and the stream that `os.fdopen` gives, by taking their place: all in
the child alone.
"""

import errno
import io
import itertools
import os
import shutil
import signal
import sys
import traceback
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

Hear = Callable[[str, str | None], None]
STOPPED = "stopped"
DONE = "done"
_TIMEOUT_S = 60
_CHANGES = ("os.rename", "os.remove", "os.mkdir", "os.rmdir", "os.link", "os.symlink")
_WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT


def run_in_child(work: Callable[[], object], timeout_s: int = _TIMEOUT_S) -> str:
    """Run in a forked process; `DONE`, `STOPPED`, or how it failed."""
    reading, writing = os.pipe()
    with warnings.catch_warnings():
        # Later Pythons warn of forking beside threads: these (Arrow's) wait for work.
        warnings.simplefilter("ignore", DeprecationWarning)
        child = os.fork()
    if child == 0:
        signal.alarm(timeout_s)
        try:
            work()
            told = DONE
        except BaseException:  # noqa: BLE001 - told to the parent
            told = traceback.format_exc()
        os.write(writing, told.encode()[-60_000:])
        os._exit(0)
    os.close(writing)
    with os.fdopen(reading, "rb") as stream:
        told = stream.read().decode()
    _, status = os.waitpid(child, 0)
    if os.WIFSIGNALED(status):
        return f"killed by {signal.Signals(os.WTERMSIG(status)).name}"
    return told or STOPPED


@dataclass(slots=True)
class Writes:
    """Hears of every write below `root`, when it is about to happen, until `hear` is None.

    hear : is given its kind and, where it is known, the file.
    """

    root: Path
    hear: Hear | None

    def install(self) -> None:
        """From now on, in this process, for good."""
        sys.addaudithook(self._audit)
        os.fdopen = self._open_heard
        os.fsync = lambda _descriptor: self._told("fsync", None)

    def write_half_heard(self, stream: io.BufferedWriter, content: object) -> int:
        """A write that is heard when half of it is on the disk."""
        data = memoryview(content).cast("B")
        half = len(data) // 2
        io.BufferedWriter.write(stream, data[:half])
        stream.flush()
        self._told("write", None)
        io.BufferedWriter.write(stream, data[half:])
        return len(data)

    def _told(self, kind: str, path: str | None) -> None:
        hear, self.hear = self.hear, None  # what is done on hearing of it is not heard
        try:
            if hear is not None:
                hear(kind, path)
        finally:
            self.hear = hear

    def _audit(self, event: str, arguments: tuple[object, ...]) -> None:
        if self.hear is None:
            return
        if event in _CHANGES:
            self._told_below(event, arguments[0], arguments[-1])
        elif event == "open" and isinstance(flags := arguments[2], int) and flags & _WRITING:
            self._told_below(event, arguments[0], -1)

    def _told_below(self, kind: str, path: object, folder_descriptor: object) -> None:
        named = os.fsdecode(path) if isinstance(path, str | bytes | os.PathLike) else ""
        if named.startswith(str(self.root)) or folder_descriptor != -1:
            self._told(kind, named)

    def _open_heard(self, descriptor: int, mode: str) -> io.BufferedIOBase:
        if "w" not in mode:
            return open(descriptor, mode)
        return _Heard(io.FileIO(descriptor, mode), self)


class _Heard(io.BufferedWriter):
    def __init__(self, raw: io.FileIO, writes: Writes) -> None:
        super().__init__(raw)
        self._writes = writes

    def write(self, content: object) -> int:
        return self._writes.write_half_heard(self, content)


def photographed(root: Path, shots: Path, work: Callable[[], object]) -> None:
    """Work in a child, and keep `root` as it is before every write: `shots`/000, /001 and so on."""

    def keep(kind: str, _path: str | None) -> None:
        if kind != "fsync":  # before and after it the files are the same
            shot = shots / f"{len(list(shots.iterdir())):03d}"
            shutil.copytree(root, shot, ignore=being_told)

    # A thread of its own writes it, and renames it at any moment.
    being_told = shutil.ignore_patterns(".progress.json.*")

    def watched() -> None:
        Writes(root, keep).install()
        work()

    shots.mkdir()
    assert (told := run_in_child(watched)) == DONE, told


def stopped_at(root: Path, number: int, work: Callable[[], object]) -> str:
    """Work in a child that ends, as by `kill -9`, before write `number`."""
    numbers = itertools.count()

    def end(kind: str, _path: str | None) -> None:
        if kind != "fsync" and next(numbers) == number:
            os._exit(0)

    def watched() -> None:
        Writes(root, end).install()
        work()

    return run_in_child(watched)


def full_from(first: int) -> Hear:
    """A disk that has no room from write `first` on; removing needs none."""
    numbers = itertools.count()

    def refuse(kind: str, path: str | None) -> None:
        if kind not in ("os.remove", "os.rmdir") and next(numbers) >= first:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), path)

    return refuse
