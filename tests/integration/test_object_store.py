"""A survey in an object store, and an index in one, do what their copies in folders do."""

import json
from contextlib import nullcontext
from pathlib import Path

import pytest
from index_shop import CONFIG, Shop
from object_store import Bucket

from contracts.places import Place, place_of
from coordinator.cli.show import Bars
from coordinator.engine.running import Engine
from coordinator.indexing import run_job
from coordinator.intake import read_surveys
from coordinator.plan import make_plan
from index.manifest import Generation
from index.store import publish
from survey import ReadOptions


@pytest.fixture(autouse=True)
def _own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


def index(survey: Place, root: Path, engine: Engine) -> Generation:
    intake = read_surveys([("", survey)], ReadOptions(crs="EPSG:2154"))
    job, plan = make_plan(root, intake, CONFIG, 4)
    return run_job(job, plan, intake, nullcontext(engine), Bars(None)).generation


def made_by_words(generation: Generation) -> dict[str, str]:
    """Digests of all but the catalogue, which says where the images are."""
    return {
        name: entry.sha256
        for name, entry in generation.files.items()
        if not name.startswith("catalogue/")
    }


def test_a_survey_in_a_store_becomes_the_same_index(
    small_survey: Path, original: Path, bucket: Bucket, tmp_path: Path, engine: Engine
) -> None:
    from index.manifest import read_generation

    url = bucket.upload(small_survey, "survey")
    generation = index(place_of(url), tmp_path / "index", engine)
    assert generation.n_images == 10
    assert generation.surveys[0].path == url
    assert made_by_words(generation) == made_by_words(read_generation(original))


def test_the_same_survey_in_a_store_comes_back_to_its_job(
    small_survey: Path, bucket: Bucket, tmp_path: Path
) -> None:
    url = bucket.upload(small_survey, "survey")

    def job() -> str:
        intake = read_surveys([("", place_of(url))], ReadOptions(crs="EPSG:2154"))
        return make_plan(tmp_path / "index", intake, CONFIG, 4)[0].job

    first = job()
    assert job() == first
    bucket.put("survey/03.jpg", bucket.get("survey/04.jpg"))
    assert job() != first


def test_photos_are_located_by_url_as_in_the_folder(
    shop: Shop, small_survey: Path, bucket: Bucket, tmp_path: Path
) -> None:
    url = bucket.url("town")
    publish(shop.root, place_of(url), Bars(None))
    found = []
    for place in (shop.root, url):
        out = tmp_path / "out.geojson"
        code, said = shop.say(
            "locate", small_survey / "03.jpg", "--index", str(place), "--out", out
        )
        assert code == 0, said
        found.append(json.loads(out.read_text()))
        out.unlink()
    assert found[0]["features"] == found[1]["features"]
    assert [each.pop("flaneur")["index"] for each in found] == [str(shop.root), url]


def test_an_index_by_url_is_told_of_and_verified(shop: Shop, bucket: Bucket) -> None:
    url = bucket.url("town")
    publish(shop.root, place_of(url), Bars(None))
    state = shop.ask("status", url, "--json")
    assert (state["index"], state["live"], state["faults"]) == (url, 1, [])
    assert shop.ask("verify", url, "--json")["sound"] == [1]


@pytest.mark.parametrize(
    "arguments", [("remove", "URL", "00.jpg"), ("compact", "URL"), ("rollback", "URL")]
)
def test_an_index_in_a_store_is_not_changed_there(
    shop: Shop, bucket: Bucket, arguments: tuple[str, ...]
) -> None:
    url = bucket.url("town")
    code, said = shop.say(*(url if each == "URL" else each for each in arguments))
    assert code == 2
    assert "publish" in said
    assert not Path("s3:").exists()
    assert not bucket.sizes()
