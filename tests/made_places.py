"""Indices of places alone: segments with a catalogue, of which nothing else can be read."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from contracts.config import FeatureConfig, IndexConfig
from geo.crs import area_of
from index.catalogue import CatalogueRow, write_catalogue
from index.commits import writing
from index.files import write_array
from index.manifest import FileEntry, Generation, SegmentEntry, SurveyEntry
from index.opened import OpenedIndex
from index.segments import segment_paths
from index.tombstones import tombstones_folder, write_tombstones

CONFIG = IndexConfig(features=FeatureConfig(detectors=("star",), descriptors=("sift",)))
ROW = CatalogueRow(
    image_id=0,
    uri="run1/0000.jpg",
    path="/survey/run1/0000.jpg",
    fragment="",
    survey="",
    sha256="0" * 64,
    easting=652000.0,
    northing=6862000.0,
    altitude_m=40.0,
    heading_deg=90.0,
    heading_derived=False,
    north="grid",
    pitch_deg=-5.0,
    roll_deg=1.0,
    position_error_m=None,
    camera="front",
    hfov_deg=60.0,
    width_px=1920,
    height_px=1080,
    captured_at="2014-06-16T10:00:00+02:00",
    quarter_turns=0,
)


def index_of_places(
    root: Path,
    segments: Sequence[Sequence[CatalogueRow]],
    crs: str | None,
    removed: Sequence[int] = (),
) -> OpenedIndex:
    """An index of these rows by segment; `removed` are ids of the whole index."""
    files: dict[Path, str] = {}
    entries = []
    gone = np.zeros(sum(map(len, segments)), dtype=np.bool_)
    gone[list(removed)] = True
    first = 0
    for number, rows in enumerate(segments, start=1):
        name = f"{number:04d}"
        numbered = [replace(row, image_id=at) for at, row in enumerate(rows)]
        catalogue = root / "catalogue" / f"{name}.parquet"
        files[catalogue] = write_catalogue(catalogue, numbered, crs)
        sizes = segment_paths(root, name, "star-sift").words_per_image
        files[sizes] = write_array(sizes, np.zeros(len(rows), dtype=np.uint32))
        here = gone[first : first + len(rows)]
        first += len(rows)
        if here.any():
            files |= write_tombstones(tombstones_folder(root, "000001", name), here, {})
        surveys = dict.fromkeys(row.survey for row in rows)
        entries.append(
            SegmentEntry(
                name=name,
                jobs=("0" * 16,),
                n_images=len(rows),
                n_removed=int(here.sum()),
                tombstones="000001" if here.any() else None,
                n_postings=0,
                n_skipped=0,
                surveys=tuple(
                    SurveyEntry(name=each, path="/survey", format="table", n_images=len(rows))
                    for each in surveys
                ),
                quantisation={},
            )
        )
    generation = Generation(
        number=1,
        made_by="index",
        created_at="2026-01-01T00:00:00+00:00",
        config=CONFIG,
        config_digest=CONFIG.digest(),
        crs=crs,
        area=_area([row for rows in segments for row in rows], crs),
        codebooks="0001",
        codebooks_digest="0" * 16,
        segments=tuple(entries),
        files={
            path.relative_to(root).as_posix(): FileEntry(sha256=digest, size=path.stat().st_size)
            for path, digest in files.items()
        },
    )
    with writing(root) as writer:
        writer.commit(generation)
    return OpenedIndex(root)


def _area(
    rows: Sequence[CatalogueRow], crs: str | None
) -> tuple[float, float, float, float] | None:
    places = np.array([(row.easting, row.northing) for row in rows], dtype=np.float64)
    area = None if crs is None else area_of(crs, *places.T)
    if area is None:
        return None
    return area.west_lon_degree, area.south_lat_degree, area.east_lon_degree, area.north_lat_degree
