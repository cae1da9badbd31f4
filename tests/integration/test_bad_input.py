"""What careless and hostile users give: told in one sentence, with the way out, and no traceback.

Refusals are asked of the same command line object that the `flaneur` script runs, in this process
for speed; whatever starts workers, or is stopped, runs in a process of its own.
"""

import json
import os
import shutil
from pathlib import Path
from typing import Any

import pytest
from bad_survey import INDEXED, SAME_IN_NFC, SKIPPED, fill, picture
from flaneur_command import run
from typer.testing import CliRunner

from contracts.config import SearchConfig
from coordinator.cli import main
from coordinator.engine.running import Engine
from coordinator.querying import locate_photos
from index.opened import OpenedIndex
from survey import ReadOptions, read_survey

SMALL = ("--crs", "EPSG:2154", "--max-frames", "120", "--max-words", "200")


def say(*arguments: str | Path) -> tuple[int, str]:
    """Exit code and what a person reads."""
    answer = CliRunner().invoke(main, [str(each) for each in arguments])
    assert answer.exception is None or isinstance(answer.exception, SystemExit)
    return answer.exit_code, answer.stderr


@pytest.fixture(scope="module")
def mixed(
    tmp_path_factory: pytest.TempPathFactory, engine: Engine
) -> tuple[Path, int, dict[str, Any]]:
    """The mixed survey, indexed by relative paths, with a space and a slash, into itself."""
    folder = tmp_path_factory.mktemp("given")
    fill(folder / "my survey")
    options = (*SMALL, "--json", "--broker", engine.app.conf.broker_url)
    answer = run("index", "my survey/", "my survey/idx", *options, folder=folder)
    assert "Traceback" not in answer.stderr
    return folder / "my survey", answer.returncode, json.loads(answer.stdout)


def test_what_cannot_be_used_is_skipped_with_its_reason(
    mixed: tuple[Path, int, dict[str, Any]],
) -> None:
    _, code, report = mixed
    assert code == 3
    reasons = {each["uri"]: each["reason"] for each in report["skipped"]}
    for uri, reason in SKIPPED.items():
        assert reason in reasons[uri], uri
    outside = {uri for uri, why in reasons.items() if "leads out of the survey" in why}
    assert reasons.keys() == SKIPPED.keys() | outside
    assert outside == {"up"}


def test_what_is_unusual_is_indexed(mixed: tuple[Path, int, dict[str, Any]]) -> None:
    folder, _, report = mixed
    opened = OpenedIndex(folder / "idx")
    assert set(opened.catalogue.column("uri")) == INDEXED
    assert report["without_keypoints"] == 2
    rows = {row.uri: row for row in opened.catalogue.rows(range(len(INDEXED)))}
    assert (rows["turned.jpg"].width_px, rows["turned.jpg"].height_px) == (200, 240)
    assert all(Path(row.path).is_absolute() and Path(row.path).is_file() for row in rows.values())
    words = opened.distinct_words(opened.config.features.channels())
    blank = {uri for uri, row in rows.items() if words[row.image_id] == 0}
    assert blank == {"one.png", "flat.png"}


def test_an_index_inside_its_survey_is_no_part_of_it(
    mixed: tuple[Path, int, dict[str, Any]],
) -> None:
    folder, _, report = mixed
    again = run("index", folder, folder / "idx", *SMALL, "--json")
    assert (again.returncode, json.loads(again.stdout)["extracted_now"]) == (3, 0)
    assert json.loads(again.stdout)["skipped"] == report["skipped"]


