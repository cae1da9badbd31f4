"""The Stereopolis round on a subset: the first pass of a street indexed, the second located.

"IGN research iTowns sample dataset", (c) IGN; used where it lies, never copied.
"""

import math
from contextlib import nullcontext
from pathlib import Path

import cv2
import pytest

from contracts.config import CodebookConfig, FeatureConfig, IndexConfig, SearchConfig
from coordinator.cli.show import Bars
from coordinator.engine.running import Engine
from coordinator.indexing import run_job
from coordinator.intake import read_surveys
from coordinator.plan import make_plan
from coordinator.querying import locate_photos
from index.opened import OpenedIndex
from survey import ReadOptions, decode_image, read_survey

CONFIG = IndexConfig(
    features=FeatureConfig(max_frames=300, max_side_px=640),
    codebooks=CodebookConfig(max_words=1500),
)


@pytest.fixture(scope="module")
def survey(test_data: Path) -> Path:
    folder = test_data / "stereopolis-paris6"
    if not folder.is_dir():
        pytest.skip(f"no Stereopolis survey at {folder}; set FLANEUR_TEST_DATA")
    return folder


def test_the_second_pass_is_located_within_metres_of_the_first(
    survey: Path, tmp_path: Path, engine: Engine
) -> None:
    first_pass = ReadOptions(include=("*-30[24]-*_000048?.jpg", "*-30[24]-*_000049?.jpg"))
    intake = read_surveys([("", survey)], first_pass)
    root = tmp_path / "index"
    job, plan = make_plan(root, intake, CONFIG, 6)
    report = run_job(job, plan, intake, nullcontext(engine), Bars(None))
    assert report.generation.crs == "EPSG:2154"
    assert not report.skipped
    assert report.without_frames == 0

    second_pass = ReadOptions(include=("*-30[24]-*_000072[34567].jpg",))
    truth = read_survey(survey, second_pass).images
    photos = []
    for image in truth:
        upright = decode_image(image.path, quarter_turns=image.quarter_turns).rgb
        photos.append(str(tmp_path / Path(image.uri).name))
        cv2.imwrite(photos[-1], upright[:, :, ::-1])
    index = OpenedIndex(root)
    located = locate_photos(index, photos, SearchConfig(), engine.follower, lambda: None)
    rows = {row.uri: row for row in index.catalogue.rows(range(index.n_images))}
    right = 0
    for image, answer in zip(truth, located, strict=True):
        row = rows[str(answer.of_kind("match")[0]["properties"]["image"])]
        pose = image.pose
        assert pose is not None
        apart = math.hypot(row.easting - pose.easting, row.northing - pose.northing)
        right += row.camera == image.camera.name and apart <= 5.0
        (estimate,) = answer.of_kind("estimate")
        assert estimate["properties"]["radius_m"] > 0
    assert len(photos) == 10
    assert right >= 9
