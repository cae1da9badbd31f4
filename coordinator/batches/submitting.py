"""Submitting: what a batch is to do is put into its folder."""

from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

from contracts.config import SearchConfig
from contracts.errors import BadConfig
from contracts.places import Place
from coordinator.batches.batch import BATCHES, BatchFolder, BatchPlan
from coordinator.batches.photos import Photo
from coordinator.batches.sources import lasting
from coordinator.export.geojson import provenance
from coordinator.querying import searched
from index.opened import OpenedIndex


def place_of_batches(index: Place, batches: Path | None) -> Path:
    """The folder of all batches: of the index, unless another one is named.

    Raises
    ------
    BadConfig : the index is in a store, and no folder is named.
    """
    if batches is not None:
        return batches.absolute()
    if isinstance(index, Path):
        return index.absolute() / BATCHES
    raise BadConfig(
        f"{index} is in a store, where no batch can be worked on. Name a folder for it that "
        "all workers see: --batches FOLDER"
    )


def submit(
    folder: BatchFolder,
    index: OpenedIndex,
    search: SearchConfig,
    priority: int,
    sources: Sequence[str],
    photos: Sequence[Photo],
) -> BatchPlan:
    """Put a batch into its folder, pinned to the generation that `index` has open.

    Raises
    ------
    BadConfig : the search means no image, or another process submitted such a batch meanwhile.
    """
    plan = BatchPlan(
        name=folder.name,
        made_at=datetime.now(UTC).isoformat(timespec="seconds"),
        generation=index.generation.number,
        generation_digest=index.generation.digest(),
        search=search,
        priority=priority,
        sources=lasting(sources),
        n_photos=len(photos),
        about={**provenance(index), "searched": searched(index, search.where)},
    )
    folder.write(plan, photos)
    return plan


def refuse_another(
    folder: BatchFolder,
    plan: BatchPlan,
    search: SearchConfig,
    priority: int,
    sources: Sequence[str],
) -> None:
    """The same command again goes on with a batch; another one does not change it.

    Raises
    ------
    BadConfig : the batch has other sources, another search or another priority.
    """
    asked = (
        ("sources", lasting(sources), plan.sources),
        ("options", search, plan.search),
        ("priority", priority, plan.priority),
    )
    for what, now, before in asked:
        if now != before:
            raise BadConfig(
                f"There is a batch {folder.name} of {plan.made_at} with other {what}. Give this "
                f"one another name, or delete {folder.path} if that one is no longer needed."
            )