def test_bad_photos_stop_no_other(
    mixed: tuple[Path, int, dict[str, Any]], tmp_path: Path, engine: Engine
) -> None:
    folder = mixed[0]
    hostile = tmp_path / "\"'<script>alert(1)\N{ESCAPE}[31m.jpg"
    shutil.copy(folder / "b" / "same.jpg", hostile)
    foreign = Path(os.fsdecode(os.fsencode(tmp_path) + b"/caf\xe9.jpg"))
    shutil.copy(folder / "deep.png", foreign)
    good = {str(hostile): "b/same.jpg", str(foreign): "deep.png"}
    bad = {
        str(tmp_path / "missing.jpg"): "No such file",
        str(folder / "truncated.jpg"): "truncated",
        str(folder / "huge.png"): "more than max_pixels",
        str(folder / "flat.png"): "shares a visual word",
        str(folder / "one.png"): "shares a visual word",
    }
    out = tmp_path / "out.geojson"
    photos = [*good, *bad, str(hostile), str(folder / "flat.png")]
    broker = ("--broker", engine.app.conf.broker_url)
    answer = run("locate", *photos, "--index", folder / "idx", "--out", out, *broker)
    assert answer.returncode == 3, answer.stderr
    assert "Traceback" not in answer.stderr
    features = json.loads(out.read_bytes())["features"]
    first = {
        each["properties"]["query"]: each["properties"]["image"]
        for each in features
        if each["properties"].get("rank") == 1
    }
    assert first == good
    errors = {
        each["properties"]["query"]: each["properties"]["error"]
        for each in features
        if each["properties"]["kind"] == "error" and each["geometry"] is None
    }
    assert errors.keys() == bad.keys()
    for query, reason in bad.items():
        assert reason in errors[query]
    assert len({each["id"] for each in features}) == len(features)  # also of those given twice


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (("--crs", "EPSG:999999"), "such as EPSG:2154"),
        (("--crs", "+proj=utm +zone=31 +ellps=intl"), "no conversion to WGS 84"),
        ((), "--crs EPSG:2154"),
        (("--crs", "EPSG:27700"), "far outside the area of use"),
        (("--format", "shapefile"), "stereopolis, mcap, kapture, table, utm-names, exif, plain"),
        ((*SMALL, "--detectors", "hesaff,sift"), "hesaff,mser,star,har,orb,colsym; got 'sift'"),
        ((*SMALL, "--descriptors", "sc,sc"), "names sc twice"),
        ((*SMALL, "--also", "nowhere"), "NAME=SURVEY"),
        ((*SMALL, "--also", "a/b=."), "NAME=SURVEY"),
        ((*SMALL, "--also", "a=.", "--also", "a=."), "its own name"),
        ((*SMALL, "--also", "main=."), "cannot be named main"),
        ((*SMALL, "--also", "a=/nowhere"), "/nowhere does not exist"),
        ((*SMALL, "--include", "*.gif"), "--include"),
        ((*SMALL, "--max-words", "0"), "max_words"),
    ],
)
def test_an_index_command_that_makes_no_sense_is_refused(
    small_survey: Path, tmp_path: Path, options: tuple[str, ...], says: str
) -> None:
    code, said = say("index", small_survey, tmp_path / "i", *options)
    assert code == 2
    assert says in said
    assert not (tmp_path / "i").exists()


