"""Write the demo: a posed survey, restyled query photos, and the truth about them."""

import csv
import json
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from datetime import datetime, timedelta, timezone
from itertools import groupby
from pathlib import Path

import cv2
import numpy as np

from survey.synthetic.canvas import Rgb
from survey.synthetic.render import render
from survey.synthetic.shots import (
    QueryShot,
    ShotOptions,
    SurveyShot,
    drive,
    facades_seen,
    visit,
)
from survey.synthetic.street import StreetPlan
from survey.synthetic.styles import postcard, restyle
from survey.synthetic.town import Town, build_town

RELEVANT_WITHIN_M = 40.0
DARK_GAIN = 0.36
SENSOR_NOISE = 1.5
_JPEG = [int(cv2.IMWRITE_JPEG_QUALITY), 90]
_BEGAN = datetime(2024, 6, 12, 9, 30, tzinfo=timezone(timedelta(hours=2)))
_README = """A synthetic street-level survey, rendered by Flaneur. The streets do not exist.

poses.csv: one row an image; x, y, z in {crs} (metres); heading in degrees clockwise from GRID
north, of the optical axis; pitch up positive; roll right side down positive; hfov across the width.

    flaneur index . INDEX --crs {crs} --north grid
"""


@dataclass(frozen=True, slots=True)
class DemoQuery:
    """A query photo and the truth about it.

    file : relative to the queries' folder. easting, northing : metres, in the survey's CRS.
    heading_deg : clockwise from grid north. facade : the house front it mainly shows.
    """

    file: str
    style: str
    easting: float
    northing: float
    heading_deg: float
    facade: str


@dataclass(frozen=True, slots=True)
class DemoSurvey:
    """What was written.

    survey : the folder to index. queries : the folder of query photos, `truth.json` and
    `ground_truth.json`. crs : of the survey's poses. facades_seen : image uri (relative to the
    survey's folder) -> names of the facades that fill a good part of it, most central first.
    """

    survey: Path
    queries: Path
    crs: str
    truth: tuple[DemoQuery, ...]
    facades_seen: dict[str, tuple[str, ...]]


def render_survey(
    out: Path,
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
    options: ShotOptions | None = None,
) -> DemoSurvey:
    """Render the demo's survey and queries into a folder.

    Writes `survey/images/*.jpg`, `survey/poses.csv`, `survey/README.txt`, `queries/*.jpg`,
    `queries/truth.json` and `queries/ground_truth.json` (query -> relevant image uris: those
    that see the query's facade from within 40 m of the query). The same seed writes the same bytes.

    Parameters
    ----------
    out : made if missing; files of the same name are overwritten.
    seed : of everything random.
    progress : called after every picture with (pictures done, pictures in all).
    options : how many pictures and how large.
    """
    options = options or ShotOptions()
    town = build_town(StreetPlan(), seed)
    shots, visits = drive(town.plan, options, seed), visit(town, options, seed)
    survey, queries = out / "survey", out / "queries"
    (survey / "images").mkdir(parents=True, exist_ok=True)
    queries.mkdir(parents=True, exist_ok=True)
    pictures = _pictures(town, shots, visits, survey, queries, seed)
    for done, (path, rgb) in enumerate(pictures, start=1):
        _save(path, rgb)
        if progress is not None:
            progress(done, len(shots) + len(visits))
    seen = {shot.uri: facades_seen(town, shot.view) for shot in shots}
    _write_poses(survey / "poses.csv", shots)
    (survey / "README.txt").write_text(_README.format(crs=town.plan.crs), encoding="utf-8")
    truth = tuple(_truth(shot) for shot in visits)
    _write_json(queries / "truth.json", [asdict(query) for query in truth])
    relevant = {query.file: _relevant(query, shots, seen) for query in truth}
    _write_json(queries / "ground_truth.json", relevant)
    return DemoSurvey(survey, queries, town.plan.crs, truth, seen)


def _pictures(
    town: Town,
    shots: tuple[SurveyShot, ...],
    visits: tuple[QueryShot, ...],
    survey: Path,
    queries: Path,
    seed: int,
) -> Iterator[tuple[Path, Rgb]]:
    for index, shot in enumerate(shots):
        rng = np.random.default_rng([seed, 6, index])
        yield survey / shot.uri, _expose(render(town, shot.view), shot.wear, rng)
    for number, photos in groupby(visits, key=lambda visited: visited.number):
        alike = tuple(photos)
        rgb = render(town, alike[0].view, sky=1, cars=False)
        for visited in alike:
            yield queries / visited.file, _aged(rgb, visited, seed + number - 1)


def _aged(rgb: Rgb, visited: QueryShot, seed: int) -> Rgb:
    """A query's view in its style; some of the sepia ones are postcards."""
    styled = restyle(rgb, visited.style, seed)
    is_card = visited.style == "sepia" and visited.number % 8 == 1
    return postcard(styled, visited.caption) if is_card else styled


def _expose(rgb: Rgb, wear: str, rng: np.random.Generator) -> Rgb:
    """What the survey's camera makes of a view: exposure, sensor noise, now and then a failure."""
    gain = rng.uniform(0.85, 1.12)
    if wear == "dark":
        gain *= DARK_GAIN
    if wear == "blurred":
        length = int(rng.integers(9, 16))
        rgb = np.asarray(cv2.blur(rgb, (length, 3)), dtype=np.uint8)
    # Noise of one tile, repeated: drawing a fresh one for every pixel costs more than the view.
    tile = rng.normal(0, SENSOR_NOISE, (128, 128, 3))
    repeats = (rgb.shape[0] // 128 + 1, rgb.shape[1] // 128 + 1, 1)
    noise = np.tile(tile.astype(np.float32), repeats)[: rgb.shape[0], : rgb.shape[1]]
    exposed = rgb.astype(np.float32) * np.float32(gain) + noise
    return np.asarray(np.clip(np.rint(exposed), 0, 255), dtype=np.uint8)


def _save(path: Path, rgb: Rgb) -> None:
    _, data = cv2.imencode(".jpg", cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR), _JPEG)
    path.write_bytes(data.tobytes())


def _write_poses(path: Path, shots: tuple[SurveyShot, ...]) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["file", "x", "y", "z", "heading", "pitch", "roll", "hfov", "time"])
        for shot in shots:
            view = shot.view
            place = (view.easting, view.northing, view.altitude_m)
            angles = (view.heading_deg, view.pitch_deg, view.roll_deg, view.hfov_deg)
            time = (_BEGAN + timedelta(seconds=2 * shot.stop)).isoformat()
            row = [f"{value:.3f}" for value in place] + [f"{value:.4f}" for value in angles]
            table.writerow([shot.uri, *row, time])


def _truth(shot: QueryShot) -> DemoQuery:
    view = shot.view
    place = round(view.easting, 3), round(view.northing, 3), round(view.heading_deg, 4)
    return DemoQuery(shot.file, shot.style, *place, shot.facade.name)


def _relevant(
    query: DemoQuery, shots: tuple[SurveyShot, ...], seen: dict[str, tuple[str, ...]]
) -> list[str]:
    return [
        shot.uri
        for shot in shots
        if query.facade in seen[shot.uri]
        and np.hypot(shot.view.easting - query.easting, shot.view.northing - query.northing)
        <= RELEVANT_WITHIN_M
    ]


def _write_json(path: Path, content: object) -> None:
    path.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
