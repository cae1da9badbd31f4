"""The demo: a town that Flaneur renders itself, old photos of it, and the truth about them."""

import math
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from contracts.config import CodebookConfig, FeatureConfig, IndexConfig, SearchConfig
from contracts.progress import Progress
from coordinator.engine.running import Engine
from coordinator.export.geojson import provenance, write_geojson
from coordinator.export.geopackage import write_geopackage
from coordinator.export.page import write_page
from coordinator.export.sheets import QuerySheet, SheetMatch, thumbnail_jpeg
from coordinator.indexing import IndexReport, run_job
from coordinator.intake import Intake, read_surveys
from coordinator.plan import make_plan
from coordinator.querying import Located, locate_photos
from geo.crs import ToWgs84
from geo.frames import LocalMetres
from geo.geojson import feature_collection
from index.opened import OpenedIndex
from survey import ReadOptions
from survey.synthetic import DemoQuery, DemoSurvey, ShotOptions, render_survey

CONFIG = IndexConfig(
    features=FeatureConfig(max_frames=600), codebooks=CodebookConfig(max_words=4000)
)
SHARD_SIZE = 8
RIGHT_WITHIN_M = 25.0
THUMBNAIL_PX = 240
SHOWN = 5
ATTRIBUTION = "Survey and photos rendered by Flaneur"


@dataclass(frozen=True, slots=True)
class Answer:
    """One way's answer to one query. metres : None where it gave no place."""

    detectors: tuple[str, ...]
    k: int
    metres: float | None
    right_facade: bool

    @property
    def right(self) -> bool:
        return self.right_facade and self.metres is not None and self.metres <= RIGHT_WITHIN_M


@dataclass(frozen=True, slots=True)
class DemoRow:
    """One query: what Flaneur, a bag of words and chance made of it."""

    query: DemoQuery
    flaneur: Answer
    plain: Answer
    chance: Answer


@dataclass(frozen=True, slots=True)
class DemoReport:
    """All of a demo. page, geojson, geopackage : what was written."""

    index: IndexReport
    rows: tuple[DemoRow, ...]
    seconds_per_photo: float
    page: Path
    geojson: Path
    geopackage: Path


def run_demo(
    out: Path, engine: Engine, progress: Progress, shots: ShotOptions | None = None
) -> DemoReport:
    """Render, index, locate, compare with the truth, and write the results.

    shots : how many pictures and how large; None: the whole town.
    """
    progress.begin("render", 1, 0)
    demo = render_survey(out, options=shots)
    progress.advance("render")
    intake = _attributed(read_surveys([("", demo.survey.absolute())], ReadOptions(crs=demo.crs)))
    root = (out / "index").absolute()
    job, plan = make_plan(root, intake, CONFIG, SHARD_SIZE)
    report = run_job(job, plan, intake, nullcontext(engine), progress)
    index = OpenedIndex(root)
    photos = [str(demo.queries / query.file) for query in demo.truth]
    search = SearchConfig()
    progress.begin("locate", 2 * len(photos), 0)

    def advance() -> None:
        progress.advance("locate")

    fused = list(locate_photos(index, photos, search, engine.follower, advance))
    plain = list(locate_photos(index, photos, search, engine.follower, advance, plain=True))
    judge = _Judge(demo, index)
    rows = tuple(
        DemoRow(query, judge.answer(query, ours), judge.answer(query, theirs), judge.chance(query))
        for query, ours, theirs in zip(demo.truth, fused, plain, strict=True)
    )
    features = [feature for located in fused for feature in located.features]
    geojson = out / "results.geojson"
    write_geojson(geojson, features, provenance(index))
    geopackage = out / "results.gpkg"
    write_geopackage(geopackage, fused, index)
    page = out / "index.html"
    write_page(
        page.absolute(),
        "Flaneur: old photos of a town that never was",
        feature_collection(features),
        [judge.sheet(row, located) for row, located in zip(rows, fused, strict=True)],
        attribution=ATTRIBUTION,
        track=judge.track(),
        truth={
            photo: judge.lon_lat(query) for photo, query in zip(photos, demo.truth, strict=True)
        },
    )
    seconds = float(np.mean([located.seconds for located in fused]))
    return DemoReport(report, rows, seconds, page, geojson, geopackage)


