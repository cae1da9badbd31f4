"""`flaneur add`, `compact` and `rollback`, and `index` once more, as a person uses them."""

import json
import re
import shutil
from pathlib import Path

import pytest
from index_shop import OPTIONS, Shop
from PIL import Image

from index.commits import working, writing
from index.jobs import JobFolder
from index.manifest import generation_numbers, read_generation
from index.opened import OpenedIndex


@pytest.fixture
def more(small_survey: Path, tmp_path: Path) -> Path:
    """The small survey and one image more."""
    folder = Path(shutil.copytree(small_survey, tmp_path / "more"))
    mirrored = Image.open(folder / "03.jpg").transpose(Image.Transpose.FLIP_LEFT_RIGHT)
    mirrored.save(folder / "10.jpg")
    with (folder / "poses.csv").open("a") as table:
        table.write("10.jpg,652040,6862000,40,90,0,0,2020-05-01T10:00:10Z\n")
    return folder


def test_nothing_new_changes_nothing(shop: Shop, small_survey: Path) -> None:
    code, said = shop.say("add", small_survey, shop.root, "--crs", "EPSG:2154")
    assert code == 0
    assert "nothing new, and nothing was changed, 10 were there already; generation 1" in said
    assert generation_numbers(shop.root) == (1,)


def test_a_survey_is_added_under_its_name(shop: Shop, more: Path) -> None:
    code, said = shop.say("add", more, shop.root, "--crs", "EPSG:2154")
    assert code == 2
    assert "has an image '00.jpg' already" in said
    told = shop.ask("add", more, shop.root, "--name", "year2", "--crs", "EPSG:2154")
    assert (told["added"], told["known"], told["images"]) == (11, 0, 21)
    assert [each.name for each in read_generation(shop.root).surveys] == ["", "year2"]


def test_an_image_that_cannot_be_read_is_named_each_time(shop: Shop, more: Path) -> None:
    (more / "10.jpg").write_bytes(b"no picture")
    add = ("add", more, shop.root, "--name", "b", "--crs", "EPSG:2154")
    code, said = shop.say(*add)
    assert code == 3
    assert "b/10.jpg" in said
    assert "10 images added" in said
    code, said = shop.say(*add)
    assert code == 3
    assert "b/10.jpg" in said
    assert "nothing was changed" in said
    assert read_generation(shop.root).number == 2


@pytest.mark.parametrize("name", ["a/b", "..", "."])
def test_a_name_is_no_path(shop: Shop, more: Path, name: str) -> None:
    code, said = shop.say("add", more, shop.root, "--name", name)
    assert code == 2
    assert "--name takes" in said


def test_images_without_poses_are_added_and_that_is_told(shop: Shop, more: Path) -> None:
    code, said = shop.say("add", more, shop.root, "--name", "old", "--no-pose")
    assert code == 0
    assert "11 of the new images have no pose" in said
    generation = read_generation(shop.root)
    assert (generation.crs, generation.n_live) == ("EPSG:2154", 21)
    assert generation.area == read_generation(shop.root, 1).area


def test_poses_can_come_later(more: Path, tmp_path: Path, same_engine: None) -> None:
    shop = Shop(tmp_path / "unposed")
    shop.say("index", more, shop.root, "--no-pose", *OPTIONS[2:])
    assert read_generation(shop.root).crs is None
    code, said = shop.say("add", more, shop.root, "--name", "b", "--crs", "EPSG:2154")
    assert code == 0
    assert "The images of the index have no poses" in said
    generation = read_generation(shop.root)
    assert generation.crs == "EPSG:2154"
    assert generation.area is not None


def test_a_channel_without_words_stays_without(
    more: Path, tmp_path: Path, same_engine: None
) -> None:
    blank = tmp_path / "blank"
    blank.mkdir()
    Image.new("RGB", (320, 240), "grey").save(blank / "0.png")
    shop = Shop(tmp_path / "wordless")
    assert shop.say("index", blank, shop.root, "--no-pose", *OPTIONS[2:])[0] == 0
    told = shop.ask("add", more, shop.root, "--name", "b", "--crs", "EPSG:2154")
    assert (told["added"], told["postings"], told["warnings"]) == (11, 0, [])


def test_words_that_no_longer_fit_are_told(shop: Shop, more: Path) -> None:
    """The index is made to say that its own images are ten times as near to their words."""
    live = read_generation(shop.root)
    near = {name: mean / 10 for name, mean in live.segments[0].quantisation.items()}
    segments = (live.segments[0].model_copy(update={"quantisation": near}),)
    with writing(shop.root) as writer:
        number = writer.next_number()
        writer.commit(live.model_copy(update={"number": number, "segments": segments}))
    (warning,) = shop.ask("add", more, shop.root, "--crs", "EPSG:2154", "--name", "b")["warnings"]
    assert "The words do not fit the new images" in warning
    assert re.search(r"hesaff-sift \(1?\d\.\d times\)", warning)
    assert "index them together into a new folder" in warning


def test_indexing_more_images_says_that_they_can_be_added(shop: Shop, small_survey: Path) -> None:
    some = ("--include", "0[0-4].jpg", *OPTIONS)
    code, said = shop.say("index", small_survey, shop.root, *some)
    assert code == 0
    assert "holds 10 images (generation 1), which will be replaced" in said
    assert "flaneur add" not in said
    assert read_generation(shop.root).n_live == 5
    code, said = shop.say("index", small_survey, shop.root, "--exclude", "09.jpg", *OPTIONS)
    assert "To add only the 4 new images, stop this and use `flaneur add`" in said


