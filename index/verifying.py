"""Reading all of an index: every digest, and whether what is in the files makes sense.

What is in a file is looked at only if it is the file that was written.
"""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from contracts.errors import BadIndex
from contracts.progress import Progress
from index.checks import Check, checks_of
from index.codebooks import codebook_paths, codebooks_digest
from index.files import check_files, open_regular
from index.manifest import (
    FileEntry,
    Generation,
    generation_numbers,
    generation_path,
    live_number,
    read_generation,
)

_BLOCK = 1 << 20
_AGAIN = "Restore it or index again."


@dataclass(frozen=True, slots=True)
class Verdict:
    """What was found. generations, files, bytes : looked at; the latter two once each.

    faults : what is wrong, with file, found, expected and mend, and the generations that it makes
    unusable.
    """

    generations: tuple[int, ...]
    files: int
    bytes: int
    faults: dict[str, tuple[int, ...]]

    @property
    def sound(self) -> tuple[int, ...]:
        """The generations without a fault."""
        damaged = {number for numbers in self.faults.values() for number in numbers}
        return tuple(number for number in self.generations if number not in damaged)


def verify(root: Path, every: bool, progress: Progress) -> Verdict:
    """Read the live generation, or every one; memory does not grow with the index.

    Where CURRENT is damaged, every generation is read.

    Raises
    ------
    BadIndex : `root` is no index, or not finished.
    """
    faults = _Faults()
    numbers = _numbers(root, every, faults)
    generations = _readable(root, numbers, faults)
    files: dict[tuple[str, FileEntry], list[int]] = {}
    for generation in generations:
        for name, entry in generation.files.items():
            files.setdefault((name, entry), []).append(generation.number)
    changed = _changed(root, files, faults, progress)
    checks = _checks(root, generations, changed, faults)
    progress.begin("contents", len(checks), 0)
    for check, those in checks.values():
        try:
            check.run()
        except BadIndex as error:
            faults.add(str(error), those)
        progress.advance("contents")
    read = sum(entry.size for _, entry in files)
    return Verdict(numbers, len(files), read, faults.found)


class _Faults:
    """Collects what is wrong; told of several generations, it is one fault."""

    def __init__(self) -> None:
        self.found: dict[str, tuple[int, ...]] = {}

    def add(self, told: str, generations: Sequence[int]) -> None:
        self.found[told] = tuple(sorted({*self.found.get(told, ()), *generations}))


def _numbers(root: Path, every: bool, faults: _Faults) -> tuple[int, ...]:
    numbers = generation_numbers(root)
    try:
        live = live_number(root)
    except BadIndex as error:
        if not numbers:
            raise
        faults.add(str(error), ())
        return numbers
    return tuple(sorted({*numbers, live})) if every else (live,)


def _readable(root: Path, numbers: Sequence[int], faults: _Faults) -> list[Generation]:
    found = []
    for number in numbers:
        try:
            generation = read_generation(root, number)
        except BadIndex as error:
            faults.add(str(error), (number,))
            continue
        for told in _odd(root, generation):
            faults.add(told, (number,))
        found.append(generation)
    return found


def _odd(root: Path, generation: Generation) -> list[str]:
    """What does not agree within a generation's own file."""
    path = generation_path(root, generation.number)
    expected: list[tuple[str, object, object]] = [
        ("config_digest", generation.config_digest, generation.config.digest()),
    ]
    words = {}
    for channel in generation.config.features.channels():
        name = codebook_paths(Path(), generation.codebooks, channel)["words"].as_posix()
        if name in generation.files:
            words[channel] = generation.files[name].sha256
    expected.append(("codebooks_digest", generation.codebooks_digest, codebooks_digest(words)))
    return [
        f"{path}: {name} is {found}, expected {wanted}. {_AGAIN}"
        for name, found, wanted in expected
        if found != wanted
    ]


def _changed(
    root: Path,
    files: dict[tuple[str, FileEntry], list[int]],
    faults: _Faults,
    progress: Progress,
) -> set[str]:
    """The files that are not as they were written."""
    changed: set[str] = set()
    whole = []
    for (name, entry), numbers in files.items():
        try:
            check_files(root, {name: entry.size})
            whole.append((name, entry, numbers))
        except BadIndex as error:
            changed.add(name)
            faults.add(str(error), numbers)
    stage = "digests, MiB"
    progress.begin(stage, sum(-(-entry.size // _BLOCK) for _, entry, _ in whole), 0)
    for name, entry, numbers in whole:
        found = _sha256(root / name, stage, progress)
        if found != entry.sha256:
            changed.add(name)
            faults.add(
                f"{root / name} has the sha256 {found[:12]}…, expected {entry.sha256[:12]}…: "
                f"edited, or damaged on the disk. {_AGAIN}",
                numbers,
            )
    return changed


def _sha256(path: Path, stage: str, progress: Progress) -> str:
    digest = hashlib.sha256()
    try:
        with open_regular(path) as stream:
            while block := stream.read(_BLOCK):
                digest.update(block)
                progress.advance(stage)
    except OSError as error:
        return f"(unreadable: {error.strerror})"
    return digest.hexdigest()


def _checks(
    root: Path, generations: Sequence[Generation], changed: set[str], faults: _Faults
) -> dict[object, tuple[Check, list[int]]]:
    """What is to be looked at, once though several generations have it."""
    checks: dict[object, tuple[Check, list[int]]] = {}
    for generation in generations:
        for check in checks_of(root, generation):
            unnamed = sorted(set(check.files) - set(generation.files))
            if unnamed:
                path = generation_path(root, generation.number)
                faults.add(f"{path} does not name {unnamed[0]}. {_AGAIN}", (generation.number,))
            elif not changed.intersection(check.files):
                checks.setdefault(check.key, (check, []))[1].append(generation.number)
    return checks
