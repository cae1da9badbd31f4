"""What a finished job adds to an index: its segment, its catalogue, and the generation's files."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from contracts.errors import BadIndex
from contracts.records import Receipt, Skipped
from coordinator.building import quantisation_of
from coordinator.intake import Intake
from geo.crs import area_of
from index.catalogue import Catalogue, CatalogueRow, catalogue_row, write_catalogue
from index.codebooks import codebooks_digest
from index.jobs import JobFolder, JobPlan
from index.manifest import FileEntry, SegmentEntry, SurveyEntry

Area = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class Segment:
    """A segment that is ready. catalogue : its images.

    files : its own. codebook_files : of the words that it was assigned to.
    """

    entry: SegmentEntry
    catalogue: Catalogue
    files: dict[str, FileEntry]
    codebook_files: dict[str, FileEntry]
    codebooks_digest: str


def finish_segment(job: JobFolder, plan: JobPlan, intake: Intake) -> Segment:
    """Write the catalogue of a job whose stages are done, and what it skipped.

    Raises
    ------
    BadIndex : files of the job changed meanwhile.
    """
    receipts = extract_receipts(job, plan)
    skipped = all_skipped(intake, receipts)
    job.write_skipped([{"uri": each.uri, "reason": each.reason} for each in skipped])
    n_images = sum(receipt.counts["images"] for receipt in receipts)
    entry = SegmentEntry(
        name=plan.segment,
        jobs=(job.job,),
        n_images=n_images,
        n_postings=0,
        n_skipped=len(skipped),
        surveys=(),
        quantisation=quantisation_of(job, plan),
    )
    segment = segment_of(job, plan, entry, _rows(job, plan, intake), intake.crs)
    of_survey = segment.catalogue.counts("survey")
    surveys = tuple(
        SurveyEntry(
            name=named.name,
            path=str(named.path),
            format=named.survey.format,
            n_images=of_survey[named.name],
            attribution=named.survey.attribution,
        )
        for named in intake.surveys
    )
    return replace(segment, entry=segment.entry.model_copy(update={"surveys": surveys}))


def segment_of(
    job: JobFolder,
    plan: JobPlan,
    entry: SegmentEntry,
    rows: Iterable[CatalogueRow],
    crs: str | None,
) -> Segment:
    """Write a segment's catalogue and gather its files; `entry` is given its postings.

    rows : of the images that `entry` counts.

    Raises
    ------
    BadIndex : files of the job changed meanwhile.
    """
    outputs = _catalogue_outputs(job, plan, rows, crs)
    path = job.root / next(iter(outputs))
    words: dict[str, str] = {}
    codebooks: dict[str, str] = {}
    n_postings = 0
    for channel in plan.config.features.channels():
        joined, trained = _valid(job, "join", channel), _valid(job, "train", channel)
        outputs.update(joined.outputs)
        n_postings += joined.counts["postings"]
        codebooks.update(trained.outputs)
        words[channel] = next(
            digest for name, digest in trained.outputs.items() if name.endswith(".npy")
        )
    return Segment(
        entry=entry.model_copy(update={"n_postings": n_postings}),
        catalogue=Catalogue([path], [entry.n_images]),
        files=file_entries(job.root, outputs),
        codebook_files=file_entries(job.root, codebooks),
        codebooks_digest=codebooks_digest(words),
    )


def _catalogue_outputs(
    job: JobFolder, plan: JobPlan, rows: Iterable[CatalogueRow], crs: str | None
) -> dict[str, str]:
    """Write the catalogue, but not again: earlier generations may name the one that is there."""
    receipt = job.valid_receipt("catalogue", plan.segment)
    if receipt is None:
        path = job.root / "catalogue" / f"{plan.segment}.parquet"
        outputs = {job.relative(path): write_catalogue(path, rows, crs)}
        receipt = Receipt("catalogue", plan.segment, outputs, {})
        job.write_receipt(receipt)
    return receipt.outputs


def area_around(positions: NDArray[np.float64], crs: str | None) -> Area | None:
    """West, south, east, north in WGS 84 degrees; None: there is no pose.

    positions : (n, 2) easting and northing in `crs`, NaN for an image without a pose.
    """
    area = None if crs is None or not len(positions) else area_of(crs, *positions.T)
    if area is None:
        return None
    return area.west_lon_degree, area.south_lat_degree, area.east_lon_degree, area.north_lat_degree


def positions_of(catalogue: Catalogue) -> NDArray[np.float64]:
    """Easting and northing of each image; (n, 2), NaN where it has no pose."""
    return np.column_stack([catalogue.numbers(name) for name in ("easting", "northing")])


def now() -> str:
    """The time of a commit."""
    return datetime.now(UTC).isoformat(timespec="seconds")


def extract_receipts(job: JobFolder, plan: JobPlan) -> list[Receipt]:
    """What extracting each shard found out."""
    receipts = (job.read_receipt("extract", f"{shard:06d}") for shard in range(plan.n_shards))
    return [receipt for receipt in receipts if receipt is not None]


def all_skipped(intake: Intake, receipts: Sequence[Receipt]) -> tuple[Skipped, ...]:
    """Images that were left out, by the survey or as they could not be read."""
    unreadable = [skipped for receipt in receipts for skipped in receipt.skipped]
    return tuple(sorted((*intake.skipped, *unreadable), key=lambda skipped: skipped.uri.encode()))


def _rows(job: JobFolder, plan: JobPlan, intake: Intake) -> Iterator[CatalogueRow]:
    """The images that could be read, a shard at a time."""
    n_rows = 0
    for shard in range(plan.n_shards):
        images = job.read_images(shard)
        for indexed in job.read_indexed(shard):
            yield catalogue_row(
                n_rows,
                intake.survey_names[shard * plan.shard_size + indexed.row],
                images[indexed.row],
                indexed.sha256,
                indexed.width_px,
                indexed.height_px,
            )
            n_rows += 1


def _valid(job: JobFolder, stage: str, channel: str) -> Receipt:
    receipt = job.valid_receipt(stage, channel)
    if receipt is None:
        raise BadIndex(f"The files of {stage} {channel} changed while the job ran. Run it again.")
    return receipt


def file_entries(root: Path, outputs: Mapping[str, str]) -> dict[str, FileEntry]:
    """What a generation says of files. outputs : sha256 by path relative to the index."""
    return {
        name: FileEntry(sha256=digest, size=(root / name).stat().st_size)
        for name, digest in sorted(outputs.items())
    }
