"""Estimates on canvases, as the navPlace extension of IIIF Presentation 3 has it."""

import json
from pathlib import Path
from typing import Any

import geojson_pydantic
import pytest
from typer.testing import CliRunner

from contracts.errors import WrongInput
from coordinator.cli.main import main
from coordinator.export.geojson import write_geojson
from coordinator.export.json_files import read_json, read_results
from coordinator.export.navplace import NAVPLACE, PRESENTATION_3, with_places
from geo.geojson import (
    Feature,
    PlacedEstimate,
    PlacedTarget,
    error_feature,
    estimate_feature,
    target_feature,
)

Json = dict[str, Any]
IMAGES = "https://iiif.io/api/image/3.0/example/reference"


def canvas(number: int, image: str = "scan.jpg", label: str = "", **more: object) -> Json:
    """As in section 4 of the extension: an image of a IIIF service painted on a canvas."""
    here = f"https://example.org/iiif/canvas/p{number}"
    body = {
        "id": f"{IMAGES}/{image}/full/max/0/default.jpg",
        "type": "Image",
        "format": "image/jpeg",
        "service": [{"id": f"{IMAGES}/{image}", "profile": "level1", "type": "ImageService3"}],
    }
    annotation = {"id": f"{here}/a", "type": "Annotation", "motivation": "painting", "target": here}
    return {
        "id": here,
        "type": "Canvas",
        "label": {"en": [label or f"Leaf {number}"]},
        "height": 3024,
        "width": 4032,
        "items": [
            {"id": f"{here}/1", "type": "AnnotationPage", "items": [{**annotation, "body": body}]}
        ],
        **more,
    }


def manifest(*canvases: Json, context: object = PRESENTATION_3) -> Json:
    return {
        "@context": context,
        "id": "https://example.org/iiif/manifest/1",
        "type": "Manifest",
        "label": {"fr": ["Cartes postales, été 1910"]},
        "items": list(canvases),
    }


def estimate(query: str, **known: Any) -> Feature:
    return estimate_feature(
        PlacedEstimate(query, 2.3365, 48.85, 12.3456, 4, ("hesaff", "star"), 2, **known)
    )


def placed_on(number: int, *canvases: Json, query: str) -> bool:
    result = with_places(manifest(*canvases), [estimate(query)], "m.json")
    has = ["navPlace" in each for each in result.manifest["items"]]
    return has == [at == number for at in range(len(canvases))]


@pytest.mark.parametrize(
    ("query", "image"),
    [
        ("photos/918ecd18-göttingen.jpg", "918ecd18-g%C3%B6ttingen"),
        ("photos/918ecd18-go\u0308ttingen.tif", "918ecd18-göttingen"),
        ("a/IMG_1.jpg", "IMG_1.jpg"),
        ("a/IMG_1.png", "IMG_1.jpg"),
        ("IMG_1.jpg", "archive%2FIMG_1.jpg"),
        ("C:\\scans\\IMG_1.jpg", "IMG_1"),
        ("明信片.jpg", "明信片"),
    ],
)
def test_a_canvas_is_found_by_its_image(query: str, image: str) -> None:
    assert placed_on(1, canvas(1), canvas(2, image), canvas(3), query=query)


def test_a_canvas_is_found_by_its_id_and_by_its_label() -> None:
    leaves = canvas(1), canvas(2, label="Place du Panthéon")
    assert placed_on(0, *leaves, query="https://example.org/iiif/canvas/p1")
    assert placed_on(1, *leaves, query="cartes/Place du Panthéon.jpg")


def test_a_canvas_is_found_by_a_plain_image_without_a_service() -> None:
    plain = canvas(2)
    plain["items"][0]["items"][0]["body"] = {"id": "https://x.org/f/a%20b.jpg", "type": "Image"}
    assert placed_on(1, canvas(1), plain, query="a b.jpg")


