"""Answers a batch at a time, so that memory does not grow with their number."""

from collections.abc import Iterable, Iterator
from itertools import chain, islice

from coordinator.querying import Located

BATCH = 500


def in_batches(answers: Iterable[Located]) -> Iterator[list[Located]]:
    """Lists of up to `BATCH`; at least one, so that a file of no answers gets its columns."""
    rest = iter(answers)
    first = list(islice(rest, BATCH))
    return chain([first], iter(lambda: list(islice(rest, BATCH)), []))
