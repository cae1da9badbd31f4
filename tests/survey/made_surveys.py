"""One small survey of two images in every format, and the file that says where they were taken."""

import json
from collections.abc import Callable, Mapping
from pathlib import Path

import shapefile
from mcap_drives import Protobuf, jpeg
from pictured import AS_IT_IS, L93, pictured
from PIL import Image
from pyproj import CRS

from survey import Survey, read_survey

CALIBRATION = {
    "id": 301,
    "rotation": [0, 0, 1, 1, 0, 0, 0, 1, 0],
    "position": [1.0, 2.0, -3.0],
    "projection": [50, 0, 100, 0, 50, 40, 0, 0, 1],
    "size": [200, 80],
    "orientation": 2,
}


def _table(folder: Path) -> Path:
    path = pictured(folder, "a.jpg", "b.jpg") / "poses.csv"
    path.write_text(
        "file,x,y,z,heading,time\n"
        "a.jpg,652000.5,6862000.25,40.5,90.5,2020-02-29T10:00:00Z\n"
        "b.jpg,652004.5,6862000.25,40.5,91.5,2020-02-29T10:00:01Z\n"
    )
    return path


def _geojson(folder: Path) -> Path:
    path = pictured(folder, "a.jpg", "b.jpg") / "poses.geojson"
    features = [
        {
            "type": "Feature",
            "geometry": {"type": "Point", "coordinates": [2.25 + at * 1e-4, 48.85, 40.5]},
            "properties": {"file": name, "heading": 90.5},
        }
        for at, name in enumerate(("a.jpg", "b.jpg"))
    ]
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}, indent=0))
    return path


def _shapefile(folder: Path) -> Path:
    pictured(folder, "a.jpg", "b.jpg")
    with shapefile.Writer(str(folder / "poses"), shapeType=shapefile.POINT) as writer:
        writer.field("file", "C", 80)
        for at, name in enumerate(("a.jpg", "b.jpg")):
            writer.point(652000.5 + 4 * at, 6862000.25)
            writer.record(name)
    (folder / "poses.prj").write_text(CRS("EPSG:2154").to_wkt("WKT1_ESRI"))
    return folder / "poses.shp"


def _mapillary(folder: Path) -> Path:
    path = pictured(folder, "a.jpg", "b.jpg") / "mapillary_image_description.json"
    entries = [
        {
            "filename": name,
            "MAPLatitude": 48.85,
            "MAPLongitude": 2.25 + at * 1e-4,
            "MAPCaptureTime": f"2020_02_29_10_00_0{at}_123",
            "MAPCompassHeading": {"TrueHeading": 90.5, "MagneticHeading": 90.5},
        }
        for at, name in enumerate(("a.jpg", "b.jpg"))
    ]
    path.write_text(json.dumps(entries, indent=0))
    return path


def _kapture(folder: Path) -> Path:
    pictured(folder, "sensors/records_data/a.jpg", "sensors/records_data/b.jpg")
    texts = {
        "sensors": "cam0, , camera, PINHOLE, 800, 600, 400.5, 410.5, 400, 300\n",
        "records_camera": "0, cam0, a.jpg\n1, cam0, b.jpg\n",
        "trajectories": "0, cam0, 1, 0, 0, 0, -652000.5, -6862000.5, -40.5\n"
        "1, cam0, 1, 0, 0, 0, -652004.5, -6862000.5, -40.5\n",
    }
    for name, text in texts.items():
        (folder / "sensors" / f"{name}.txt").write_text(text)
    return folder / "sensors" / "trajectories.txt"


def _stereopolis(folder: Path) -> Path:
    pictured(folder, *(f"Town-140616_0740-301-00001_000000{number}.jpg" for number in (7, 8)))
    (folder / "cameraCalibration.json").write_text(json.dumps([CALIBRATION]))
    panoramas = [
        {
            "id": number,
            "easting": 651000.5 + number,
            "northing": 6861000.25,
            "altitude": 40.5,
            "heading": 90.5,
            "pitch": 0.5,
            "roll": 0.5,
            "date": f"2020-02-29T12:31:3{number}.841Z",
        }
        for number in (7, 8)
    ]
    path = folder / "panoramicsMetaData.json"
    path.write_text(json.dumps(panoramas, indent=0))
    return path


def _exif(folder: Path) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    for at, name in enumerate(("a.jpg", "b.jpg")):
        exif = Image.Exif()
        exif.get_ifd(0x8825).update(
            {1: "N", 2: (48.0, 51.0, 12.5), 3: "E", 4: (2.0, 20.0, 24.5 + at), 16: "T", 17: 90.5}
        )
        exif.get_ifd(0x8769).update({0x9003: f"2020:02:29 10:00:0{at}", 0x9011: "+02:00"})
        Image.new("RGB", (36, 24)).save(folder / name, exif=exif)
    return folder / "a.jpg"


def _mcap(folder: Path) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    dialect = Protobuf()
    said = []
    for at in (0.0, 0.5):
        said += [
            dialect.fix("/fix", at, "cam", 2.25 + 1e-5 * at, 48.85, 40.5, heading=1.5),
            dialect.image("/cam", at, "cam", jpeg(0)),
        ]
    dialect.write(folder / "drive.mcap", said)
    return folder / "drive.mcap"


MAKERS: Mapping[str, Callable[[Path], Path]] = {
    "table": _table,
    "geojson": _geojson,
    "shapefile": _shapefile,
    "mapillary": _mapillary,
    "kapture": _kapture,
    "stereopolis": _stereopolis,
    "exif": _exif,
    "mcap": _mcap,
}
TABLES = ("table", "geojson", "shapefile", "mapillary")
TEXTS = ("table", "geojson", "mapillary", "kapture", "stereopolis")
"""Formats whose file is text."""

_WITHOUT_SYSTEM = ("table", "kapture")


def root_of(made: Path) -> Path:
    """The folder that was given to a maker, from the file that it gave back."""
    return made.parents[1] if made.parent.name == "sensors" else made.parent


def read(name: str, made: Path) -> Survey:
    """With what a user would have to say of it; tables are named, other formats are folders."""
    options = L93 if name in _WITHOUT_SYSTEM else AS_IT_IS
    return read_survey(made if name in TABLES else root_of(made), options)


def images_of(made: Path) -> set[str]:
    """The image files of the survey, as paths within it."""
    root = root_of(made)
    return {path.relative_to(root).as_posix() for path in root.rglob("*.jpg")}
