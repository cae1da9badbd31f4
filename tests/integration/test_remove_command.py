"""`flaneur remove` as a person uses it."""

import pytest
from index_shop import Shop

from index.manifest import generation_numbers, read_generation
from index.opened import OpenedIndex


def test_images_are_removed_by_name_number_glob_date_and_place(shop: Shop) -> None:
    root = shop.root
    assert shop.ask("remove", root, "03.jpg")["removed"] == ["03.jpg"]
    assert shop.ask("remove", root, "--id", "4")["removed"] == ["04.jpg"]
    assert shop.ask("remove", root, "--glob", "*[05].jpg")["removed"] == ["00.jpg", "05.jpg"]
    late = ("--since", "2020-05-01T10:00:09Z")
    assert shop.ask("remove", root, *late)["removed"] == ["09.jpg"]
    index = OpenedIndex(root)
    assert index.to_wgs84 is not None
    (lon,), (lat,) = index.to_wgs84.lon_lat([652004.0], [6862000.0])
    box = ",".join(f"{each:.7f}" for each in (lon - 1e-5, lat - 1e-5, lon + 1e-5, lat + 1e-5))
    told = shop.ask("remove", root, f"--bbox={box}")
    assert told == {"generation": 6, "removed": ["01.jpg"], "images": 4}
    (segment,) = read_generation(root).segments
    assert (segment.n_images, segment.n_removed, segment.tombstones) == (10, 6, "000006")


def test_all_that_is_given_must_hold(shop: Shop) -> None:
    told = shop.ask("remove", shop.root, "03.jpg", "04.jpg", "--until", "2020-05-01T10:00:03Z")
    assert told["removed"] == ["03.jpg"]


def test_a_dry_run_says_what_would_be_removed(shop: Shop) -> None:
    code, said = shop.say("remove", shop.root, "--glob", "0[12].jpg", "--dry-run")
    assert code == 0
    assert "  01.jpg\n  02.jpg\n" in said
    assert "these 2 would be removed, 8 would be left" in said
    assert generation_numbers(shop.root) == (1,)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ((), "Say which images are to be removed"),
        (("1.jpg",), "has no image '1.jpg'. Is '01.jpg' meant?"),
        (("--id", "10"), "has no image 10; ids run from 0 to 9"),
        (("--glob", "*"), "every one of the 10 images"),
        (("--survey", "elsewhere"), "no such survey"),
    ],
)
def test_what_cannot_be_meant_is_refused(shop: Shop, arguments: tuple[str, ...], says: str) -> None:
    code, said = shop.say("remove", shop.root, *arguments)
    assert code == 2
    assert says in said
    assert generation_numbers(shop.root) == (1,)


def test_an_image_is_not_removed_twice(shop: Shop) -> None:
    shop.ask("remove", shop.root, "03.jpg")
    assert shop.say("remove", shop.root, "03.jpg")[0] == 2
    code, said = shop.say("remove", shop.root, "--id", "3")
    assert code == 2
    assert "has been removed already" in said
    code, said = shop.say("remove", shop.root, "--glob", "03.*")
    assert code == 0
    assert "nothing was changed" in said
    assert read_generation(shop.root).number == 2
