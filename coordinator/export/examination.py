"""The report of `flaneur doctor`: for people, for programs, as a folder of files."""

import json
from dataclasses import asdict
from pathlib import Path

from coordinator.export.files import write_whole
from coordinator.export.harmless import harmless
from survey.doctor import COST_MEASURED_ON, Examination, Figures, Finding

_MOST_CAMERAS, _MOST_NAMED = 8, 3


def as_dict(examination: Examination) -> dict[str, object]:
    """Everything, under keys that stay."""
    counts = _counts(examination)
    return {
        "survey": str(examination.path),
        "format": examination.format,
        "crs": examination.crs,
        **{f"{severity}s": count for severity, count in counts.items()},
        "figures": {**asdict(examination.figures), "cost_measured_on": COST_MEASURED_ON},
        "findings": [
            {
                "check": finding.check,
                "severity": finding.severity,
                "what": finding.what,
                "n_images": len(finding.uris),
                "examples": finding.examples,
                "mend": finding.mend,
            }
            for finding in examination.findings
        ],
    }


def as_text(examination: Examination) -> str:
    """Lines for a person: the survey in figures, then each finding, worst first."""
    lines = [_headline(examination), *_figures(examination.figures), ""]
    for finding in examination.findings:
        lines += [*_finding(finding), ""]
    counts = _counts(examination)
    lines.append(
        ", ".join(f"{count} {name}{'' if count == 1 else 's'}" for name, count in counts.items())
    )
    return "\n".join(map(harmless, lines))


def write_report(folder: Path, examination: Examination) -> None:
    """Write report.json, report.txt and, where there are positions, track.png.

    Raises
    ------
    WrongInput : the folder cannot be written.
    """
    report = json.dumps(as_dict(examination), ensure_ascii=False, allow_nan=False, indent=2)
    write_whole(folder / "report.json", (report + "\n").encode("utf-8", "backslashreplace"))
    text = as_text(examination) + "\n"
    write_whole(folder / "report.txt", text.encode("utf-8", "backslashreplace"))
    write_picture(folder / "track.png", examination)


def write_picture(file: Path, examination: Examination) -> bool:
    """Draw the track; False where there is none.

    Raises
    ------
    WrongInput : the file cannot be written.
    """
    from coordinator.export.track_map import draw_track

    track = examination.track
    if track is None:
        return False
    notes = [*filter(None, [_what_there_is(examination.figures), _extent(examination.figures)])]
    write_whole(file, draw_track(examination.path.name, track, _suspects(examination), notes))
    return True


def _suspects(examination: Examination) -> frozenset[str]:
    """Images that single them out; what concerns most of a survey marks none."""
    half = examination.figures.posed / 2.0
    return frozenset(
        uri
        for finding in examination.findings
        if finding.severity != "note" and len(finding.uris) <= half
        for uri in finding.uris
    )


def _counts(examination: Examination) -> dict[str, int]:
    severities = [finding.severity for finding in examination.findings]
    return {name: severities.count(name) for name in ("error", "warning", "note")}


def _headline(examination: Examination) -> str:
    crs = examination.crs or "no coordinate system"
    return f"{examination.path}: {examination.format}, {crs}"


def _figures(figures: Figures) -> list[str]:
    return [*filter(None, [_what_there_is(figures), _extent(figures), _cost(figures)])]


def _what_there_is(figures: Figures) -> str:
    cameras = ", ".join(filter(None, figures.cameras[:_MOST_CAMERAS]))
    more = len(figures.cameras) - _MOST_CAMERAS
    named = f" ({cameras}{f' and {more} more' if more > 0 else ''})" if cameras else ""
    return (
        f"{figures.images:,} images, {figures.posed:,} at a known position, {figures.skipped:,} "
        f"left out; {len(figures.cameras)} camera{'' if len(figures.cameras) == 1 else 's'}{named}"
    )


def _extent(figures: Figures) -> str:
    parts = []
    if figures.extent_m is not None:
        east, north = (_length(side) for side in figures.extent_m)
        parts.append(f"{east} east to west, {north} north to south")
    if figures.spacing_m is not None:
        parts.append(f"images {figures.spacing_m:.1f} m apart")
    if figures.first_day is not None and figures.days == 1:
        parts.append(f"on {figures.first_day}")
    elif figures.first_day is not None:
        parts.append(f"on {figures.days} days, {figures.first_day} to {figures.last_day}")
    return ", ".join(parts)


def _cost(figures: Figures) -> str:
    if not figures.images:
        return ""
    return (
        f"an index takes about {_hours(figures.core_hours)} of one core and "
        f"{_size(figures.index_bytes)}, going by {COST_MEASURED_ON}"
    )


def _finding(finding: Finding) -> list[str]:
    lines = [f"{finding.severity.upper():8}{finding.check}: {finding.what}"]
    if finding.examples:
        named = finding.examples[:_MOST_NAMED]
        more = len(finding.uris) - len(named)
        lines.append(f"        {', '.join(named)}{f' and {more:,} more' if more else ''}")
    if finding.mend:
        lines.append(f"        mend: {finding.mend}")
    return lines


def _length(metres: float) -> str:
    return f"{metres / 1000.0:,.1f} km" if metres >= 1000.0 else f"{metres:.0f} m"


def _hours(hours: float) -> str:
    return f"{hours:,.1f} h" if hours >= 1.5 else f"{max(1.0, hours * 60.0):.0f} min"


def _size(n_bytes: int) -> str:
    return f"{n_bytes / 1e9:,.1f} GB" if n_bytes >= 1e9 else f"{n_bytes / 1e6:.0f} MB"
