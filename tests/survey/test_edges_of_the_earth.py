"""Surveys across longitude 180 and beside the poles, read and examined."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest
from pictured import AS_IT_IS, pictured
from pyproj import Geod

from survey import Survey, read_survey
from survey.doctor.track import track_of

GEOD = Geod(ellps="WGS84")
DERIVED = replace(AS_IT_IS, derive_headings=True)


def drive(start: tuple[float, float], azimuth_deg: float) -> list[tuple[float, float]]:
    """Longitude and latitude of five stops, 4 m apart along a geodesic."""
    return [GEOD.fwd(*start, azimuth_deg, 4.0 * stop)[:2] for stop in range(5)]


def read(folder: Path, stops: Sequence[tuple[float, float]]) -> Survey:
    names = [f"{number}.jpg" for number in range(len(stops))]
    lines = [
        f"{name},{lon!r},{lat!r},2020-02-29T10:00:0{number}Z"
        for number, (name, (lon, lat)) in enumerate(zip(names, stops, strict=True))
    ]
    table = pictured(folder, *names) / "poses.csv"
    table.write_text("\n".join(["file,lon,lat,time", *lines]) + "\n")
    return read_survey(folder, DERIVED)


@pytest.mark.parametrize(
    ("start", "azimuth_deg"),
    [
        ((179.99993, -17.0), 90.0),
        ((-179.99993, -17.0), 270.0),
        ((179.99998, 65.0), 45.0),
        ((10.0, 89.999), 0.0),
        ((10.0, -89.999), 180.0),
    ],
)
def test_a_track_keeps_its_direction_and_its_length(
    tmp_path: Path, start: tuple[float, float], azimuth_deg: float
) -> None:
    stops = drive(start, azimuth_deg)
    survey = read(tmp_path, stops)
    poses = [pose for image in survey.images if (pose := image.pose) is not None]
    assert [(pose.easting, pose.northing) for pose in poses] == stops
    assert [skip.reason for skip in survey.skipped] == []
    for pose in poses:
        assert pose.heading_deg is not None
        turned = (pose.heading_deg - azimuth_deg + 180.0) % 360.0 - 180.0
        assert turned == pytest.approx(0.0, abs=0.01)
    track = track_of(survey.images, "EPSG:4326")
    assert max(track.x_m) - min(track.x_m) <= 16.1
    assert max(track.y_m) - min(track.y_m) <= 16.1


@pytest.mark.parametrize("lat", [90.0, -90.0])
def test_a_camera_at_the_pole_itself_has_a_pose(tmp_path: Path, lat: float) -> None:
    survey = read(tmp_path, [(0.0, lat), (120.0, lat)])
    assert len(survey.images) == 2
