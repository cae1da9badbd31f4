"""What lies in an index's folder, and what of it nobody needs any more."""

import os
import stat
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from index.jobs import SCRATCH, JobPlan
from index.manifest import Generation, generation_path

_OURS = (
    "generations/",
    "catalogue/",
    "codebooks/",
    "segments/",
    "tombstones/",
    "jobs/",
    ".CURRENT.",
)


def sizes_on_disk(root: Path) -> dict[str, int]:
    """Bytes of every file below `root`, by name relative to it; links are not followed.

    Files that come and go meanwhile are left out.
    """
    return dict(_sizes(root))


def unneeded(
    sizes: Mapping[str, int], generations: Sequence[Generation], at_work: Sequence[JobPlan]
) -> dict[str, int]:
    """The files that none of these generations needs, and no job that is worked on; with bytes.

    What is none of an index's files is not meant, nor are plans and receipts of the jobs that
    made the generations' segments. sizes : as `sizes_on_disk` gives them.
    """
    named = {name for each in generations for name in each.files}
    named |= {generation_path(Path(), each.number).as_posix() for each in generations}
    segments = [segment for each in generations for segment in each.segments]
    recorded = tuple({f"jobs/{job}/" for segment in segments for job in segment.jobs})
    scratch = tuple(f"{folder}{name}/" for folder in recorded for name in SCRATCH)
    begun = tuple(_folders_of(at_work))
    return {
        name: size
        for name, size in sizes.items()
        if name.startswith(_OURS)
        and name not in named
        and not name.startswith(begun)
        and (not name.startswith(recorded) or name.startswith(scratch))
    }


def _folders_of(unfinished: Sequence[JobPlan]) -> Iterator[str]:
    for plan in unfinished:
        yield f"jobs/{plan.job}/"
        yield f"segments/{plan.segment}/"
        yield f"codebooks/{plan.codebooks}/"
        yield f"catalogue/{plan.segment}."


def _sizes(root: Path) -> Iterator[tuple[str, int]]:
    for path, _, names in os.walk(root):
        for name in names:
            file = Path(path, name)
            try:
                found = file.lstat()
            except FileNotFoundError:  # renamed or removed meanwhile
                continue
            if stat.S_ISREG(found.st_mode):
                yield file.relative_to(root).as_posix(), found.st_size
