"""Which files of a folder are one drive.

Recorders cut a drive into several files, by size or by topic; a folder may also hold several
drives, whose positions must not be mixed.
"""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import PurePosixPath
from typing import TypeVar

from survey.mcap.recording import Recording
from survey.mcap.tracks import Samples

Key = TypeVar("Key")
_CHANGE_OF_FILES_NS = 1_000_000_000


def drives(recordings: Mapping[str, Recording]) -> list[Recording]:
    """Files of one folder are one drive, unless two of them have positions or poses of the same
    topic at the same time, for longer than a recorder's change of files may take: then each is a
    drive of its own.

    recordings : local name of the file -> what it holds.
    """
    folders: dict[PurePosixPath, list[str]] = defaultdict(list)
    for name in sorted(recordings):
        folders[PurePosixPath(name).parent].append(name)
    found = []
    for names in folders.values():
        files = [recordings[name] for name in names]
        apart = _overlap(files)
        found += files if apart else [_joined(files)]
        if apart:
            files[0].notes.append(
                f"{', '.join(names[:5])}{', ...' if len(names) > 5 else ''} have positions of the "
                "same times and topics: each is taken for a drive of its own"
            )
    return found


def _overlap(files: Sequence[Recording]) -> bool:
    spans: dict[object, list[tuple[int, int]]] = defaultdict(list)
    for file in files:
        for source, samples in (*file.fixes.items(), *file.poses.items()):
            spans[source].append((min(samples.times_ns), max(samples.times_ns)))
    return any(
        earlier[1] - later[0] > _CHANGE_OF_FILES_NS
        for several in spans.values()
        for earlier, later in zip(sorted(several), sorted(several)[1:], strict=False)
    )


def _joined(files: Sequence[Recording]) -> Recording:
    drive = Recording()
    for file in files:
        for camera, images in file.images.items():
            drive.images.setdefault(camera, []).extend(images)
        _extend(drive.fixes, file.fixes)
        _extend(drive.poses, file.poses)
        _extend(drive.transforms, file.transforms)
        drive.fixed |= file.fixed
        drive.calibrations = {**file.calibrations, **drive.calibrations}
        drive.skipped += file.skipped
        drive.notes += file.notes
        drive.topics |= file.topics
    return drive


def _extend(into: dict[Key, Samples], more: Mapping[Key, Samples]) -> None:
    for key, samples in more.items():
        into.setdefault(key, Samples(samples.n_columns)).extend(samples)
