"""An index whose files hold anything: it is refused, or answers; the interpreter lives."""

import faulthandler
import hashlib
import json
import resource
import shutil
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from small_index import (
    CHANNEL,
    CONFIG,
    Silent,
    add_survey,
    index_survey,
    make_surveys,
    picture,
    read,
    remove_two,
)
from stopping import DONE, run_in_child

from contracts.config import SearchConfig, Where
from contracts.errors import BadIndex
from index.manifest import generation_path, live_number
from index.opened import OpenedIndex
from index.selecting import selected
from index.verifying import verify
from retrieval.features import extract
from retrieval.ways import fused_group
from workers.stages.retrieve import best_matches, detector_votes, sizes_of

SEED = 20
ROUNDS = 12
"""Damages tried of each file, each with its digest as it was and with that of the damaged file."""
MORE_MEMORY_MIB = 100
SEARCH = SearchConfig(pair=("hesaff",), k=2, descriptors=("sift",), vote="union")
SOUTH = Where(bbox=(2.3, 48.8, 2.4, 48.9), since="2020", heading=(90.0, 45.0))


@dataclass(frozen=True, slots=True)
class Fuzzed:
    """A small index, and descriptors of a photo that it is asked about."""

    root: Path
    descriptors: NDArray[np.uint8]


@pytest.fixture(scope="module")
def fuzzed(tmp_path_factory: pytest.TempPathFactory) -> Fuzzed:
    folder = tmp_path_factory.mktemp("fuzzed")
    survey, later = make_surveys(folder)
    root = folder / "index"
    index_survey(root, read(survey))
    add_survey(root, read(later, "later"))
    remove_two(root)
    return Fuzzed(root, extract(picture(2), None, CONFIG.features).descriptors[CHANNEL])


Answer = tuple[list[tuple[str, float]], list[int]]


def ask(root: Path, descriptors: NDArray[np.uint8]) -> Answer:
    """Open, search and select: what is found with its scores, and who is in the south."""
    index = OpenedIndex(root)
    words = {"hesaff": {CHANNEL: index.searcher(CHANNEL).nearest(descriptors, 2)}}
    votes = detector_votes(index, words, (2,), SEARCH)
    scores = fused_group(votes, ("hesaff",), 2, sizes_of(index, ("hesaff",), SEARCH))
    matches = best_matches(index, scores, SEARCH, 5)
    rows = index.catalogue.rows([match.image_id for match in matches])
    found = [(row.uri, match.score) for row, match in zip(rows, matches, strict=True)]
    return found, np.flatnonzero(selected(index, SOUTH)).tolist()


def damaged(data: bytes, rng: np.random.Generator) -> bytes:
    """Change a file somewhere, by preference in its first or last bytes."""
    near = {0: (0, 200), 1: (len(data) - 200, len(data))}.get(int(rng.integers(3)), (0, len(data)))
    at = int(np.clip(rng.integers(*near), 0, max(len(data) - 1, 0)))
    stop = at + int(rng.integers(1, 20))
    changes = {
        "flip": lambda: data[:at] + bytes([data[at] ^ 1 << int(rng.integers(8))]) + data[at + 1 :],
        "random": lambda: data[:at] + rng.bytes(min(stop, len(data)) - at) + data[stop:],
        "zero": lambda: data[:at] + bytes(min(stop, len(data)) - at) + data[stop:],
        "ones": lambda: data[:at] + b"\xff" * (min(stop, len(data)) - at) + data[stop:],
        "cut": lambda: data[:at],
        "leave out": lambda: data[:at] + data[stop:],
        "extend": lambda: data[:at] + rng.bytes(stop - at) + data[at:],
        "repeat": lambda: data + data[at:],
    }
    return changes[str(rng.choice(list(changes)))]()


def write_with_digest(root: Path, name: str, content: bytes) -> None:
    """Write a file, and say in the generation that this is what was written."""
    (root / name).write_bytes(content)
    path = generation_path(root, live_number(root))
    generation = json.loads(path.read_bytes())
    digest = hashlib.sha256(content).hexdigest()
    generation["files"][name] = {"sha256": digest, "size": len(content)}
    path.write_text(json.dumps(generation))


def cases(root: Path) -> Iterator[tuple[str, bytes, bool]]:
    """(file, content, whether its digest is made to fit) for every file of an index."""
    rng = np.random.default_rng(SEED)
    number = live_number(root)
    listed = list(json.loads(generation_path(root, number).read_bytes())["files"])
    for name in listed:
        whole = (root / name).read_bytes()
        for _ in range(ROUNDS):
            yield name, damaged(whole, rng), False
            yield name, damaged(whole, rng), True
    for name in ("CURRENT", generation_path(Path(), number).as_posix()):
        whole = (root / name).read_bytes()
        for _ in range(4 * ROUNDS):
            yield name, damaged(whole, rng), False


def examine(case: Path, fuzzed: Fuzzed, right: Answer) -> str:
    """Ask a damaged index; "refused", "right" or "wrong"."""
    try:
        return "right" if ask(case, fuzzed.descriptors) == right else "wrong"
    except BadIndex as error:
        named = str(case) in str(error) or "`flaneur verify` names the file" in str(error)
        return "refused" if named else f"refused without the name of a file: {error}"


def verified(case: Path) -> bool:
    """Whether `flaneur verify` would find everything as it should be."""
    try:
        return not verify(case, every=True, progress=Silent()).faults
    except BadIndex:
        return False


def attempt(case: Path, fuzzed: Fuzzed, right: Answer, told: str) -> tuple[str, bool]:
    """How a damaged index answers, and whether it is found to be sound."""
    try:
        return examine(case, fuzzed, right), verified(case)
    except Exception as error:
        raise AssertionError(f"{told}: {error!r}") from error


def test_an_index_of_damaged_files_is_refused_or_right_and_verify_knows(
    fuzzed: Fuzzed, tmp_path: Path
) -> None:
    right = ask(fuzzed.root, fuzzed.descriptors)
    assert len({score for _, score in right[0]}) > 1, "an answer that says nothing"
    case, log = tmp_path / "index", tmp_path / "log"
    shutil.copytree(fuzzed.root, case)
    generation = generation_path(Path(), live_number(case)).as_posix()
    outcomes: Counter[str] = Counter()

    def campaign() -> None:
        faulthandler.enable()
        used = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        for number, (name, content, fits) in enumerate(cases(fuzzed.root)):
            told = f"{name} ({number}, its digest {'fits' if fits else 'is as it was'})"
            log.write_text(told)  # a crash of the interpreter leaves only this
            if fits:
                write_with_digest(case, name, content)
            else:
                (case / name).write_bytes(content)
            outcome, sound = attempt(case, fuzzed, right, told)
            outcomes[outcome] += 1
            whole = (fuzzed.root / name).read_bytes()
            assert outcome in {"refused", "right", "wrong"}, f"{told}: {outcome}"
            if not fits:
                assert not (outcome == "wrong" and sound), f"{told}: wrong, unknown to verify"
                signed = content != whole and name not in {"CURRENT", generation}
                assert not (signed and sound), f"{told}: unknown to verify"
            (case / name).write_bytes(whole)
            shutil.copyfile(fuzzed.root / generation, case / generation)
        more = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - used
        assert more < MORE_MEMORY_MIB * 1024, f"{more} KiB more"
        assert outcomes["refused"] > outcomes["right"] > 0, outcomes

    assert run_in_child(campaign, timeout_s=300) == DONE, log.read_text()
