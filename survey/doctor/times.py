"""Times of capture: missing, impossible, running backwards, with gaps."""

from collections.abc import Iterator, Sequence
from datetime import UTC, datetime

import numpy as np

from contracts.records import PosedImage
from survey.doctor.findings import Finding, share, uris_of
from survey.doctor.track import Indices, Track, seconds

_FIRST_DIGITAL = datetime(1990, 1, 1, tzinfo=UTC)
"""Clocks that lost their battery begin at 1970 or 1980."""
_TOLERANCE_S = 86_400.0
_GAP_S = 60.0
_GAP_OVER_STEP = 20.0
_HOLE_M = 100.0
_RARE = 0.05


def check_times(images: Sequence[PosedImage], now: datetime) -> Iterator[Finding]:
    """Of all images, with a pose or without."""
    times = np.array([seconds(image) for image in images])
    missing = np.flatnonzero(np.isnan(times))
    if len(missing) == len(images):
        yield Finding(
            "time",
            "note",
            f"none of {len(images):,} images has a time with a zone: their order is that of "
            "names, and speeds, gaps and clocks were not checked",
            mend="times with a zone (ISO 8601, EXIF offset), or --mapping with [time] zone",
        )
        return
    if len(missing):
        yield Finding(
            "time",
            "warning",
            f"{share(len(missing), len(images))} images have no time, or one without a zone",
            uris_of(images, missing),
            "--mapping with [time] zone",
        )
    late = np.flatnonzero(times > now.timestamp() + _TOLERANCE_S)
    early = np.flatnonzero(times < _FIRST_DIGITAL.timestamp())
    for wrong, what in ((late, "in the future"), (early, "before 1990, as of a clock never set")):
        if len(wrong):
            yield Finding(
                "time-impossible",
                "warning",
                f"{share(len(wrong), len(images))} images were taken {what}; the first on "
                f"{day(times[wrong[0]])}",
                uris_of(images, wrong),
                "correct the times in the table or in EXIF",
            )


def check_clock(track: Track) -> Iterator[Finding]:
    """Names that go on while the clock goes back; times of one camera that repeat; gaps."""
    yield from _backwards(track)
    yield from _repeated(track)
    yield from _gaps(track)


def day(time_s: float) -> str:
    """The date in UTC."""
    return datetime.fromtimestamp(time_s, UTC).date().isoformat()


def _backwards(track: Track) -> Iterator[Finding]:
    """Within what one camera wrote into one folder, in the order of names."""
    groups: dict[tuple[int, str], list[int]] = {}
    for at, image in enumerate(track.images):
        groups.setdefault((int(track.camera[at]), image.uri.rpartition("/")[0]), []).append(at)
    back: list[int] = []
    steps, worst_s = 0, 0.0
    for members in groups.values():
        gaps = np.diff(track.time_s[members])
        steps += int(np.isfinite(gaps).sum())
        falls = np.flatnonzero(gaps < 0.0)
        back += [members[at + 1] for at in falls]
        worst_s = max(worst_s, -float(gaps[falls].min())) if len(falls) else worst_s
    if back and len(back) <= _RARE * steps:  # more: names are not in order of time at all
        yield Finding(
            "clock-backwards",
            "warning",
            f"the clock goes back at {len(back):,} of {steps:,} steps from name to name, by "
            f"{worst_s:,.0f} s at most",
            uris_of(track.images, sorted(back)),
            "correct the times, or name the cameras apart if several share a folder",
        )


def _repeated(track: Track) -> Iterator[Finding]:
    same = track.time_s[track.order][1:] == track.time_s[track.order][:-1]
    same &= track.camera[track.order][1:] == track.camera[track.order][:-1]
    if not same.any():
        return
    pairs = np.unique(np.concatenate([track.order[1:][same], track.order[:-1][same]]))
    named = any(track.images[at].camera.name for at in pairs)
    yield Finding(
        "duplicate-time",
        "warning" if named else "note",
        f"{share(len(pairs), len(track))} images share their time with another of the same "
        + (
            "camera"
            if named
            else "kind of name; cameras have none, so this may be a rig of several"
        ),
        uris_of(track.images, pairs),
        "remove the doubles" if named else "a camera column, or --mapping with camera in [columns]",
    )


def _gaps(track: Track) -> Iterator[Finding]:
    """Pauses, and how far the camera was moved meanwhile."""
    at = np.flatnonzero(track.previous >= 0)
    before = track.previous[at]
    gap_s = track.time_s[at] - track.time_s[before]
    moving = gap_s[np.isfinite(gap_s) & (gap_s > 0.0)]
    if not len(moving):
        return
    pause_s = max(_GAP_S, _GAP_OVER_STEP * float(np.median(moving)))
    long = gap_s > pause_s
    metres = np.hypot(track.x_m[at] - track.x_m[before], track.y_m[at] - track.y_m[before])
    if long.any():
        yield Finding(
            "time-gap",
            "note",
            f"{_most_of_a_camera(track, at[long]):,} pauses of more than {pause_s:.0f} s, the "
            f"longest {_duration(float(gap_s[long].max()))}; over "
            f"{_most_of_a_camera(track, at[long & (metres > _HOLE_M)]):,} of them the camera moved "
            f"more than {_HOLE_M:.0f} m without an image",
            uris_of(track.images, at[long]),
        )


def _most_of_a_camera(track: Track, images: Indices) -> int:
    """The cameras of a rig pause together: that counts once."""
    return int(np.bincount(track.camera[images], minlength=1).max())


def _duration(time_s: float) -> str:
    for unit, size in (("days", 86_400.0), ("hours", 3_600.0), ("minutes", 60.0)):
        if time_s >= 2.0 * size:
            return f"{time_s / size:.0f} {unit}"
    return f"{time_s:.0f} s"