def test_the_place_is_a_feature_collection_on_the_canvas() -> None:
    (changed,) = with_places(
        manifest(canvas(1, "a.jpg")),
        [estimate("a.jpg"), target_feature(PlacedTarget("a.jpg", 2.0, 48.0, 3.0, 3))],
        "m.json",
    ).manifest["items"]
    place = changed["navPlace"]
    geojson_pydantic.FeatureCollection.model_validate(place)
    assert place == {
        "type": "FeatureCollection",
        "features": [
            {
                "type": "Feature",
                "properties": {
                    "label": {"en": ["Estimated place of the photographer, within 12 m"]}
                },
                "geometry": {"type": "Point", "coordinates": [2.3365, 48.85]},
            }
        ],
    }


@pytest.mark.parametrize(
    ("context", "expected"),
    [
        (PRESENTATION_3, [NAVPLACE, PRESENTATION_3]),
        (["http://x.org/own.json", PRESENTATION_3], [NAVPLACE, "http://x.org/own.json"]),
        ([NAVPLACE, PRESENTATION_3], [NAVPLACE, PRESENTATION_3]),
    ],
)
def test_the_context_of_the_extension_stands_before_that_of_iiif(
    context: object, expected: list[str]
) -> None:
    given = manifest(canvas(1, "a.jpg"), context=context)
    found = with_places(given, [estimate("a.jpg")], "m.json").manifest["@context"]
    assert found[:2] == expected
    assert found[-1] == PRESENTATION_3


def test_nothing_else_is_changed_nor_what_was_given() -> None:
    given = manifest(canvas(1, "a.jpg", seeAlso=[1, None, 2.5]), canvas(2, "b.jpg"))
    before = json.dumps(given)
    changed = with_places(given, [estimate("a.jpg")], "m.json").manifest
    assert json.dumps(given) == before
    changed["@context"] = PRESENTATION_3
    del changed["items"][0]["navPlace"]
    assert json.dumps(changed) == before


def test_what_is_on_no_canvas_is_said() -> None:
    leaves = [
        canvas(1, "a.jpg"),
        canvas(2, "twice.jpg"),
        canvas(3, "twice.png"),
        canvas(4, "old.jpg", navPlace={"type": "FeatureCollection", "features": []}),
    ]
    features = [
        estimate("a.jpg"),
        estimate("gone.jpg"),
        estimate("twice.jpg", in_survey=True),
        estimate("old.jpg"),
        estimate("elsewhere.jpg", in_survey=False),
        error_feature("broken.jpg", "truncated"),
        target_feature(PlacedTarget("vague.jpg", 2.0, 48.0, 3.0, 3)),
    ]
    result = with_places(manifest(*leaves), features, "m.json")
    assert result.n_placed == 1
    assert {each.uri: each.reason for each in result.left_out} == {
        "gone.jpg": "no canvas has its name",
        "twice.jpg": "2 canvases have its name; rename the photo as the image of its canvas",
        "old.jpg": "its canvas has a navPlace already, which is kept",
        "elsewhere.jpg": "nothing in the survey stands out as its place",
        "broken.jpg": "truncated",
        "vague.jpg": "there is no estimate of its place",
    }
    assert result.manifest["items"][3] == leaves[3]


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ({"@context": "http://iiif.io/api/presentation/2/context.json"}, "Presentation 2"),
        ({"@type": "sc:Manifest"}, "Presentation 2"),
        ({"type": "Collection"}, "not a collection"),
        ({"@context": "http://schema.org"}, "no manifest of IIIF Presentation 3"),
        ({"items": None}, "no list of canvases"),
    ],
)
def test_what_is_no_manifest_of_presentation_3_is_refused(wrong: Json, says: str) -> None:
    with pytest.raises(WrongInput, match=says):
        with_places({**manifest(canvas(1, "a.jpg")), **wrong}, [estimate("a.jpg")], "m.json")


def test_a_manifest_of_other_photos_is_refused_with_the_names_of_both() -> None:
    with pytest.raises(WrongInput, match=r"'IMG_7\.jpg': no canvas .* first of 1 is called 'Leaf"):
        with_places(manifest(canvas(1)), [estimate("IMG_7.jpg")], "m.json")


