"""Surveys in an object store are read as the same files in a folder are."""

import shutil
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import pytest
from mcap_drives import Protobuf, drive
from object_store import Bucket, Server
from PIL import Image

from contracts.errors import BadConfig, BadSurvey, TaskFailed, UnusableImage
from contracts.places import place_of
from contracts.records import PosedImage
from survey import ReadOptions, Survey, decode_image, read_survey
from survey.image_file import regular_file
from survey.image_header import read_header
from survey.stored import state_of

METRES = ReadOptions(crs="EPSG:2154")


def as_in(folder: Path, survey: Survey, url: str) -> Survey:
    """The survey as it would be, were its folder at `url`."""

    def moved(image: PosedImage) -> PosedImage:
        return replace(image, path=image.path.replace(str(folder), url))

    return replace(survey, images=tuple(map(moved, survey.images)))


def test_a_table_in_a_store_gives_the_images_of_the_folder(
    small_survey: Path, bucket: Bucket
) -> None:
    url = bucket.upload(small_survey, "rue Édouard/2020")
    here = read_survey(small_survey, METRES)
    assert read_survey(place_of(url), METRES) == as_in(small_survey, here, url)
    table = place_of(f"{url}/poses.csv")
    assert read_survey(table, METRES) == as_in(small_survey, here, url)


def test_a_layer_of_points_in_a_store_is_read_with_the_files_beside_it(
    small_survey: Path, bucket: Bucket, tmp_path: Path
) -> None:
    import geopandas

    folder = tmp_path / "survey"
    folder.mkdir()
    for image in small_survey.glob("*.jpg"):
        shutil.copy(image, folder)
    names = sorted(path.name for path in folder.iterdir())
    points = geopandas.points_from_xy([652000 + n for n in range(len(names))], [6862000.0] * 10)
    frame = geopandas.GeoDataFrame({"file": names}, geometry=points, crs="EPSG:2154")
    frame.to_file(folder / "poses.shp")
    url = bucket.upload(folder, "survey")
    here = read_survey(folder, ReadOptions())
    assert len(here.images) == 10
    assert read_survey(place_of(url), ReadOptions()) == as_in(folder, here, url)


def test_photographs_in_a_store_keep_their_exif(bucket: Bucket, tmp_path: Path) -> None:
    exif = Image.Exif()
    exif.get_ifd(0x8825).update({1: "N", 2: (48.0, 51.0, 0.0), 3: "E", 4: (2.0, 20.0, 0.0)})
    Image.new("RGB", (64, 48), "red").save(tmp_path / "a.jpg", exif=exif)
    url = bucket.upload(tmp_path, "photos")
    here = read_survey(tmp_path, ReadOptions())
    assert here.format == "exif"
    assert read_survey(place_of(url), ReadOptions()) == as_in(tmp_path, here, url)


def test_a_drive_in_a_store_is_read_and_its_images_decoded(bucket: Bucket, tmp_path: Path) -> None:
    Protobuf().write(tmp_path / "drive.mcap", drive(Protobuf()))
    url = bucket.upload(tmp_path, "drives")
    here = read_survey(tmp_path, ReadOptions())
    there = read_survey(place_of(url), ReadOptions())
    assert there == as_in(tmp_path, here, url)
    for mine, stored in zip(here.images, there.images, strict=True):
        local = decode_image(mine.path, fragment=mine.fragment)
        assert decode_image(stored.path, fragment=stored.fragment).sha256 == local.sha256


def test_a_store_is_listed_once_and_asked_about_no_image(
    small_survey: Path, bucket: Bucket, store: Server
) -> None:
    url = bucket.upload(small_survey, "survey")
    before = len(store.requests)
    survey = read_survey(place_of(url), replace(METRES, cut_panoramas=False))
    states = {state_of(image.path) for image in survey.images}
    asked = store.requests[before:]
    assert len(states) == 10
    assert not [each for each in asked if ".jpg" in each]
    assert sum("prefix=survey%2F&" in f"{each}&" and "delimiter=&" in each for each in asked) == 1


