"""The same thing twice: files of equal bytes, cameras at one place looking one way."""

import hashlib
import os
from collections import defaultdict
from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence

import numpy as np

from contracts.places import store_errors
from contracts.records import PosedImage
from survey.doctor.findings import Finding, share, uris_of
from survey.doctor.track import Track
from survey.stored import open_place, state_of

_GLANCE_BYTES = 4_096
_READ_AT_MOST = 2_000_000_000
_CHUNK = 1 << 20
_DECIMALS = 6


def check_files_twice(images: Sequence[PosedImage]) -> Iterator[Finding]:
    """Files of equal size and sha256. Of those of one size, a few bytes of the middle are read
    first, and the rest only where these agree.
    """
    of_path: dict[str, str] = {}
    for image in images:
        of_path.setdefault(image.path, image.uri)
    alike = _split([list(of_path)], _size)
    alike = _split(alike, _glance)
    unread = sum((_size(group[0]) or 0) * len(group) for group in alike)
    if unread > _READ_AT_MOST:
        yield Finding(
            "duplicate-image",
            "note",
            f"whether {sum(map(len, alike)):,} files of equal size and alike in the middle are the "
            f"same was not looked at: {unread / 1e9:.0f} GB would have to be read",
        )
        return
    twins = [sorted(of_path[path] for path in group) for group in _split(alike, _digest)]
    if twins:
        extra = sum(len(group) - 1 for group in twins)
        yield Finding(
            "duplicate-image",
            "warning",
            f"{share(extra, len(of_path))} files are copies of another: the same bytes under "
            f"another name or pose ({' = '.join(min(twins)[:3])})",
            tuple(uri for group in sorted(twins) for uri in group),
            "remove the copies, or --exclude them",
        )


def check_poses_twice(track: Track) -> Iterator[Finding]:
    """Images of one camera with the same position and angles."""
    columns = (
        track.x_m, track.y_m, track.altitude_m, track.heading_deg, track.pitch_deg, track.roll_deg,
    )  # fmt: skip
    keys = np.round(np.column_stack([np.nan_to_num(each, nan=1e9) for each in columns]), _DECIMALS)
    keys = np.column_stack([keys, track.camera])
    _, inverse, counts = np.unique(keys, axis=0, return_inverse=True, return_counts=True)
    twice = np.flatnonzero(counts[inverse.ravel()] > 1)
    if not len(twice):
        return
    extra = len(twice) - int((counts > 1).sum())
    telling = np.isfinite(track.heading_deg[twice]).mean() > 0.5
    yield Finding(
        "duplicate-pose",
        "warning" if telling and extra > 0.01 * len(track) else "note",
        f"{share(extra, len(track))} images have exactly the position"
        + (" and angles" if telling else "")
        + " of another of the same camera or folder: copies, a vehicle that stood, a receiver "
        "without a new fix" + ("" if telling else ", or several cameras without names"),
        uris_of(track.images, twice),
        "--exclude them, if they are copies" if telling else "",
    )


def _split(groups: Iterable[list[str]], key: Callable[[str], Hashable | None]) -> list[list[str]]:
    """Finer groups by a key, without those of a single file or of files that cannot be read."""
    finer: list[list[str]] = []
    for group in groups:
        of_key: dict[Hashable, list[str]] = defaultdict(list)
        for path in group:
            found = key(path)
            if found is not None:
                of_key[found].append(path)
        finer += [members for members in of_key.values() if len(members) > 1]
    return finer


def _size(path: str) -> int | None:
    try:
        return state_of(path).size or None
    except OSError:
        return None


def _glance(path: str) -> bytes | None:
    try:
        with store_errors(path), open_place(path) as file:
            size = file.seek(0, os.SEEK_END)
            file.seek(max(0, size // 2 - _GLANCE_BYTES // 2))
            return file.read(_GLANCE_BYTES)
    except OSError:
        return None


def _digest(path: str) -> bytes | None:
    digest = hashlib.sha256()
    try:
        with store_errors(path), open_place(path) as file:
            while block := file.read(_CHUNK):
                digest.update(block)
    except OSError:
        return None
    return digest.digest()
