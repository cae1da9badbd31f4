"""A STAC catalogue on disk: walked by pystac, held against the schemas it ships."""

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pystac
import pytest
from made_catalogue import INDEXED_AT, ROW, ROWS, index_of, item, numbered
from pystac.validation.stac_validator import JsonSchemaSTACValidator
from typer.testing import CliRunner

from contracts.errors import WrongInput
from coordinator.cli.main import main
from coordinator.export import stac_folder
from coordinator.export.stac_folder import WHOLE_EARTH, write_stac
from index.catalogue import CatalogueRow


def written(tmp_path: Path, rows: Sequence[CatalogueRow], crs: str | None = "EPSG:2154") -> Path:
    folder = tmp_path / "stac"
    write_stac(index_of(tmp_path / "index", rows, crs), folder, lambda: None)
    return folder


def refuse_unless_core(content: dict[str, Any], kind: pystac.STACObjectType) -> None:
    """By the schemas that pystac ships; those of extensions would be fetched from the network."""
    JsonSchemaSTACValidator().validate_core(content, kind, "1.1.0", None)


def test_pystac_walks_the_catalogue_and_its_schemas_accept_all(tmp_path: Path) -> None:
    folder = written(tmp_path, ROWS)
    collection = pystac.Collection.from_file(str(folder / "collection.json"))
    refuse_unless_core(
        json.loads((folder / "collection.json").read_bytes()), pystac.STACObjectType.COLLECTION
    )
    for child in collection.get_children():
        refuse_unless_core(child.to_dict(), pystac.STACObjectType.CATALOG)
    items = list(collection.get_items(recursive=True))
    assert [each.properties["title"] for each in items] == [row.uri for row in ROWS]
    for each in items:
        refuse_unless_core(each.to_dict(), pystac.STACObjectType.ITEM)
        assert each.get_collection() is collection
    assert [provider.name for provider in collection.providers or ()] == ["© A survey"]
    (interval,) = collection.extent.temporal.intervals
    assert [moment.isoformat() for moment in interval if moment] == [
        "1826-01-01T00:00:00+00:00",
        INDEXED_AT,
    ]
    (bbox,) = collection.extent.spatial.bboxes
    assert bbox[:2] == pytest.approx([2.345, 48.857], abs=0.01)


def test_those_schemas_refuse_what_is_wrong() -> None:
    broken = item(ROW)
    broken["properties"]["datetime"] = None
    with pytest.raises(pystac.STACValidationError):
        refuse_unless_core(broken, pystac.STACObjectType.ITEM)


def test_many_images_are_in_folders_of_a_thousand(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stac_folder, "GROUP", 4)
    advanced: list[None] = []
    index = index_of(tmp_path / "index", numbered(ROW, 10), "EPSG:2154")
    folder = tmp_path / "stac"
    write_stac(index, folder, lambda: advanced.append(None))
    assert len(advanced) == 10
    groups = {path.name: len(list(path.iterdir())) for path in folder.iterdir() if path.is_dir()}
    assert groups == {"0000": 5, "0001": 5, "0002": 3}
    collection = pystac.Collection.from_file(str(folder / "collection.json"))
    assert len({each.id for each in collection.get_items(recursive=True)}) == 10


def test_images_without_poses_are_a_catalogue_too(tmp_path: Path) -> None:
    rows = [
        replace(ROWS[2], image_id=0),
        replace(ROWS[2], image_id=1, uri="other.jpg", captured_at=None),
    ]
    folder = written(tmp_path, rows, None)
    collection = json.loads((folder / "collection.json").read_bytes())
    refuse_unless_core(collection, pystac.STACObjectType.COLLECTION)
    assert collection["extent"]["spatial"]["bbox"] == [WHOLE_EARTH]
    for path in folder.glob("0000/*.json"):
        content = json.loads(path.read_bytes())
        if content["type"] == "Feature":
            assert content["geometry"] is None
            assert "bbox" not in content
            assert not any(key.startswith(("view:", "pers:")) for key in content["properties"])


def test_a_folder_with_something_in_it_is_left_alone(tmp_path: Path) -> None:
    index = index_of(tmp_path / "index", [ROW], "EPSG:2154")
    folder = tmp_path / "mine"
    folder.mkdir()
    (folder / "notes.txt").write_text("mine", "utf-8")
    with pytest.raises(WrongInput, match="is there already"):
        write_stac(index, folder, lambda: None)
    with pytest.raises(WrongInput, match="is there already"):
        write_stac(index, folder / "notes.txt", lambda: None)
    assert [path.name for path in folder.iterdir()] == ["notes.txt"]


def test_an_early_end_leaves_nothing(tmp_path: Path) -> None:
    index = index_of(tmp_path / "index", numbered(ROW, 3), "EPSG:2154")

    def stop() -> None:
        raise KeyboardInterrupt

    out = tmp_path / "out"
    out.mkdir()
    with pytest.raises(KeyboardInterrupt):
        write_stac(index, out / "stac", stop)
    assert list(out.iterdir()) == []


def test_the_command_writes_a_catalogue_once(tmp_path: Path) -> None:
    index_of(tmp_path / "index", numbered(ROW, 3), "EPSG:2154")
    arguments = ["export", "stac", str(tmp_path / "index"), str(tmp_path / "new" / "stac")]
    told = CliRunner().invoke(main, arguments)
    assert told.exit_code == 0, told.stderr
    assert "3 items" in told.stderr
    assert (tmp_path / "new" / "stac" / "collection.json").is_file()
    again = CliRunner().invoke(main, arguments)
    assert again.exit_code == 2
    assert "is there already" in again.stderr


@pytest.mark.parametrize(
    ("index", "folder", "says"),
    [("gone", "stac", "does not exist"), ("index", "file/stac", "cannot write")],
)
def test_what_cannot_be_exported_is_told(
    tmp_path: Path, index: str, folder: str, says: str
) -> None:
    index_of(tmp_path / "index", [ROW], "EPSG:2154")
    (tmp_path / "file").touch()
    told = CliRunner().invoke(
        main, ["export", "stac", str(tmp_path / index), str(tmp_path / folder)]
    )
    assert told.exit_code == 2
    assert says in told.stderr
