"""Catalogues of a few images, made without reading any."""

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import made_places
import numpy as np

from contracts.config import IndexConfig
from coordinator.export.stac import ItemMaker
from geo.crs import ToWgs84, area_of
from index.catalogue import CatalogueRow, write_catalogue
from index.commits import writing
from index.files import write_array
from index.manifest import FileEntry, Generation, SegmentEntry, SurveyEntry
from index.opened import OpenedIndex
from index.segments import segment_paths
from workers.stages.spots import Ground

INDEXED_AT = "2024-02-29T12:00:00+00:00"
ROW = replace(made_places.ROW, uri="run1/été.jpg", path="/survey/run1/été.jpg")


def numbered(row: CatalogueRow, count: int) -> list[CatalogueRow]:
    return [
        replace(row, image_id=number, uri=f"{number:06d}.jpg", easting=652000.0 + number)
        for number in range(count)
    ]


def index_of(root: Path, rows: Sequence[CatalogueRow], crs: str | None) -> OpenedIndex:
    config = IndexConfig()
    catalogue = root / "catalogue" / "0001.parquet"
    norms = segment_paths(root, "0001", config.features.channels()[0]).words_per_image
    digests = {
        catalogue: write_catalogue(catalogue, rows, crs),
        norms: write_array(norms, np.zeros(len(rows), dtype=np.uint32)),
    }
    survey = SurveyEntry(
        name="", path="/survey", format="table", n_images=len(rows), attribution="© A survey"
    )
    segment = SegmentEntry(
        name="0001",
        jobs=("0" * 16,),
        n_images=len(rows),
        n_postings=0,
        n_skipped=0,
        surveys=(survey,),
        quantisation={},
    )
    generation = Generation(
        number=1,
        made_by="index",
        created_at=INDEXED_AT,
        config=config,
        config_digest="",
        crs=crs,
        area=None if crs is None else _area(rows, crs),
        codebooks="0001",
        codebooks_digest="0" * 16,
        segments=(segment,),
        files={
            path.relative_to(root).as_posix(): FileEntry(sha256=digest, size=path.stat().st_size)
            for path, digest in digests.items()
        },
    )
    with writing(root) as writer:
        writer.commit(generation)
    return OpenedIndex(root)


def _area(rows: Sequence[CatalogueRow], crs: str) -> tuple[float, float, float, float] | None:
    places = [
        (row.easting, row.northing)
        for row in rows
        if row.easting is not None and row.northing is not None
    ]
    if not places:
        return None
    area = area_of(crs, *zip(*places, strict=True))
    assert area is not None
    return area.west_lon_degree, area.south_lat_degree, area.east_lon_degree, area.north_lat_degree


def item(row: CatalogueRow, crs: str | None = "EPSG:2154") -> dict[str, Any]:
    ground = None
    if crs is not None and row.easting is not None:
        here = [row.easting], [row.northing]
        to_wgs84 = ToWgs84.over(crs, *here)
        ground = Ground(to_wgs84, *to_wgs84.lon_lat(*here))
    (made,) = ItemMaker("c", crs, ground, INDEXED_AT).items([row])
    return made


ROWS = [
    ROW,
    replace(ROW, image_id=1, uri="b.png", path="/survey/b.png", captured_at=None),
    replace(
        ROW, image_id=2, uri="no pose.jpg", easting=None, northing=None, north=None, altitude_m=None
    ),
    replace(
        ROW,
        image_id=3,
        uri="明信片#1.tif",
        path="/survey/明信片#1.tif",
        heading_deg=None,
        pitch_deg=math.nan,
        hfov_deg=None,
        camera="",
    ),
    replace(
        ROW,
        image_id=4,
        uri="drive.mcap#topic=%2Fcam&time_ns=17&record=9",
        path="/survey/drive.mcap",
        fragment="topic=%2Fcam&time_ns=17&record=9",
        pitch_deg=3.0,
    ),
]