def test_a_survey_that_has_changed_is_listed_anew(small_survey: Path, bucket: Bucket) -> None:
    url = bucket.upload(small_survey, "survey")
    before = state_of(read_survey(place_of(url), METRES).images[0].path)
    bucket.put("survey/00.jpg", bucket.get("survey/01.jpg"))
    after = state_of(read_survey(place_of(url), METRES).images[0].path)
    assert before.mark != after.mark


@pytest.mark.parametrize("key", ["a b/ü#1?.jpg", "x::y.jpg", "100%25.jpg", "[a]*.jpg"])
def test_any_name_in_a_store_is_opened(key: str, bucket: Bucket, small_survey: Path) -> None:
    bucket.put(f"survey/{key}", (small_survey / "00.jpg").read_bytes())
    (image,) = read_survey(place_of(bucket.url("survey")), ReadOptions(no_pose=True)).images
    assert image.uri == key
    assert decode_image(image.path).width_px == 320


def test_hidden_and_strange_names_in_a_store_are_not_taken(
    bucket: Bucket, small_survey: Path
) -> None:
    content = (small_survey / "00.jpg").read_bytes()
    for key in ("a.jpg", ".hidden/b.jpg", "c//d.jpg", "folder/", ""):
        bucket.put(f"survey/{key}", b"" if key.endswith("/") or not key else content)
    survey = read_survey(place_of(bucket.url("survey")), ReadOptions(no_pose=True))
    assert [image.uri for image in survey.images] == ["a.jpg"]
    assert [skip.uri for skip in survey.skipped] == ["c//d.jpg"]


def test_an_object_that_is_no_image_is_skipped_and_one_that_is_gone(bucket: Bucket) -> None:
    bucket.put("empty.jpg", b"")
    bucket.put("text.jpg", b"not an image")
    for key, reason in (("empty.jpg", "empty"), ("text.jpg", "not a"), ("gone.jpg", "not in")):
        for look in (decode_image, read_header):
            with pytest.raises(UnusableImage, match=reason):
                look(bucket.url(key))


def test_a_store_that_is_away_is_not_the_images_fault(
    bucket: Bucket, store: Server, small_survey: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("survey.stored.PATIENCE_S", 0.0)
    url = bucket.upload(small_survey, "survey")
    with regular_file(f"{url}/01.jpg") as opened:
        store.stop()
        for look in (opened.read, lambda: decode_image(f"{url}/00.jpg")):
            with pytest.raises(TaskFailed, match="store is up"):
                look()
    try:
        with pytest.raises(BadSurvey, match="does not answer"):
            read_survey(place_of(url), METRES)
    finally:
        store.start()
    assert decode_image(f"{url}/00.jpg").width_px == 320


def test_a_store_that_comes_back_is_waited_for(
    bucket: Bucket, store: Server, small_survey: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("survey.stored._RETRY_S", 0.1)
    url = bucket.upload(small_survey, "survey")
    store.stop()
    with ThreadPoolExecutor(1) as pool:
        decoded = pool.submit(decode_image, f"{url}/00.jpg")
        try:
            with pytest.raises(TimeoutError):
                decoded.result(timeout=0.5)
        finally:
            store.start()
        assert decoded.result().width_px == 320


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("s3://key:secret@bucket/survey", "environment|variables"),
        ("foo://bucket/survey", "foo:// are not known"),
        ("s3://", "no URL"),
        ("simplecache::s3://bucket/survey", "no URL"),
    ],
)
def test_a_url_that_cannot_be_read_is_refused(text: str, said: str) -> None:
    with pytest.raises(BadConfig, match=said) as refused:
        place_of(text)
    assert "secret" not in str(refused.value)


@pytest.mark.parametrize("place", ["nothing-here", "missing"])
def test_a_survey_that_is_not_in_the_store_is_named(bucket: Bucket, place: str) -> None:
    url = bucket.url("none") if place == "missing" else f"s3://{place}/survey"
    with pytest.raises(BadSurvey, match=url):
        read_survey(place_of(url), METRES)
