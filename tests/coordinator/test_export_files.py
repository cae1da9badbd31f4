import json
import math
from collections.abc import Iterator
from pathlib import Path

import pytest

from contracts.errors import WrongInput
from coordinator.export.files import write_pieces, write_whole
from coordinator.export.geojson import write_geojson
from geo.geojson import error_feature, feature_collection


def test_a_result_replaces_the_old_file_and_leaves_nothing_beside(tmp_path: Path) -> None:
    out = tmp_path / "results.geojson"
    out.write_text("old", "utf-8")
    features = [error_feature("é.jpg", "why")]
    write_geojson(out, features)
    assert json.loads(out.read_text("utf-8")) == feature_collection(features)
    assert list(tmp_path.iterdir()) == [out]


def test_what_cannot_be_serialised_leaves_the_old_file(tmp_path: Path) -> None:
    out = tmp_path / "results.geojson"
    out.write_text("old", "utf-8")
    broken = error_feature("a.jpg", "why")
    broken["properties"]["score"] = math.nan
    with pytest.raises(ValueError, match="JSON"):
        write_geojson(out, [error_feature("b.jpg", "why"), broken])
    assert out.read_text("utf-8") == "old"
    assert list(tmp_path.iterdir()) == [out]


def test_pieces_that_end_early_leave_nothing(tmp_path: Path) -> None:
    def pieces() -> Iterator[bytes]:
        yield b"half"
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_pieces(tmp_path / "out", pieces())
    assert list(tmp_path.iterdir()) == []


def test_where_nothing_can_be_written_the_error_names_the_file(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(WrongInput, match=r"file/results\.geojson"):
        write_whole(tmp_path / "file" / "results.geojson", b"x")
    (tmp_path / "folder").mkdir()
    with pytest.raises(WrongInput, match="folder"):
        write_whole(tmp_path / "folder", b"x")
    assert {path.name for path in tmp_path.iterdir()} == {"file", "folder"}
