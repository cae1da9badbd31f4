"""Reasons that differ by names and numbers only are one reason, counted."""

import json
import re
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass

from contracts.records import Skipped
from index.files import read_text_file
from index.jobs import JobFolder

_PARTICULARS = re.compile(
    r"'[^']*'|\"[^\"]*\""  # quoted
    r"|(?:[a-z0-9]+:/)?/\S*[^\s,.;:)\]]"  # a path or an address
    r"|0x[0-9a-f]+|\d+(?:[.,]\d+)*",
    re.IGNORECASE,
)


@dataclass(frozen=True, slots=True)
class Reason:
    """Why images were skipped. reason : with … for what differs. example : a uri, and all of its
    reason."""

    reason: str
    images: int
    example: str


def grouped(skipped: Iterable[Skipped]) -> tuple[Reason, ...]:
    """Count images by reason, the most frequent first."""
    counts: Counter[str] = Counter()
    examples: dict[str, str] = {}
    for each in skipped:
        reason = _PARTICULARS.sub("…", each.reason)
        counts[reason] += 1
        examples.setdefault(reason, f"{each.uri}: {each.reason}")
    ranked = sorted(counts.items(), key=lambda item: (-item[1], item[0]))
    return tuple(Reason(reason, number, examples[reason]) for reason, number in ranked)


def skipped_by(job: JobFolder, shards: Iterable[str]) -> Iterable[Skipped]:
    """What a job skipped: the whole list once it is written, before that what receipts tell.

    shards : keys of those that skipped anything; a large job has many more.
    """
    try:
        rows = json.loads(read_text_file(job.path / "skipped.json"))
        return [Skipped(str(row["uri"]), str(row["reason"])) for row in rows]
    except (OSError, ValueError, KeyError, TypeError):
        receipts = (job.read_receipt("extract", key) for key in sorted(set(shards)))
        return (skipped for receipt in receipts if receipt for skipped in receipt.skipped)
