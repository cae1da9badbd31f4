"""Indexing: extract, train, assign and merge, then one commit. Run again, it goes on."""

import time
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Protocol

import numpy as np

from contracts.errors import BadSurvey
from contracts.records import Receipt, Skipped
from coordinator.engine import Engine
from coordinator.follow import Follower, Order
from coordinator.plan import Intake
from geo.crs import area_of
from index.catalogue import CatalogueRow, catalogue_row, write_catalogue
from index.jobs import JobFolder, JobPlan
from index.manifest import FileEntry, Generation, SurveyEntry, commit, live_generation

STAGES = ("extract", "train", "assign", "merge")


class Progress(Protocol):
    """What shows how far a stage is."""

    def begin(self, stage: str, total: int, done: int) -> None: ...
    def advance(self, stage: str) -> None: ...


@dataclass(frozen=True, slots=True)
class IndexReport:
    """What an index run did. images_extracted : in this run; 0 where all was there already."""

    generation: Generation
    skipped: tuple[Skipped, ...]
    without_frames: int
    images_extracted: int
    bytes_on_disk: int
    seconds: float
    warnings: tuple[str, ...]


def find_finished(root: Path, job: JobFolder) -> Generation | None:
    """The live generation, if it is this job's."""
    if not (root / "CURRENT").is_file():
        return None
    generation = live_generation(root)
    return generation if generation.job == job.job else None


def run_job(
    job: JobFolder,
    plan: JobPlan,
    intake: Intake,
    engine: AbstractContextManager[Engine],
    progress: Progress,
) -> IndexReport:
    """Do what is missing of a job and commit it; a finished job is only reported.

    engine : entered only if there is work.
    """
    started = time.perf_counter()
    generation = find_finished(job.root, job)
    extracted = 0
    if generation is None:
        with engine as running:
            extracted = _run_stages(job, plan, running.follower, progress)
        generation = _commit(job, plan, intake)
        job.drop_scratch()
    receipts = _extract_receipts(job, plan)
    return IndexReport(
        generation=generation,
        skipped=_all_skipped(intake, receipts),
        without_frames=sum(receipt.counts["without_frames"] for receipt in receipts),
        images_extracted=extracted,
        bytes_on_disk=sum(entry.size for entry in generation.files.values()),
        seconds=time.perf_counter() - started,
        warnings=_warnings(receipts),
    )


def _run_stages(job: JobFolder, plan: JobPlan, follower: Follower, progress: Progress) -> int:
    channels = plan.config.features.channels()
    shards = range(plan.n_shards)
    where = {"index": str(job.root), "job": job.job}

    untrained = [name for name in channels if not job.valid_receipt("train", name)]
    unassigned = [n for n in shards if untrained or not job.valid_receipt("assign", f"{n:06d}")]
    # The features of an assigned shard are gone; they are needed again only to train.
    needed = list(shards) if untrained else unassigned
    missing = [n for n in needed if not job.valid_receipt("extract", f"{n:06d}")]

    def run(stage: str, total: int, orders: list[Order]) -> Iterator[Order]:
        progress.begin(stage, total, total - len(orders))
        for order, _ in follower.results(orders):
            progress.advance(stage)
            yield order

    extracts = [Order("extract", f"{n:06d}", {**where, "shard": n}) for n in missing]
    _drain(run("extract", len(shards), extracts))
    trains = [Order("train", name, {**where, "channel": name}) for name in untrained]
    n_images = sum(_n_indexed(job, shard) for shard in shards)
    if n_images == 0:
        raise BadSurvey(
            f"Not one of the {plan.n_images} images can be read; see {job.path / 'receipts'}. "
            "Check the survey's files."
        )
    _drain(run("train", len(channels), trains))

    first_ids = _first_ids(job, plan)
    assigns = [
        Order("assign", f"{n:06d}", {**where, "shard": n, "first_image_id": first_ids[n]})
        for n in unassigned
    ]
    for order in run("assign", len(shards), assigns):
        job.features(int(order.key)).unlink(missing_ok=True)
    merges = [
        Order("merge", name, {**where, "channel": name, "n_images": n_images})
        for name in channels
        if unassigned or not job.valid_receipt("merge", name)
    ]
    _drain(run("merge", len(channels), merges))
    return sum(_n_indexed(job, shard) for shard in missing)


