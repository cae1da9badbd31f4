"""Photos of IIIF manifests and collections of both versions, and how their images are asked for."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from photo_server import Answer, PhotoServer, serving_photos

from contracts.errors import WrongInput
from coordinator.batches.fetching import Bounds, Fetcher, Unfetched
from coordinator.batches.image_api import image_url
from coordinator.batches.manifests import fetched_photo
from coordinator.batches.photos import Photo
from coordinator.batches.sources import read_sources

Json = dict[str, Any]
PRESENTATION_3 = "http://iiif.io/api/presentation/3/context.json"
LEVEL_2 = {"type": "ImageService3", "profile": "level2"}
QUICK = Bounds(pause_s=0.01, connect_s=2.0, silence_s=2.0)


@pytest.fixture
def server() -> Iterator[PhotoServer]:
    with serving_photos() as serving:
        yield serving


@pytest.fixture
def fetcher() -> Iterator[Fetcher]:
    with Fetcher(QUICK) as each:
        yield each


def body(host: str, name: str, service: Json | None = None) -> Json:
    found: Json = {"id": f"{host}/{name}/full/max/0/default.jpg", "type": "Image"}
    return found if service is None else {**found, "service": [{"id": f"{host}/{name}", **service}]}


def canvas(host: str, name: str, label: object, painted: Json | None) -> Json:
    note = {"type": "Annotation", "motivation": "painting", "body": painted}
    pages = [{"type": "AnnotationPage", "items": [note] if painted else []}]
    return {"id": f"{host}/canvas/{name}", "type": "Canvas", "label": label, "items": pages}


def manifest(host: str, name: str, *canvases: Json) -> Json:
    return {
        "@context": PRESENTATION_3,
        "id": f"{host}/{name}",
        "type": "Manifest",
        "label": {"none": [name]},
        "items": list(canvases),
    }


def put_json(server: PhotoServer, path: str, document: Json) -> str:
    content = json.dumps(document).encode()
    return server.put(path, Answer(content, kind="application/ld+json"))


def photos(document: Json, tmp_path: Path, fetcher: Fetcher) -> list[Photo]:
    file = tmp_path / "manifest.json"
    file.write_text(json.dumps(document), "utf-8")
    return read_sources([str(file)], fetcher)


def test_canvases_of_version_3_are_photos_by_their_labels(tmp_path: Path, fetcher: Fetcher) -> None:
    host = "https://example.org"
    choice = {"type": "Choice", "items": [body(host, "day", LEVEL_2), body(host, "night")]}
    part = {"type": "SpecificResource", "source": body(host, "part", LEVEL_2)}
    found = photos(
        manifest(
            host,
            "m",
            canvas(host, "1", {"fr": ["Rue de la  Paix"], "en": ["Peace street"]}, body(host, "a")),
            canvas(host, "2", {"none": ["Été"]}, choice),
            canvas(host, "3", None, part),
            canvas(host, "4", {"none": ["blank"]}, None),
        ),
        tmp_path,
        fetcher,
    )
    assert [each.query for each in found] == ["Peace street", "Été", f"{host}/canvas/3", "blank"]
    assert found[0].urls == (f"{host}/a/full/max/0/default.jpg",)
    assert found[1].urls[0] == f"{host}/day/full/!2048,2048/0/default.jpg"
    assert found[2].urls[0] == f"{host}/part/full/!2048,2048/0/default.jpg"
    assert found[3].error == "no image is painted on its canvas"


def test_canvases_of_version_2_are_photos_by_their_labels(tmp_path: Path, fetcher: Fetcher) -> None:
    host = "https://example.org"
    service = {
        "@context": "http://iiif.io/api/image/2/context.json",
        "@id": f"{host}/a",
        "profile": "http://iiif.io/api/image/2/level2.json",
    }
    resource = {"@id": f"{host}/a.jpg", "@type": "dctypes:Image", "service": service}
    choice = {"@type": "oa:Choice", "default": resource, "item": [{"@id": "x"}]}
    canvases = [
        {"@id": f"{host}/c1", "@type": "sc:Canvas", "label": "1r", "images": [{"resource": each}]}
        for each in (resource, choice)
    ]
    canvases[1] |= {"@id": f"{host}/c2", "label": [{"@value": "1v", "@language": "la"}]}
    found = photos(
        {"@type": "sc:Manifest", "@id": f"{host}/m", "sequences": [{"canvases": canvases}]},
        tmp_path,
        fetcher,
    )
    assert [each.query for each in found] == ["1r", "1v"]
    size = "full/!2048,2048/0/default.jpg"
    assert {each.urls for each in found} == {(f"{host}/a/{size}", f"{host}/a.jpg")}


def test_canvases_of_one_label_are_called_by_their_ids(tmp_path: Path, fetcher: Fetcher) -> None:
    host = "https://example.org"
    found = photos(
        manifest(
            host,
            "m",
            *(canvas(host, each, {"none": ["[photo]"]}, body(host, each)) for each in "ab"),
            canvas(host, "c", {"none": ["c"]}, body(host, "c")),
        ),
        tmp_path,
        fetcher,
    )
    assert [each.query for each in found] == [f"{host}/canvas/a", f"{host}/canvas/b", "c"]


def test_a_collection_lists_manifests_elsewhere_and_one_that_is_gone_stops_no_other(
    server: PhotoServer, fetcher: Fetcher
) -> None:
    host = server.url
    first = manifest(host, "m1", canvas(host, "1", {"none": ["one"]}, body(host, "a")))
    put_json(server, "/m1", first)
    inner = {
        "type": "Collection",
        "id": f"{host}/inner",
        "items": [
            {"id": f"{host}/m1", "type": "Manifest"},
            {"id": f"{host}/", "type": "Collection"},
        ],
    }
    put_json(server, "/inner", inner)
    url = put_json(
        server,
        "/",
        {
            "type": "Collection",
            "id": f"{host}/",
            "items": [
                {"id": f"{host}/gone", "type": "Manifest"},
                {"id": f"{host}/inner", "type": "Collection"},
                manifest(host, "m2", canvas(host, "2", {"none": ["two"]}, body(host, "b"))),
            ],
        },
    )
    found = read_sources([url], fetcher)
    assert [each.query for each in found] == [f"{host}/gone", "one", "two"]
    assert "its server says 404" in found[0].error
    assert server.asked["/inner"] == server.asked["/m1"] == 1


def test_a_collection_of_version_2_lists_its_pages(server: PhotoServer, fetcher: Fetcher) -> None:
    host = server.url
    image = {"resource": {"@id": f"{host}/a.jpg", "@type": "dctypes:Image"}}
    shown = {"@id": f"{host}/c", "@type": "sc:Canvas", "label": "one", "images": [image]}
    book = {"@type": "sc:Manifest", "@id": f"{host}/m", "sequences": [{"canvases": [shown]}]}
    put_json(server, "/m", book)
    listed = {"@type": "sc:Collection", "@id": f"{host}/p2"}
    put_json(
        server,
        "/p2",
        {**listed, "manifests": [{"@id": f"{host}/m", "@type": "sc:Manifest"}]},
    )
    first = {"@type": "sc:Collection", "@id": f"{host}/p1", "first": f"{host}/p2"}
    (found,) = read_sources([put_json(server, "/p1", first)], fetcher)
    assert (found.query, found.urls) == ("one", (f"{host}/a.jpg",))


def service(version: int, level: int, **known: object) -> Json:
    if version == 3:
        return {
            "id": "https://i.org/a",
            "type": "ImageService3",
            "profile": f"level{level}",
            **known,
        }
    context = {1: "http://library.stanford.edu/iiif/image-api/1.1/context.json"}.get(
        version, "http://iiif.io/api/image/2/context.json"
    )
    return {"@context": context, "@id": "https://i.org/a", "profile": [f"x#level{level}"], **known}


SIZES = [{"width": 300, "height": 200}, {"width": 3000, "height": 2000}]


@pytest.mark.parametrize(
    ("told", "asked"),
    [
        (service(3, 2), "full/!2048,2048/0/default.jpg"),
        (service(2, 2, width=9000, height=6000), "full/!2048,2048/0/default.jpg"),
        (service(2, 2, width=900, height=600), "full/full/0/default.jpg"),
        (service(3, 2, width=900, height=600), "full/max/0/default.jpg"),
        (service(3, 1, width=9000, height=6000), "full/2048,/0/default.jpg"),
        (service(2, 1, width=6000, height=9000), "full/1365,/0/default.jpg"),
        (service(3, 0, width=9000, height=6000, sizes=SIZES), "full/3000,2000/0/default.jpg"),
        (service(2, 0, width=9000, height=6000, sizes=SIZES), "full/3000,/0/default.jpg"),
        (service(3, 0, width=9000, height=6000, sizes=SIZES[:1]), "full/300,200/0/default.jpg"),
        (service(2, 0, width=9000, height=6000, tiles=[]), "full/full/0/default.jpg"),
        (service(1, 1, width=9000, height=6000), "full/2048,/0/native.jpg"),
    ],
)
def test_an_image_is_asked_for_no_larger_than_its_server_can_make_it(
    told: Json, asked: str
) -> None:
    assert image_url(told, 0, 0, 2048) == f"https://i.org/a/{asked}"


@pytest.mark.parametrize("told", [service(3, 1), service(2, 0), service(2, 0, width=9000)])
def test_of_too_little_nothing_is_asked_but_what_more_there_is(told: Json) -> None:
    assert image_url(told, 0, 0, 2048) is None


def test_what_a_manifest_does_not_tell_the_image_s_own_server_is_asked_for(
    server: PhotoServer, tmp_path: Path, fetcher: Fetcher
) -> None:
    host = server.url
    level_0 = {"type": "ImageService3", "profile": "level0"}
    (photo,) = photos(
        manifest(host, "m", canvas(host, "1", {"none": ["one"]}, body(host, "a", level_0))),
        tmp_path,
        fetcher,
    )
    told = {**level_0, "id": f"{host}/a", "width": 9000, "height": 6000, "sizes": SIZES}
    put_json(server, "/a/info.json", told)
    server.put("/a/full/3000,2000/0/default.jpg", Answer(b"photo"))
    kept = fetched_photo(photo, fetcher, tmp_path / "fetched")
    assert kept.read_bytes() == b"photo"
    assert fetched_photo(photo, fetcher, tmp_path / "fetched") == kept
    assert server.asked == {"/a/info.json": 1, "/a/full/3000,2000/0/default.jpg": 1}


def test_where_the_service_fails_the_image_itself_is_taken(
    server: PhotoServer, tmp_path: Path, fetcher: Fetcher
) -> None:
    host = server.url
    (photo,) = photos(
        manifest(host, "m", canvas(host, "1", {"none": ["one"]}, body(host, "a", LEVEL_2))),
        tmp_path,
        fetcher,
    )
    server.put("/a/full/max/0/default.jpg", Answer(b"photo"))
    assert fetched_photo(photo, fetcher, tmp_path / "fetched").read_bytes() == b"photo"
    assert server.asked["/a/full/!2048,2048/0/default.jpg"] == 1


def test_an_address_of_an_image_is_a_photo(server: PhotoServer, fetcher: Fetcher) -> None:
    url = server.put("/a.jpg", Answer(b"\xff\xd8\xff photo"))
    assert read_sources([url], fetcher) == [Photo(url, urls=(url,))]


@pytest.mark.parametrize(
    ("document", "says"),
    [
        ({"type": "Canvas"}, "is no manifest or collection"),
        (manifest("https://example.org", "m"), "shows no canvas"),
    ],
)
def test_what_is_no_manifest_is_refused(
    tmp_path: Path, fetcher: Fetcher, document: Json, says: str
) -> None:
    with pytest.raises(WrongInput, match=says):
        photos(document, tmp_path, fetcher)


def test_an_image_on_no_web_server_is_an_error_answer(tmp_path: Path, fetcher: Fetcher) -> None:
    painted = {"id": "file:///etc/passwd", "type": "Image"}
    (photo,) = photos(
        manifest("https://e.org", "m", canvas("https://e.org", "1", {"none": ["one"]}, painted)),
        tmp_path,
        fetcher,
    )
    assert photo.error == "its image has no address of http or https"


def test_an_address_that_is_none_is_an_error_of_its_photo_alone(
    tmp_path: Path, fetcher: Fetcher
) -> None:
    host, torn = "https://e.org", {"id": "http://[::1/x.jpg", "type": "Image"}
    shown = manifest(
        host, "m", canvas(host, "1", None, torn), canvas(host, "2", None, body(host, "b"))
    )
    gone = {"id": "http://[", "type": "Manifest"}
    found = photos({"type": "Collection", "items": [gone, shown]}, tmp_path, fetcher)
    assert [each.query for each in found] == ["http://[", f"{host}/canvas/1", f"{host}/canvas/2"]
    assert "cannot be fetched" in found[0].error
    with pytest.raises(Unfetched, match=r"http://\[::1/x\.jpg cannot be fetched"):
        fetched_photo(found[1], fetcher, tmp_path)


def test_a_good_service_of_a_picture_without_an_address_is_used(
    tmp_path: Path, fetcher: Fetcher
) -> None:
    host = "https://e.org"
    painted = {**body(host, "a", LEVEL_2), "id": "urn:a"}
    shown = canvas(host, "1", None, painted)
    shown["items"][0]["items"][0]["motivation"] = ["painting"]
    (photo,) = photos(manifest(host, "m", shown), tmp_path, fetcher)
    assert photo.urls == (f"{host}/a/full/!2048,2048/0/default.jpg",)


def test_a_server_that_tells_nonsense_of_an_image_is_passed_by(
    server: PhotoServer, tmp_path: Path, fetcher: Fetcher
) -> None:
    nonsense = {"type": "ImageService3", "width": 9000, "height": 6000, "sizes": 7}
    put_json(server, "/a/info.json", nonsense)
    url = server.put("/a.jpg", Answer(b"photo"))
    photo = Photo("a", urls=(url,), info=f"{server.url}/a/info.json")
    assert fetched_photo(photo, fetcher, tmp_path).read_bytes() == b"photo"
