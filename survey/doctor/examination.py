"""Examine a survey before any work: all checks, in one order."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from datetime import datetime

from contracts.places import Place, place_of
from survey.doctor.angles import check_angles
from survey.doctor.conversion import check_conversion
from survey.doctor.duplicates import check_files_twice, check_poses_twice
from survey.doctor.figures import Figures, figures_of
from survey.doctor.findings import Finding, by_severity
from survey.doctor.headings import check_headings
from survey.doctor.heights import check_heights
from survey.doctor.norths import check_norths
from survey.doctor.opening import Opened, open_survey
from survey.doctor.pairing import check_skipped
from survey.doctor.pictures import check_pictures
from survey.doctor.positions import check_positions, check_spacing
from survey.doctor.systems import LOCAL_FRAME, check_system
from survey.doctor.times import check_clock, check_times
from survey.doctor.track import Track, track_of
from survey.doctor.vehicle import check_vehicle
from survey.options import ReadOptions

CHECKS_OF_TRACK = (
    check_conversion,
    check_positions,
    check_headings,
    check_norths,
    check_angles,
    check_clock,
    check_poses_twice,
    check_spacing,
    check_vehicle,
)


@dataclass(frozen=True, slots=True)
class Examination:
    """All that was found, worst first. track : None where no position can be true."""

    path: Place
    format: str
    crs: str | None
    figures: Figures
    findings: tuple[Finding, ...]
    track: Track | None


def examine(path: Place, options: ReadOptions, now: datetime) -> Examination:
    """Check a survey; nothing is written, and images are only sampled.

    The order of the images does not matter. now : with a zone; later images cannot be.

    Raises
    ------
    BadSurvey : nothing is there, or no reader knows it. BadConfig : `options.format` names no
        reader. UnknownCrs : `options.crs` is no coordinate system.
    """
    path = place_of(str(path))
    opened = open_survey(path, options)
    inside, findings = check_system(opened)
    track = None
    if inside and opened.crs:
        track = track_of(inside, opened.crs, options.allow_ballpark)
    findings = [*_without_contrary_advice(opened.findings, findings), *findings]
    findings += check_skipped(opened.images, opened.skipped, options.no_pose)
    if opened.images:
        findings += check_times(opened.images, now)
        findings += check_pictures(opened.images)
        findings += check_files_twice(opened.images)
    findings += _of_track(track, opened, options)
    return Examination(
        path=path,
        format=opened.format,
        crs=opened.crs,
        figures=figures_of(opened.images, len(opened.skipped), track),
        findings=by_severity(findings),
        track=track,
    )


def _without_contrary_advice(
    refusals: Iterable[Finding], findings: Iterable[Finding]
) -> Iterator[Finding]:
    """No --crs mends metres from an origin of their own."""
    local = any(finding.check == LOCAL_FRAME for finding in findings)
    for refusal in refusals:
        yield replace(refusal, mend="") if local else refusal


def _of_track(track: Track | None, opened: Opened, options: ReadOptions) -> Iterator[Finding]:
    if track is None:
        if opened.images and not options.no_pose:
            yield Finding(
                "not-checked",
                "note",
                "positions, headings, heights and the vehicle were not checked: mend the "
                "positions first",
            )
        return
    for check in CHECKS_OF_TRACK:
        yield from check(track)
    yield from check_heights(track, opened.format)
