"""What an examination of a survey says."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

from contracts.records import PosedImage

Severity = Literal["error", "warning", "note"]
SEVERITIES: tuple[Severity, ...] = ("error", "warning", "note")

_EXAMPLES = 5


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that a person should know before the survey is used.

    check : a stable name. severity : "error" = refused, or placed wrongly; "warning" = likely to
    be wrong, look at it; "note" = good to know. what : one sentence with its evidence.
    uris : all images concerned, where they are single ones. mend : the option that mends it, "".
    """

    check: str
    severity: Severity
    what: str
    uris: tuple[str, ...] = ()
    mend: str = ""

    @property
    def examples(self) -> tuple[str, ...]:
        """The first few of `uris`."""
        return self.uris[:_EXAMPLES]


def uris_of(images: Sequence[PosedImage], indices: Iterable[int]) -> tuple[str, ...]:
    """The uris of some images, in their order."""
    return tuple(images[at].uri for at in indices)


def by_severity(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Errors first; within a severity as they were found."""
    return tuple(sorted(findings, key=lambda finding: SEVERITIES.index(finding.severity)))


def share(count: int, total: int) -> str:
    """A count and what it is of, such as `3 of 60 (5 %)`."""
    percent = 100.0 * count / total if total else 0.0
    shown = f"{percent:.0f}" if percent >= 1.0 or not count else f"{percent:.2g}"
    return f"{count:,} of {total:,} ({shown} %)"
