"""A forecast as tables and sentences for a person, and as one object for a machine."""

from collections import Counter
from collections.abc import Callable
from dataclasses import asdict

from coordinator.forecast import costs
from coordinator.forecast.foreseeing import Forecast
from coordinator.forecast.ranges import Range
from coordinator.forecast.stages import Stage

Table = tuple[tuple[str, ...], list[tuple[str, ...]]]
"""Headings and rows."""

_NAMES = {
    "words": "visual words",
    "searches": "their search structures",
    "postings": "postings",
    "tables": "places and counts of words",
    "catalogue": "catalogue",
}
_MUCH_WAITING = 0.2


def as_dict(forecast: Forecast) -> dict[str, object]:
    """Everything; seconds and bytes, ranges as low, likely, high."""
    storage = forecast.storage
    return {
        "images": forecast.n_images,
        "sampled": forecast.n_sampled,
        "shards": forecast.n_shards,
        "shard_size": forecast.shard_size,
        "skipped": [asdict(each) for each in forecast.skipped],
        "unreadable": None if forecast.unreadable is None else asdict(forecast.unreadable),
        "waiting": forecast.waiting,
        "slowness": forecast.slowness,
        "seconds_an_image": asdict(forecast.seconds_an_image),
        "frames_an_image": {name: asdict(each) for name, each in forecast.frames.items()},
        "channels": {
            channel.name: {
                "descriptors": asdict(channel.points),
                "words": channel.n_words,
                "postings": asdict(channel.postings),
            }
            for channel in forecast.channels
        },
        "stages": {stage.name: _stage(stage) for stage in forecast.stages},
        "core_s": asdict(forecast.core_s),
        "wall_s": {str(number): asdict(each) for number, each in forecast.walls.items()},
        "messages": forecast.n_messages,
        "scratch_bytes": asdict(storage.scratch),
        "folder_bytes": asdict(storage.at_most),
        "index_bytes": {
            **{name: asdict(getattr(storage, name)) for name in _NAMES},
            "all": asdict(storage.index),
        },
    }


def _stage(stage: Stage) -> dict[str, object]:
    return {
        "tasks": stage.n_tasks,
        "core_s": asdict(stage.core_s),
        "worker_bytes": stage.private_bytes,
        "shared_bytes": stage.shared_bytes,
    }


def opening(forecast: Forecast) -> list[str]:
    """What was sampled, and what it says of the survey."""
    frames = ", ".join(f"{name} {each.likely:,.0f}" for name, each in forecast.frames.items())
    words = Counter(channel.n_words for channel in forecast.channels)
    sizes = ", ".join(
        f"{number:,} ({count} channel{'s' if count > 1 else ''})"
        for number, count in sorted(words.items(), reverse=True)
    )
    each = ranged(forecast.seconds_an_image, seconds)
    lines = [
        f"{forecast.n_images:,} images; {forecast.n_sampled} sampled, {each} an image on one core",
        f"Shards: {forecast.n_shards:,} of {forecast.shard_size} images",
        f"Frames an image: {frames}",
        f"Words: {sizes}",
    ]
    if forecast.waiting > _MUCH_WAITING:
        lines.append(
            f"The sample waited {forecast.waiting:.0%} of its time for the disk or for a core "
            "that other programs used. The times below are of a machine that does nothing else."
        )
    if forecast.unreadable is not None:
        lines.append(
            f"{len(forecast.skipped)} of the {forecast.n_sampled} sampled cannot be read: expect "
            f"{ranged(forecast.unreadable, '{:,.0f}'.format)} images to be skipped"
        )
    return lines


def time_table(forecast: Forecast) -> Table:
    """Core time of each stage, and how long so many workers take."""
    workers = tuple(f"{number:,} worker{'s' if number > 1 else ''}" for number in forecast.walls)
    rows = [
        (
            stage.name,
            f"{stage.n_tasks:,}",
            duration(stage.core_s.likely),
            *(duration(stage.wall_s(number).likely) for number in forecast.walls),
        )
        for stage in forecast.stages
    ]
    whole = ("whole job", f"{forecast.n_messages:,}", duration(forecast.core_s.likely))
    between = ("between", "", _between(forecast.core_s))
    rows.append((*whole, *(duration(wall.likely) for wall in forecast.walls.values())))
    rows.append((*between, *map(_between, forecast.walls.values())))
    return ("stage", "tasks", "of one core", *workers), rows


def memory_table(forecast: Forecast) -> Table:
    """What a worker process holds in each stage."""
    rows: list[tuple[str, ...]] = [
        (
            stage.name,
            *(
                "not known here" if held is None else size(held)
                for held in (stage.private_bytes, stage.shared_bytes)
            ),
        )
        for stage in forecast.stages
    ]
    return ("memory", "each worker process", "and all of a machine together"), rows


def disk_table(forecast: Forecast) -> Table:
    """What the index takes, and what the work needs beside it."""
    storage = forecast.storage
    parts = [(told, getattr(storage, name)) for name, told in _NAMES.items()]
    parts.append(("finished index", storage.index))
    parts.append(("lists and receipts of the job", storage.lists))
    parts.append(("room needed while it is made", storage.at_most))
    rows: list[tuple[str, ...]] = [
        (told, size(each.likely), f"{size(each.low)} - {size(each.high)}") for told, each in parts
    ]
    return ("disk", "bytes", "between"), rows


def closing() -> str:
    """How far the figures can be trusted."""
    return (
        "Times are of this machine: seconds of extraction and frames from the sample, give or "
        "take two standard errors; the other stages by a model, give or take a factor of "
        f"{costs.MODELLED_S_WITHIN:g}. Workers that share a disk or memory slow each other down; "
        "an image larger than those sampled takes more memory."
    )


def ranged(value: Range, told: Callable[[float], str]) -> str:
    """`1.02 s (0.95 s to 1.10 s)`."""
    return f"{told(value.likely)} ({told(value.low)} to {told(value.high)})"


def _between(value: Range) -> str:
    return f"{duration(value.low)} - {duration(value.high)}"


def seconds(value: float) -> str:
    """`1.02 s`."""
    return f"{value:.2f} s"


def duration(value_s: float) -> str:
    """`48 s`, `12 min`, `3.4 h` or `5.2 days`."""
    if value_s < 10:
        return f"{value_s:.1f} s"
    if value_s < 90:
        return f"{value_s:.0f} s"
    if value_s < 90 * 60:
        return f"{value_s / 60:.0f} min"
    if value_s < 48 * 3600:
        return f"{value_s / 3600:.1f} h"
    return f"{value_s / 86400:,.1f} days"


def size(n_bytes: float) -> str:
    """`12 MB`, `3.4 GB` or `1.2 TB`; decimal."""
    for unit, factor in (("TB", 1e12), ("GB", 1e9)):
        if n_bytes >= factor:
            return f"{n_bytes / factor:,.1f} {unit}"
    return f"{n_bytes / 1e6:,.1f} MB"
