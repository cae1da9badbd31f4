"""Layers of points, written by ogr2ogr, pyshp, pandas and pyarrow, not by what reads them."""

import json
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import pandas
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import shapefile
import shapely
from pictured import AS_IT_IS, L93, pictured, pose_of, reasons
from pyproj import CRS

from contracts.errors import BadSurvey, UnknownCrs
from survey import read_survey

CSV = (
    "file,easting,northing,z,heading,time,note\n"
    "a.jpg,652000.5,6862000.25,40.5,90.5,2020-05-01T10:00:00Z,ça va\n"
    "b.jpg,652010.5,6862000.25,41.5,,2020-05-01T10:00:01Z,\n"
)


LAYERS = {
    "p.gpkg": ("GPKG", "-a_srs", "EPSG:2154", "-nln", "positions"),
    "p.shp": ("ESRI Shapefile", "-a_srs", "EPSG:2154"),
    "p.fgb": ("FlatGeobuf", "-a_srs", "EPSG:2154"),
    "p.geojson": ("GeoJSON", "-a_srs", "EPSG:2154", "-lco", "RFC7946=NO"),
    "p.geojsonl": ("GeoJSONSeq", "-s_srs", "EPSG:2154", "-t_srs", "EPSG:4326"),
}


@pytest.fixture(scope="module")
def layers(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The table as a layer of points in every format, each in a folder of its name."""
    if shutil.which("ogr2ogr") is None:
        pytest.skip("ogr2ogr (gdal-bin) is not installed")
    root = tmp_path_factory.mktemp("layers")
    source = root / "source.csv"
    source.write_text(CSV)
    how = ["X_POSSIBLE_NAMES=easting", "Y_POSSIBLE_NAMES=northing", "Z_POSSIBLE_NAMES=z"]
    how += ["AUTODETECT_TYPE=YES", "KEEP_GEOM_COLUMNS=NO"]
    for name, (driver, *options) in LAYERS.items():
        pictured(root / name, "a.jpg", "b.jpg")
        into = ["-f", driver, str(root / name / name), f"CSV:{source}", *options]
        ogr2ogr(*into, *(part for option in how for part in ("-oo", option)))
    return root


def ogr2ogr(*arguments: str) -> None:
    subprocess.run(["ogr2ogr", *arguments], check=True, capture_output=True, timeout=60)


def survey_of(layers: Path, name: str, folder: Path) -> Path:
    """A copy of the survey with a layer of that name."""
    return Path(shutil.copytree(layers / name, folder / "survey"))


@pytest.mark.parametrize("name", sorted(LAYERS))
def test_a_layer_of_points_is_a_pose_table(layers: Path, name: str) -> None:
    survey = read_survey(layers / name, AS_IT_IS)
    pose = pose_of(survey)
    assert survey.format == "table"
    if name == "p.geojsonl":  # always WGS 84
        assert (pose.easting, pose.northing) == pytest.approx((2.3456, 48.8568), abs=2e-3)
        assert pose.crs == "EPSG:4326"
    else:
        assert (pose.easting, pose.northing, pose.crs) == (652000.5, 6862000.25, "EPSG:2154")
    assert (pose.altitude_m, pose.heading_deg) == (40.5, 90.5)
    assert pose_of(survey, "b.jpg").heading_deg is None
    if name != "p.shp":  # a Shapefile's dates have no time of day
        assert survey.images[0].captured_at == "2020-05-01T10:00:00Z"


def test_the_layers_system_is_checked_against_the_users(layers: Path) -> None:
    root = layers / "p.gpkg"
    with pytest.raises(BadSurvey, match=r"p\.gpkg is in EPSG:2154.*--crs says EPSG:2056"):
        read_survey(root, replace(AS_IT_IS, crs="EPSG:2056"))
    assert pose_of(read_survey(root, L93)).crs == "EPSG:2154"


def test_of_several_layers_the_one_with_a_file_column_is_read(layers: Path, tmp_path: Path) -> None:
    root = survey_of(layers, "p.gpkg", tmp_path)
    source = root / "houses.geojson"
    source.write_text(features([point(2, 48)], file=False))
    ogr2ogr("-update", "-nln", "houses", str(root / "p.gpkg"), str(source))
    source.unlink()
    assert len(read_survey(root, AS_IT_IS).images) == 2


def test_two_layers_with_a_file_column_are_refused_by_name(layers: Path, tmp_path: Path) -> None:
    root = survey_of(layers, "p.gpkg", tmp_path)
    source = root / "source.geojson"
    source.write_text(features([point(2, 48)]))
    ogr2ogr("-update", "-nln", "two", str(root / "p.gpkg"), str(source))
    source.unlink()
    with pytest.raises(BadSurvey, match=r"p\.gpkg: 2 layers .* positions \(file.*; two \(file"):
        read_survey(root, AS_IT_IS)


def test_layers_without_a_file_column_are_refused_by_name(tmp_path: Path) -> None:
    root = pictured(tmp_path, "a.jpg")
    (root / "p.geojson").write_text(features([point(2, 48)], file=False))
    with pytest.raises(BadSurvey, match=r"p\.geojson: 0 layers .* found p \(colour\)"):
        read_survey(root / "p.geojson", AS_IT_IS)


def point(x: float, y: float) -> dict[str, object]:
    return {"type": "Point", "coordinates": [x, y]}


def features(geometries: list[dict[str, object] | None], file: bool = True) -> str:
    return json.dumps(
        {
            "type": "FeatureCollection",
            "features": [
                {
                    "type": "Feature",
                    "geometry": geometry,
                    "properties": {"file": f"{at}.jpg"} if file else {"colour": "red"},
                }
                for at, geometry in enumerate(geometries)
            ],
        }
    )


def test_geometries_that_are_no_points_are_told(tmp_path: Path) -> None:
    line = {"type": "LineString", "coordinates": [[2, 48], [3, 48]]}
    empty = {"type": "Point", "coordinates": []}
    root = pictured(tmp_path, *(f"{at}.jpg" for at in range(4)))
    (root / "p.geojson").write_text(features([point(2, 48), None, line, empty]))
    told = reasons(read_survey(root, AS_IT_IS))
    assert "p.geojson feature 2: image without pose: its geometry is none" in told["1.jpg"]
    assert "p.geojson feature 3" in told["2.jpg"]
    assert "LINESTRING (2 48, 3 48), expected a point" in told["2.jpg"]
    assert set(told) == {"1.jpg", "2.jpg", "3.jpg"}


def test_a_shapefile_with_cut_names_is_understood(tmp_path: Path) -> None:
    pictured(tmp_path, "a.jpg")
    with shapefile.Writer(str(tmp_path / "oi"), shapeType=shapefile.POINTZ) as writer:
        writer.field("ImagePath", "C", 80)
        for name in ("CameraHead", "CameraPitc", "Horizontal"):
            writer.field(name, "N", decimal=6)
        writer.pointz(652000.5, 6862000.25, 40.0)
        writer.record(r"D:\drive\a.jpg", 90.5, 85.0, -999)
    (tmp_path / "oi.prj").write_text(CRS("EPSG:2154").to_wkt("WKT1_ESRI"))
    survey = read_survey(tmp_path, AS_IT_IS)
    pose = pose_of(survey)
    assert (pose.easting, pose.altitude_m, pose.heading_deg, pose.pitch_deg) == (
        *(652000.5, 40.0, 90.5, -5.0),
    )
    assert survey.images[0].camera.hfov_deg is None


def test_a_shapefile_without_a_system_needs_the_users(tmp_path: Path) -> None:
    pictured(tmp_path, "a.jpg")
    with shapefile.Writer(str(tmp_path / "p"), shapeType=shapefile.POINT) as writer:
        writer.field("file", "C", 80)
        writer.point(652000.5, 6862000.25)
        writer.record("a.jpg")
    with pytest.raises(UnknownCrs, match=r"p\.shp: its geometries are without a coordinate"):
        read_survey(tmp_path, AS_IT_IS)
    assert pose_of(read_survey(tmp_path, L93)).easting == 652000.5


def geoparquet(path: Path, crs: str) -> None:
    """GeoParquet 1.1 as its specification has it, by pyarrow alone."""
    geometry = [shapely.Point(652000.5, 6862000.25).wkb, None]
    table = pa.table(
        {
            "file": ["a.jpg", "b.jpg"],
            "heading": pa.array([90.5, None]),
            "captured_at": pa.array([1588327200000, None], pa.timestamp("ms", "UTC")),
            "geometry": pa.array(geometry, pa.binary()),
        }
    )
    column = {"encoding": "WKB", "geometry_types": ["Point"], "crs": CRS(crs).to_json_dict()}
    geo = {"version": "1.1.0", "primary_column": "geometry", "columns": {"geometry": column}}
    pq.write_table(table.replace_schema_metadata({"geo": json.dumps(geo)}), path)


def test_geoparquet_is_read(tmp_path: Path) -> None:
    geoparquet(pictured(tmp_path, "a.jpg", "b.jpg") / "p.parquet", "EPSG:2154")
    survey = read_survey(tmp_path, AS_IT_IS)
    pose = pose_of(survey)
    assert (pose.easting, pose.heading_deg, pose.crs) == (652000.5, 90.5, "EPSG:2154")
    assert survey.images[0].captured_at == "2020-05-01T10:00:00Z"
    assert "geometry is none" in reasons(survey)["b.jpg"]


def test_parquet_without_geometry_is_a_table(tmp_path: Path) -> None:
    frame = pandas.DataFrame({"file": ["a.jpg"], "x": [652000.5], "y": [6862000.25], "z": [None]})
    frame.to_parquet(pictured(tmp_path, "a.jpg") / "p.parquet")
    assert pose_of(read_survey(tmp_path, L93)).easting == 652000.5


@pytest.mark.parametrize("name", [*sorted(LAYERS), "p.parquet"])
@pytest.mark.parametrize("share", [0.02, 0.5, 0.9])
def test_a_truncated_layer_is_refused_or_read_as_far_as_it_goes(
    layers: Path, tmp_path: Path, name: str, share: float
) -> None:
    if name == "p.parquet":
        root = pictured(tmp_path / "survey", "a.jpg", "b.jpg")
        geoparquet(root / name, "EPSG:2154")
    else:
        root = survey_of(layers, name, tmp_path)
    data = (root / name).read_bytes()
    (root / name).write_bytes(data[: int(len(data) * share)])
    if (name, share) in {("p.shp", 0.9), ("p.geojsonl", 0.9)}:
        survey = read_survey(root / name, AS_IT_IS)
        assert [image.uri for image in survey.images] == ["a.jpg"]
        assert "b.jpg" in reasons(survey)
        return
    with pytest.raises(BadSurvey, match=rf"{name}"):
        read_survey(root / name, AS_IT_IS)


def test_gdal_is_not_led_to_other_files(tmp_path: Path) -> None:
    """A virtual layer names files that GDAL would open, whatever its own name ends with."""
    pictured(tmp_path / "survey", "a.jpg")
    (tmp_path / "secret.geojson").write_text(features([point(2, 48)]))
    link = f"<SrcDataSource>{tmp_path / 'secret.geojson'}</SrcDataSource>"
    virtual = (
        f'<OGRVRTDataSource><OGRVRTLayer name="secret">{link}</OGRVRTLayer></OGRVRTDataSource>'
    )
    for name in ("p.gpkg", "p.geojson", "p.shp"):
        (tmp_path / "survey" / name).write_text(virtual)
        with pytest.raises(BadSurvey):
            read_survey(tmp_path / "survey" / name, replace(AS_IT_IS, format="table"))


def test_a_text_table_and_a_layer_beside_it_are_refused(tmp_path: Path) -> None:
    root = pictured(tmp_path, "a.jpg")
    (root / "p.csv").write_text("file,x,y\na.jpg,652000,6862000\n")
    (root / "q.geojson").write_text(features([point(2, 48)]))
    with pytest.raises(BadSurvey, match=r"p\.csv, q\.geojson"):
        read_survey(root, L93)


def test_results_beside_a_pose_table_are_not_taken_for_one(tmp_path: Path) -> None:
    root = pictured(tmp_path, "a.jpg")
    (root / "p.csv").write_text("file,x,y\na.jpg,652000,6862000\n")
    match = {"query": "photo.jpg", "rank": 1, "score": 3.5, "image": "a.jpg"}
    feature = {"type": "Feature", "geometry": point(2, 48), "properties": match}
    results = {"type": "FeatureCollection", "features": [feature]}
    (root / "results.geojson").write_text(json.dumps(results))
    assert [image.uri for image in read_survey(root, L93).images] == ["a.jpg"]


def test_results_given_as_the_survey_are_told_for_what_they_are(tmp_path: Path) -> None:
    root = pictured(tmp_path, "a.jpg")
    match = {"query": "photo.jpg", "rank": 1, "score": 3.5, "image": "a.jpg"}
    feature = {"type": "Feature", "geometry": point(2, 48), "properties": match}
    results = root / "results.geojson"
    results.write_text(json.dumps({"type": "FeatureCollection", "features": [feature]}))
    with pytest.raises(BadSurvey, match=r"results\.geojson: these are results of `flaneur locate`"):
        read_survey(results, AS_IT_IS)
    (root / "results.csv").write_text("query,rank,score,image,lon,lat\np.jpg,1,3.5,a.jpg,2,48\n")
    with pytest.raises(BadSurvey, match=r"results\.csv: these are results of `flaneur locate`"):
        read_survey(root / "results.csv", AS_IT_IS)


@pytest.mark.parametrize("instead_of", ["0.jpg", "48"])
def test_geojson_in_latin_1_is_refused_as_no_utf_8(tmp_path: Path, instead_of: str) -> None:
    path = pictured(tmp_path, "a.jpg") / "p.geojson"
    path.write_bytes(features([point(2, 48)]).encode().replace(instead_of.encode(), b"\xe9"))
    with pytest.raises(BadSurvey, match=r"p\.geojson is not UTF-8; save it as UTF-8$"):
        read_survey(path, AS_IT_IS)


def test_areas_that_name_a_file_are_not_taken_for_poses(tmp_path: Path) -> None:
    import geopandas

    root = pictured(tmp_path, "a.jpg")
    (root / "p.csv").write_text("file,x,y\na.jpg,652000,6862000\n")
    areas = geopandas.GeoDataFrame({"path": ["a"]}, geometry=[shapely.box(0, 0, 1, 1)])
    areas.set_crs("EPSG:2154").to_file(root / "areas.gpkg", engine="pyogrio")
    assert [image.uri for image in read_survey(root, L93).images] == ["a.jpg"]