@pytest.mark.parametrize("odd", [None, 3, "text", [], {"items": 3}, {"items": [None, {"body": 1}]}])
def test_odd_canvases_are_passed_over(odd: object) -> None:
    given = manifest(canvas(1, "a.jpg"))
    given["items"].append(odd)
    assert with_places(given, [estimate("a.jpg")], "m.json").manifest["items"][1] == odd


def export(tmp_path: Path, results: bytes, given: bytes) -> tuple[int, str, Path]:
    names = tmp_path / "results.geojson", tmp_path / "manifest.json", tmp_path / "out.json"
    names[0].write_bytes(results)
    names[1].write_bytes(given)
    arguments = ["export", "navplace", *map(str, names[:2]), "--out", str(names[2])]
    told = CliRunner().invoke(main, arguments)
    return told.exit_code, told.stderr, names[2]


def test_the_command_writes_the_manifest_and_says_what_is_left_out(tmp_path: Path) -> None:
    write_geojson(tmp_path / "r", [estimate("é.jpg"), estimate("gone\udce9.jpg")])
    given = json.dumps(manifest(canvas(1, "é.jpg", label="\ud800"))).encode()
    code, said, out = export(tmp_path, (tmp_path / "r").read_bytes(), given)
    assert code == 3
    assert "1 of 2 queries placed" in said
    assert "no canvas has its name" in said
    written = json.loads(out.read_bytes())
    assert "navPlace" in written["items"][0]
    assert written["label"] == {"fr": ["Cartes postales, été 1910"]}
    assert "été" in out.read_text("utf-8")


GOOD = json.dumps(manifest(canvas(1, "a.jpg"))).encode()
OURS = b'{"type":"FeatureCollection","features":[%s]}'


@pytest.mark.parametrize(
    ("results", "given", "says"),
    [
        (b"", GOOD, "is no JSON"),
        (OURS % b'{"a":NaN}', GOOD, "NaN is no number of JSON"),
        (OURS % b'{"a":1e999}', GOOD, "1e999 is no number of JSON"),
        (b"\xff\xfe", GOOD, "is not UTF-8"),
        (b"[" * 100_000, GOOD, "nested too deeply"),
        (b"[]", GOOD, "holds no JSON object"),
        (b'{"type":"Feature"}', GOOD, "no GeoJSON feature collection"),
        (OURS % b"null", GOOD, "feature 0: it has no properties"),
        (OURS % b'{"properties":{"name":"x"}}', GOOD, "feature 0: it has no query and kind"),
        (
            OURS % b'{"properties":{"query":"a.jpg","kind":"estimate"}}',
            GOOD,
            "radius_m is None, expected metres",
        ),
        (
            OURS % b'{"properties":{"query":"a.jpg","kind":"estimate","radius_m":1},"geometry":'
            b'{"type":"Point","coordinates":[652000,6862000]}}',
            GOOD,
            "no point in longitude and latitude",
        ),
        (OURS % b"", GOOD, "No query in the results"),
        (OURS % b"", b"{", "manifest.json is no JSON"),
        (OURS % b"", b"{}", "no manifest of IIIF Presentation 3"),
    ],
)
def test_input_that_does_not_hold_is_named(
    tmp_path: Path, results: bytes, given: bytes, says: str
) -> None:
    code, said, out = export(tmp_path, results, given)
    assert says in said.replace("\n", "")
    assert code == 2
    assert not out.exists()


def test_a_byte_order_mark_is_read_over(tmp_path: Path) -> None:
    path = tmp_path / "r.geojson"
    path.write_bytes(b"\xef\xbb\xbf" + OURS % json.dumps(estimate("a.jpg")).encode())
    assert read_results(path) == [estimate("a.jpg")]


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(WrongInput, match=r"gone\.json cannot be read: No such file"):
        read_json(tmp_path / "gone.json")


def test_one_name_in_a_long_manifest_is_found() -> None:
    leaves = [canvas(number, f"{number:05d}.jpg") for number in range(3000)]
    result = with_places(manifest(*leaves), [estimate("x" * 5000), estimate("02718.jpg")], "m.json")
    assert result.n_placed == 1
    assert "navPlace" in result.manifest["items"][2718]