def test_surveys_that_are_none_are_refused(small_survey: Path, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    picture(1).save(tmp_path / "photo.jpg")
    rows = (small_survey / "poses.csv").read_text().replace("file,x,y", "file,y,x")
    swapped = small_survey / "swapped.txt"
    swapped.write_text(rows)
    for survey, says in (
        (tmp_path / "empty", "is empty"),
        (tmp_path, "--no-pose"),
        (tmp_path / "nowhere", "does not exist"),
        (tmp_path / "photo.jpg", "is no survey"),
        (swapped, "swapped"),
    ):
        code, said = say("index", survey, tmp_path / "i", *SMALL)
        assert (code, says in said) == (2, True), said


def test_a_folder_or_file_of_somebody_else_is_never_written_to(
    small_survey: Path, tmp_path: Path
) -> None:
    (tmp_path / "theirs" / "jobs" / "letters").mkdir(parents=True)
    (tmp_path / "file").write_text("mine")
    for place, says in (
        (small_survey, "Name a new folder"),
        (tmp_path / "theirs", "Name a new folder"),
        (tmp_path / "file", "is a file"),
    ):
        before = sorted(place.rglob("*"))
        code, said = say("index", small_survey, place, *SMALL)
        assert (code, says in said) == (2, True), said
        assert sorted(place.rglob("*")) == before


def test_a_table_of_many_missing_images_is_summed_up(tmp_path: Path) -> None:
    rows = "\n".join(f"{number:06d}.jpg,652000,6862000" for number in range(100_000))
    (tmp_path / "poses.csv").write_text(f"file,x,y\n{rows}\n")
    for number in range(10):
        (tmp_path / f"{number:06d}.jpg").touch()
    survey = read_survey(tmp_path, ReadOptions(crs="EPSG:2154"))
    assert (len(survey.images), len(survey.skipped)) == (10, 99_990)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (("--pair", "hesaff,surf"), "--pair takes any of"),
        (("--pair", "hesaff,hesaff"), "names hesaff twice"),
        (("--k", "0"), "from 1 to 10; got '0'"),
        (("--k", "²"), "from 1 to 10; got '²'"),
        (("--vote", "most"), "--vote takes auto, union, intersection, pairwise; got 'most'"),
        (("--weights", "idf,tf"), "idf,norm,burst; got 'tf'"),
        (("--descriptors", "surf,orb"), "sift,surf,sc; got 'orb'"),
        (("--top", "0"), "top"),
        (("--out", "."), "is a folder"),
        (("--out", "FILE/x.geojson"), "is a file"),
        (("--out", "PHOTO"), "is one of the inputs"),
        (("--out", "/dev/null"), "no regular file"),
        (("--out", "/nowhere/results.shp"), "'.shp' is no format that is written"),
        (("--out", "PHOTO.geojson", "--out", "/proc/none/x.kml"), "cannot write into /proc/none"),
    ],
)
def test_a_search_that_makes_no_sense_is_refused_before_the_work(
    mixed: tuple[Path, int, dict[str, Any]], options: tuple[str, ...], says: str
) -> None:
    photo = mixed[0] / "alpha.png"
    before = photo.read_bytes()
    given = [each.replace("FILE", str(photo)).replace("PHOTO", str(photo)) for each in options]
    code, said = say("locate", photo, "--index", mixed[0] / "idx", *given)
    assert code == 2
    assert says in said
    assert "to do" not in said
    assert photo.read_bytes() == before


@pytest.mark.parametrize(
    ("truth", "says"),
    [
        ("{", "is not a ground truth"),
        ("[]", "is not a ground truth"),
        ('{"q.jpg": "a/same.jpg"}', "'q.jpg': Input should be a valid list"),
        ("[" * 100_000, "nested too deeply"),
        ('{"q.jpg": ["deep.png"], "q.jpg": []}', "'q.jpg' is there twice"),
        ('{"q.jpg": ["nowhere.jpg"]}', "no image of the index"),
        ('{"q.jpg": ["same.jpg"]}', "Write more of its path"),
        (None, "cannot be read"),
    ],
)
def test_a_truth_that_does_not_hold_is_refused(
    mixed: tuple[Path, int, dict[str, Any]], tmp_path: Path, truth: str | None, says: str
) -> None:
    path = tmp_path / "truth.json"
    if truth is not None:
        path.write_text(truth)
    code, said = say("evaluate", "--index", mixed[0] / "idx", "--truth", path)
    assert code == 2
    assert says in said


def test_without_a_readable_query_evaluate_names_them_all(
    mixed: tuple[Path, int, dict[str, Any]], tmp_path: Path, engine: Engine
) -> None:
    path = tmp_path / "truth.json"
    path.write_text(json.dumps({"gone.jpg": [f"nf/{SAME_IN_NFC}.jpg"], "\ud800.jpg": ["deep.png"]}))
    opened = OpenedIndex(mixed[0] / "idx")  # a first photo, so that the workers surely listen
    list(locate_photos(opened, ["gone.jpg"], SearchConfig(), engine.follower, lambda: None))
    broker = ("--broker", engine.app.conf.broker_url)
    code, said = say("evaluate", "--index", mixed[0] / "idx", "--truth", path, *broker)
    assert code == 2, said
    assert "gone.jpg: cannot be opened: No such file" in said