def _drain(orders: Iterable[Order]) -> None:
    for _ in orders:
        pass


def _n_indexed(job: JobFolder, shard: int) -> int:
    return len(job.read_indexed(shard))


def _first_ids(job: JobFolder, plan: JobPlan) -> list[int]:
    """Ids are dense over the readable images: each shard begins where the former one ended."""
    first, ids = 0, []
    for shard in range(plan.n_shards):
        ids.append(first)
        first += _n_indexed(job, shard)
    return ids


def _extract_receipts(job: JobFolder, plan: JobPlan) -> list[Receipt]:
    receipts = (job.read_receipt("extract", f"{shard:06d}") for shard in range(plan.n_shards))
    return [receipt for receipt in receipts if receipt is not None]


def _all_skipped(intake: Intake, receipts: Iterable[Receipt]) -> tuple[Skipped, ...]:
    unreadable = [skipped for receipt in receipts for skipped in receipt.skipped]
    return tuple(sorted((*intake.skipped, *unreadable), key=lambda skipped: skipped.uri.encode()))


def _warnings(receipts: Iterable[Receipt]) -> tuple[str, ...]:
    sets = Counter(receipt.instruction_set for receipt in receipts)
    if len(sets) < 2:
        return ()
    warning = (
        f"The shards were worked on with different instruction sets ({'; '.join(sorted(sets))}): "
        "the index is sound, but another run may differ in bytes."
    )
    return (warning,)


def _commit(job: JobFolder, plan: JobPlan, intake: Intake) -> Generation:
    rows: list[CatalogueRow] = []
    for shard in range(plan.n_shards):
        for indexed in job.read_indexed(shard):
            position = shard * plan.shard_size + indexed.row
            rows.append(
                catalogue_row(
                    len(rows),
                    intake.survey_names[position],
                    intake.images[position],
                    indexed.sha256,
                    indexed.width_px,
                    indexed.height_px,
                )
            )
    catalogue = job.root / "catalogue" / f"{plan.segment}.parquet"
    outputs = {job.relative(catalogue): write_catalogue(catalogue, rows, intake.crs)}
    n_postings = 0
    for channel in plan.config.features.channels():
        for stage in ("train", "merge"):
            receipt = job.valid_receipt(stage, channel)
            if receipt is None:
                raise BadSurvey(
                    f"The files of {stage} {channel} changed while the job ran. Run it again."
                )
            outputs.update(receipt.outputs)
            n_postings += receipt.counts.get("postings", 0)
    skipped = _all_skipped(intake, _extract_receipts(job, plan))
    job.write_skipped([{"uri": each.uri, "reason": each.reason} for each in skipped])
    generation = Generation(
        number=_next_number(job.root),
        job=job.job,
        created_at=datetime.now(UTC).isoformat(timespec="seconds"),
        config=plan.config,
        config_digest=plan.config_digest,
        crs=intake.crs,
        area=_area(rows, intake.crs),
        allow_ballpark=intake.allow_ballpark,
        n_images=len(rows),
        n_skipped=len(skipped),
        n_postings=n_postings,
        surveys=tuple(
            SurveyEntry(
                name=named.name,
                path=str(named.path),
                format=named.survey.format,
                n_images=len(named.survey.images),
                attribution=named.survey.attribution,
            )
            for named in intake.surveys
        ),
        segment=plan.segment,
        files={
            name: FileEntry(sha256=digest, size=(job.root / name).stat().st_size)
            for name, digest in sorted(outputs.items())
        },
    )
    commit(job.root, generation)
    return generation


def _area(
    rows: Sequence[CatalogueRow], crs: str | None
) -> tuple[float, float, float, float] | None:
    posed = [
        (row.easting, row.northing)
        for row in rows
        if row.easting is not None and row.northing is not None
    ]
    if crs is None or not posed:
        return None
    area = area_of(crs, *np.array(posed).T)
    if area is None:
        return None
    return area.west_lon_degree, area.south_lat_degree, area.east_lon_degree, area.north_lat_degree


def _next_number(root: Path) -> int:
    taken = [int(path.stem) for path in (root / "generations").glob("[0-9]*.json")]
    return max(taken, default=0) + 1