def _attributed(intake: Intake) -> Intake:
    """The survey names who made it, as every result then does."""
    surveys = tuple(
        replace(named, survey=replace(named.survey, attribution=ATTRIBUTION))
        for named in intake.surveys
    )
    return replace(intake, surveys=surveys)


class _Judge:
    """Holds answers against the truth."""

    def __init__(self, demo: DemoSurvey, index: OpenedIndex) -> None:
        self._demo = demo
        self._to_wgs84 = ToWgs84(demo.crs)
        self._uris = index.catalogue.column("uri")
        self._paths = index.catalogue.column("path")
        self._positions = np.column_stack(
            [index.catalogue.numbers("easting"), index.catalogue.numbers("northing")]
        )
        self._chance = np.random.default_rng(0)

    def answer(self, query: DemoQuery, located: Located) -> Answer:
        matches, estimates = located.of_kind("match"), located.of_kind("estimate")
        if not matches or not estimates:
            return Answer((), 0, None, False)
        first: dict[str, Any] = matches[0]["properties"]
        where = estimates[0]["geometry"]
        return Answer(
            tuple(first["detectors"]),
            first["k"],
            self._metres(query, *where["coordinates"]) if where else None,
            self._sees(first["image"], query.facade),
        )

    def chance(self, query: DemoQuery) -> Answer:
        """An image drawn at random is the answer."""
        drawn = int(self._chance.integers(len(self._uris)))
        easting, northing = self._positions[drawn]
        metres = math.hypot(easting - query.easting, northing - query.northing)
        return Answer((), 0, metres, self._sees(self._uris[drawn], query.facade))

    def sheet(self, row: DemoRow, located: Located) -> QuerySheet:
        """A query beside its matches, for the page."""
        matches: list[dict[str, Any]] = [
            each["properties"] for each in located.of_kind("match")[:SHOWN]
        ]
        return QuerySheet(
            query=located.query,
            photo_jpeg=thumbnail_jpeg(Path(located.query), THUMBNAIL_PX * 2, max_bytes=60_000),
            style=row.query.style,
            detectors=row.flaneur.detectors,
            k=row.flaneur.k,
            matches=tuple(
                SheetMatch(
                    image=match["image"],
                    rank=match["rank"],
                    score=match["score"],
                    thumbnail_jpeg=thumbnail_jpeg(self._paths[match["image_id"]], THUMBNAIL_PX),
                    hit=self._sees(match["image"], row.query.facade),
                )
                for match in matches
            ),
            metres_from_truth=row.flaneur.metres,
            right_facade=row.flaneur.right_facade,
            estimate=next(iter(located.of_kind("estimate")), None),
        )

    def lon_lat(self, query: DemoQuery) -> tuple[float, float]:
        lon, lat = self._to_wgs84.lon_lat(np.array([query.easting]), np.array([query.northing]))
        return float(lon[0]), float(lat[0])

    def track(self) -> list[tuple[float, float]]:
        """Where the survey's images were taken."""
        easting, northing = np.unique(self._positions, axis=0).T
        lon, lat = self._to_wgs84.lon_lat(easting, northing)
        return list(zip(lon.tolist(), lat.tolist(), strict=True))

    def _metres(self, query: DemoQuery, lon: float, lat: float) -> float:
        frame = LocalMetres(*self.lon_lat(query))
        east, north = frame.from_lon_lat(np.array([lon]), np.array([lat]))
        return math.hypot(float(east[0]), float(north[0]))

    def _sees(self, uri: str, facade: str) -> bool:
        return facade in self._demo.facades_seen.get(uri, ())


def share_right(rows: Sequence[DemoRow], way: Callable[[DemoRow], Answer]) -> int:
    """How many queries a way answers within 25 m and on the right facade."""
    return sum(way(row).right for row in rows)
