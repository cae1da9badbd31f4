"""Stereopolis: the second pass of a street located against the first.

The set proves ingest and georeferencing, not retrieval: the two passes are metres and minutes
apart, and a plain bag of words finds nearly all of it too.
"""

import math
import tempfile
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from benchmarks.table import print_table
from contracts.config import IndexConfig, SearchConfig
from contracts.records import PosedImage
from coordinator.cli.show import bars
from coordinator.engine.running import Engine, running_engine
from coordinator.indexing import run_job
from coordinator.intake import read_surveys
from coordinator.plan import make_plan
from coordinator.querying import Located, locate_photos
from geo.crs import ToWgs84
from geo.frames import LocalMetres
from index.opened import OpenedIndex
from survey import ReadOptions, decode_image, read_survey

FIRST_PASS = ("*_00004??.jpg", "*_00005??.jpg")
SECOND_PASS = ("*_00007??.jpg",)
NEAR_M, WITHIN_M, WITHIN_DEG = 10.0, 5.0, 30.0

_READ = ReadOptions(include=FIRST_PASS)
_SIFT_ALONE = SearchConfig(pair=("hesaff",), k=2, descriptors=("sift",), vote="union")
ABLATIONS = (
    ("Flaneur", _READ, SearchConfig(), False),
    ("hesaff-SIFT alone", _READ, _SIFT_ALONE, False),
    ("hesaff-SIFT bag of words", _READ, SearchConfig(), True),
    ("not put upright", replace(_READ, make_upright=False), SearchConfig(), False),
    ("no mask", replace(_READ, use_masks=False), SearchConfig(), False),
)


@dataclass(frozen=True, slots=True)
class Query:
    """An image of the second pass, upright on disk, that has a neighbour in the first pass.

    can_be_right : an image of the same camera stands within 5 m, so a first match can be right.
    """

    photo: str
    truth: PosedImage
    can_be_right: bool


def run(data: Path) -> None:
    """Print the table: Flaneur, then what each part of ingest is worth."""
    survey = data / "stereopolis-paris6"
    with tempfile.TemporaryDirectory() as scratch, running_engine(None, None) as engine:
        queries = second_pass(survey, Path(scratch))
        rows: list[tuple[str, ...]] = []
        indices: dict[ReadOptions, tuple[OpenedIndex, str, str]] = {}
        for name, options, search, plain in ABLATIONS:
            if options not in indices:
                root = Path(scratch) / f"index-{len(indices)}"
                indices[options] = index_first_pass(survey, root, options, engine)
            index, rate, size = indices[options]
            with bars() as progress:
                progress.begin("locate", len(queries), 0)
                located = list(
                    locate_photos(
                        index,
                        [query.photo for query in queries],
                        search,
                        engine.follower,
                        lambda: progress.advance("locate"),
                        plain=plain,
                    )
                )
            rows.append((name, *figures(index, queries, located), rate, size))
    where = f"within {NEAR_M:.0f} m of the first pass"
    can = sum(query.can_be_right for query in queries)
    print(
        f"{len(queries)} queries {where}, {can} of which can be right; {engine.n_workers} workers"
    )
    print_table(
        (
            "",
            "first match right",
            "median error of estimate, m",
            "s a photo",
            "images/s",
            "bytes an image",
        ),
        rows,
    )


def second_pass(survey: Path, scratch: Path) -> list[Query]:
    """Queries of cameras 301 to 304 within 10 m of the first pass, put upright on disk."""
    first = read_survey(survey, ReadOptions(include=FIRST_PASS)).images
    queries = []
    for image in read_survey(survey, ReadOptions(include=SECOND_PASS)).images:
        same = [other for other in first if other.camera.name == image.camera.name]
        near = min(metres(image, other) for other in same)
        if near > NEAR_M or image.camera.name == "300":
            continue
        upright = decode_image(image.path, quarter_turns=image.quarter_turns).rgb
        photo = scratch / Path(image.path).name
        cv2.imwrite(str(photo), upright[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, 95])
        queries.append(Query(str(photo), image, near <= WITHIN_M))
    return queries


def index_first_pass(
    survey: Path,
    root: Path,
    options: ReadOptions,
    engine: Engine,
    config: IndexConfig | None = None,
) -> tuple[OpenedIndex, str, str]:
    """Index it; returns images per second and bytes per image too."""
    intake = read_surveys([("", survey)], options)
    job, plan = make_plan(root, intake, config or IndexConfig())
    with bars() as progress:
        report = run_job(job, plan, intake, nullcontext(engine), progress)
    n_images = report.generation.n_images
    rate = f"{report.images_extracted / report.seconds:.2f}"
    return OpenedIndex(root), rate, f"{report.bytes_on_disk / n_images:,.0f}"


def figures(
    index: OpenedIndex, queries: list[Query], located: list[Located]
) -> tuple[str, str, str]:
    """Share of right first matches, median error of the estimate, mean seconds."""
    by_uri = {row.uri: row for row in index.catalogue.rows(range(index.n_images))}
    right, errors = 0, []
    for query, answer in zip(queries, located, strict=True):
        row = by_uri[str(answer.of_kind("match")[0]["properties"]["image"])]
        pose = query.truth.pose
        turn = abs((row.heading_deg - pose.heading_deg + 180) % 360 - 180)
        apart = math.hypot(row.easting - pose.easting, row.northing - pose.northing)
        right += row.camera == query.truth.camera.name and apart <= WITHIN_M and turn <= WITHIN_DEG
        errors += [
            error_m(index, query, estimate["geometry"]["coordinates"])
            for estimate in answer.of_kind("estimate")
        ]
    seconds = np.mean([answer.seconds for answer in located])
    share = f"{right}/{len(queries)} = {right / len(queries):.3f}"
    return share, f"{np.median(errors):.2f}", f"{seconds:.2f}"


def metres(one: PosedImage, other: PosedImage) -> float:
    return math.hypot(
        one.pose.easting - other.pose.easting, one.pose.northing - other.pose.northing
    )


def error_m(index: OpenedIndex, query: Query, lon_lat: list[float]) -> float:
    pose = query.truth.pose
    to_wgs84 = ToWgs84(pose.crs)
    lon, lat = to_wgs84.lon_lat(np.array([pose.easting]), np.array([pose.northing]))
    east, north = LocalMetres(float(lon[0]), float(lat[0])).from_lon_lat(
        np.array(lon_lat[:1]), np.array(lon_lat[1:2])
    )
    return math.hypot(float(east[0]), float(north[0]))
