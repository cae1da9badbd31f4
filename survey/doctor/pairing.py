"""Images without a pose, poses without an image, and whatever else the reader left out."""

import re
from collections import defaultdict
from collections.abc import Iterator, Sequence

from contracts.records import PosedImage, Skipped
from survey.doctor.findings import Finding, share

_ROW = re.compile(r"^row \d+: ")
_NUMBER = re.compile(r"[-+]?\d+(?:[.,]\d+)*(?:e[-+]?\d+)?", re.IGNORECASE)
_QUOTED = re.compile(r"'[^']*'|\"[^\"]*\"")
_MOST_REASONS = 12

_KNOWN = (
    ("names it", "image-without-pose", "add their rows, or --exclude them"),
    (
        "apart, more than",
        "image-without-pose",
        "--max-gap with more seconds, if the vehicle went evenly; or --exclude them",
    ),
    ("image without pose", "image-without-pose", "--exclude them, or give them a pose"),
    ("no GPS position", "image-without-pose", "add a pose table, or --exclude them"),
    ("pose without image", "pose-without-image", "check the folder and the column of file names"),
    ("no image of panorama", "pose-without-image", ""),
    ("what cameras write without a fix", "null-island", "--exclude them"),
    (
        "pitch is",
        "pitch-zero",
        '--mapping with [angles] pitch_zero = "nadir", if 90 is the horizon',
    ),
    (
        "are they swapped, or metres",
        "swapped-axes",
        "--mapping with x and y exchanged in [columns], or --crs",
    ),
    ("the same image as row", "duplicate-row", "remove one of the rows"),
)
"""Words of a reason, the check they belong to, and what mends it."""


def check_skipped(
    images: Sequence[PosedImage], skipped: Sequence[Skipped], no_pose: bool
) -> Iterator[Finding]:
    """One finding for each reason, however many images share it."""
    of_reason: dict[str, list[Skipped]] = defaultdict(list)
    for skip in skipped:
        of_reason[_pattern(skip.reason)].append(skip)
    total = len(images) + len(skipped)
    groups = sorted(of_reason.values(), key=lambda group: (-len(group), group[0].uri))
    for group in groups[:_MOST_REASONS]:
        check, mend = _kind(group[0].reason)
        yield Finding(
            check,
            "warning",
            f"{share(len(group), total)} left out: {_ROW.sub('', group[0].reason)}"
            + (" (the first; others alike)" if len(group) > 1 else ""),
            tuple(skip.uri for skip in group),
            mend,
        )
    if len(groups) > _MOST_REASONS:
        rest = [skip.uri for group in groups[_MOST_REASONS:] for skip in group]
        yield Finding(
            "left-out", "warning", f"{len(rest):,} more left out for other reasons", tuple(rest)
        )
    if not no_pose:
        bare = tuple(image.uri for image in images if image.pose is None)
        if bare:
            yield Finding(
                "image-without-pose",
                "warning",
                f"{share(len(bare), total)} images are read without a pose",
                bare,
            )


def _pattern(reason: str) -> str:
    """The reason without what differs from image to image."""
    return _NUMBER.sub("#", _QUOTED.sub("'…'", _ROW.sub("", reason)))


def _kind(reason: str) -> tuple[str, str]:
    for words, check, mend in _KNOWN:
        if words in reason:
            return check, mend
    return "left-out", ""
