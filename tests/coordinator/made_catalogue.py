"""Catalogues of a few images, made without reading any."""

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from contracts.config import IndexConfig
from coordinator.export.stac import ItemMaker
from geo.crs import ToWgs84, area_of
from index.catalogue import CatalogueRow, write_catalogue
from index.manifest import FileEntry, Generation, SurveyEntry, commit
from index.opened import OpenedIndex
from workers.stages.spots import Ground

INDEXED_AT = "2024-02-29T12:00:00+00:00"
ROW = CatalogueRow(
    image_id=0,
    uri="run1/été.jpg",
    path="/survey/run1/été.jpg",
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


def numbered(row: CatalogueRow, count: int) -> list[CatalogueRow]:
    return [
        replace(row, image_id=number, uri=f"{number:06d}.jpg", easting=652000.0 + number)
        for number in range(count)
    ]


def index_of(root: Path, rows: Sequence[CatalogueRow], crs: str | None) -> OpenedIndex:
    name = "catalogue/0001.parquet"
    digest = write_catalogue(root / name, rows, crs)
    survey = SurveyEntry(
        name="", path="/survey", format="table", n_images=len(rows), attribution="© A survey"
    )
    generation = Generation(
        number=1,
        job="0" * 16,
        created_at=INDEXED_AT,
        config=IndexConfig(),
        config_digest="",
        crs=crs,
        area=None if crs is None else _area(rows, crs),
        n_images=len(rows),
        n_skipped=0,
        n_postings=0,
        surveys=(survey,),
        segment="0001",
        files={name: FileEntry(sha256=digest, size=(root / name).stat().st_size)},
    )
    commit(root, generation)
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
