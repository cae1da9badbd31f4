"""Results before validators of others: what each of them looks at stands in its test."""

import importlib.resources
import json
import shutil
import subprocess
from pathlib import Path

import geojson_pydantic
import jsonschema
import pydantic
import pyogrio
import pytest
from made_features import ABOUT, features, text


def test_a_model_of_rfc_7946_accepts_the_collection() -> None:
    """geojson-pydantic: types, members, positions of 2 or 3 numbers, ids, south below north."""
    geojson_pydantic.FeatureCollection.model_validate_json(text(features(), ABOUT))


@pytest.mark.parametrize(
    ("right", "wrong"),
    [
        ('"Point"', '"Pint"'),
        ("[2.3365557,44.9999747]", "[2.3365557]"),
        ('"bbox":[2.3364,44.9999747,', '"bbox":[2.3364,50,'),
        ('"geometry":null,', ""),
    ],
)
def test_that_model_refuses_what_is_wrong(right: str, wrong: str) -> None:
    broken = text(features()).replace(right, wrong, 1)
    assert broken != text(features())
    with pytest.raises(pydantic.ValidationError):
        geojson_pydantic.FeatureCollection.model_validate_json(broken)


def test_the_schema_of_geojson_org_accepts_every_feature() -> None:
    """The authors' own, as pystac ships it: also that `bbox` and `id` have the types they may."""
    schemas = importlib.resources.files("pystac") / "validation/jsonschemas/geojson"
    validator = jsonschema.Draft7Validator(json.loads((schemas / "Feature.json").read_text()))
    written = json.loads(text(features(), ABOUT))["features"]
    assert [list(validator.iter_errors(feature)) for feature in written] == [[]] * 5
    written[0]["geometry"]["coordinates"] = [2.3]
    assert list(validator.iter_errors(written[0]))


def test_what_no_schema_looks_at_holds_too() -> None:
    """RFC 7946: no `crs` (4), the foreign member outside features (6.1), ids that differ (3.2)."""
    written = json.loads(text(features(), ABOUT))
    assert list(written) == ["type", "flaneur", "features", "bbox"]
    assert written["flaneur"] == ABOUT
    assert written["bbox"] == [2.3364, 44.9999747, 2.3365557, 45.0001]
    ids = [feature["id"] for feature in written["features"]]
    assert len(set(ids)) == len(ids)
    assert all(set(each) == {"type", "id", "geometry", "properties"} for each in features())


def test_gdal_reads_the_collection_in_wgs_84(tmp_path: Path) -> None:
    path = tmp_path / "results.geojson"
    path.write_text(text(features(), ABOUT), "utf-8")
    frame = pyogrio.read_dataframe(path)
    assert frame.crs.to_epsg() == 4326
    assert list(frame["kind"]) == ["match", "match", "estimate", "target", "error"]
    assert frame.geometry.isna().tolist() == [False, True, False, False, True]
    assert frame.geometry[0].x == pytest.approx(2.3365557, abs=1e-12)
    assert frame["query"][0] == "cartes/été 1910.jpg"


def test_ogrinfo_tells_the_types_of_the_fields(tmp_path: Path) -> None:
    ogrinfo = shutil.which("ogrinfo")
    if ogrinfo is None:
        pytest.skip("GDAL's ogrinfo is not installed (Debian: gdal-bin)")
    path = tmp_path / "results.geojson"
    path.write_text(text(features(), ABOUT), "utf-8")
    told = subprocess.run(
        [ogrinfo, "-al", "-so", path], capture_output=True, text=True, timeout=60, check=True
    )
    assert told.stderr == ""
    said = dict(line.split(": ", 1) for line in told.stdout.splitlines() if ": " in line)
    assert said["Geometry"] == "Point"
    assert said["Feature Count"] == "5"
    assert said["Extent"] == "(2.336400, 44.999975) - (2.336556, 45.000100)"
    fields = {name: kind.split(" ")[0] for name, kind in said.items() if kind.endswith(".0)")}
    assert fields["id"] == fields["query"] == fields["uri"] == "String"
    assert fields["rank"] == fields["support"] == "Integer"
    assert fields["score"] == fields["heading_deg"] == fields["radius_m"] == "Real"
    assert fields["heading_derived"] == "Integer(Boolean)"
    assert fields["captured_at"] == "DateTime"
    assert fields["detectors"] == "StringList"
