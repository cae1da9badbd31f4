"""What must be so after any fault: the index is that of an undisturbed run, and nothing is left."""

import json
from pathlib import Path

from proving_ground import Command, processes_of
from small_index import Contents, contents
from undisturbed import name_of

from coordinator.pruning import prune
from index.inventory import sizes_on_disk, unneeded
from index.jobs import SCRATCH
from index.manifest import read_generation


def assert_well(command: Command, expected: Contents, without: tuple[int, ...] = ()) -> None:
    """Wait for the command, and look at all that it and its workers leave.

    without : numbers of the images that are to be missing, and said to be.
    """
    root, session = command.root, command.started.process.pid
    assert command.ended() == (3 if without else 0), command.told()
    assert contents(root) == expected
    assert _skipped(root) == sorted(map(name_of, without))
    assert processes_of(session) == [], "processes of the command"
    command.ground.wait_for_rest()
    assert contents(root) == expected, "who was late changed the index"
    scratch = [path for name in SCRATCH for path in root.glob(f"jobs/*/{name}/**/*")]
    assert not scratch, "what only the job needed"
    prune(root)
    assert unneeded(sizes_on_disk(root), [read_generation(root)], ()) == {}


def _skipped(root: Path) -> list[str]:
    (told,) = root.glob("jobs/*/skipped.json")
    return sorted(row["uri"] for row in json.loads(told.read_text()))