def test_indexing_again_mends_what_is_missing(shop: Shop, small_survey: Path) -> None:
    lost = shop.root / "segments" / "0001" / "hesaff-sift" / "packed.npy"
    content = lost.read_bytes()
    lost.unlink()
    code, said = shop.say("index", small_survey, shop.root, "--shard-size", "4", *OPTIONS)
    assert code == 0
    assert "is damaged, and will be replaced" in said
    assert lost.read_bytes() == content
    OpenedIndex(shop.root)


def test_what_replaces_a_damaged_index_need_not_read_it(shop: Shop, small_survey: Path) -> None:
    catalogue = shop.root / "catalogue" / "0001.parquet"
    catalogue.write_bytes(bytes(catalogue.stat().st_size))
    code, said = shop.say("index", small_survey, shop.root, "--include", "0[0-4].jpg", *OPTIONS)
    assert code == 0
    assert "is damaged, and will be replaced" in said
    assert read_generation(shop.root).n_live == 5


def test_indexing_again_does_not_undo_what_came_later(shop: Shop, small_survey: Path) -> None:
    shop.ask("remove", shop.root, "03.jpg")
    (shop.root / "segments" / "0001" / "hesaff-sift" / "packed.npy").unlink()
    code, said = shop.say("index", small_survey, shop.root, *OPTIONS)
    assert code == 2
    assert "packed.npy is missing" in said
    assert read_generation(shop.root).number == 2


def test_going_back_brings_removed_images_back(shop: Shop) -> None:
    shop.ask("remove", shop.root, "03.jpg")
    told = shop.ask("rollback", shop.root)
    assert (told["generation"], told["made_by"], told["images"]) == (1, "index", 10)
    assert shop.ask("rollback", shop.root, "--to", "2")["images"] == 9
    code, said = shop.say("rollback", shop.root, "--to", "7")
    assert code == 2
    assert "has no generation 7; there are: 1, 2" in said


def test_compacting_twice_does_nothing_the_second_time(shop: Shop) -> None:
    shop.ask("remove", shop.root, "03.jpg")
    told = shop.ask("compact", shop.root)
    assert (told["generation"], told["images"], told["dropped"]) == (3, 9, 1)
    code, said = shop.say("compact", shop.root)
    assert code == 0
    assert "one segment with nothing removed already" in said
    assert generation_numbers(shop.root) == (1, 2, 3)


def test_pruning_leaves_what_the_live_generation_needs(shop: Shop) -> None:
    shop.ask("remove", shop.root, "03.jpg")
    (shop.root / "notes.txt").write_text("mine")
    before = sum(path.stat().st_size for path in shop.root.rglob("*") if path.is_file())
    told = shop.ask("compact", shop.root, "--prune")
    live = read_generation(shop.root)
    assert told["pruned_generations"] == [1, 2]
    assert told["pruned_bytes"] > 0
    assert sum(path.stat().st_size for path in shop.root.rglob("*") if path.is_file()) < before
    assert generation_numbers(shop.root) == (3,)
    left = {path.relative_to(shop.root).as_posix() for path in shop.root.rglob("*.npy")}
    assert left == {name for name in live.files if name.endswith(".npy")}
    assert {path.name for path in shop.root.iterdir()} == {
        *("CURRENT", ".lock", "notes.txt", "generations", "catalogue", "codebooks", "segments"),
        "jobs",
    }
    assert {path.name for path in (shop.root / "jobs").iterdir()} == set(live.segments[0].jobs)
    OpenedIndex(shop.root)
    code, said = shop.say("rollback", shop.root)
    assert code == 2
    assert "has no generation before 3" in said


def test_pruning_spares_a_job_that_is_worked_on_and_later_generations(shop: Shop) -> None:
    shop.ask("remove", shop.root, "03.jpg")
    shop.ask("rollback", shop.root)
    job = JobFolder(shop.root, "0123456789abcdef")
    other = next((shop.root / "jobs").iterdir())
    shutil.copytree(other, job.path)
    plan = json.loads((other / "plan.json").read_bytes())
    (job.path / "plan.json").write_text(json.dumps({**plan, "job": job.job, "segment": "0009"}))
    half = shop.root / "segments" / "0009" / "hesaff-sift" / "counts.npy"
    half.parent.mkdir(parents=True)
    half.write_bytes(b"half")
    with working(job):
        shop.ask("compact", shop.root, "--prune")
        assert half.exists()
        assert job.has_plan()
    told = shop.ask("compact", shop.root, "--prune")
    assert not half.exists()
    assert not job.path.exists()
    assert told["pruned_bytes"] > 4
    assert generation_numbers(shop.root) == (1, 2)
    assert shop.ask("rollback", shop.root, "--to", "2")["images"] == 9


@pytest.mark.parametrize("verb", ["add", "remove", "compact", "rollback"])
def test_what_is_no_index_is_refused_and_left_alone(
    tmp_path: Path, small_survey: Path, verb: str
) -> None:
    folder = tmp_path / "folder"
    folder.mkdir()
    shop = Shop(folder)
    code, said = shop.say(verb, *([small_survey] if verb == "add" else []), folder)
    assert code == 2
    assert "is not a Flaneur index" in said
    assert not list(folder.iterdir())
