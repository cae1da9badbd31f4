"""An index of a catalogue alone, and answers about it, made without any search."""

from collections.abc import Sequence
from pathlib import Path

from made_catalogue import index_of

from contracts.records import Camera, Pose, PosedImage
from coordinator.querying import Located
from geo.geojson import (
    Feature,
    PlacedEstimate,
    PlacedMatch,
    error_feature,
    estimate_feature,
    match_feature,
)
from index.catalogue import catalogue_row
from index.opened import OpenedIndex

MINUTE = "2024-06-12T09:32:16.250+02:00"


def posed(uri: str, easting: float, northing: float, crs: str = "EPSG:2154") -> PosedImage:
    """An image whose camera looks to grid east."""
    pose = Pose(easting, northing, crs, 37.5, 90.0, position_error_m=0.4)
    return PosedImage(
        uri, f"/survey/{uri}", pose=pose, camera=Camera("left", 82.0), captured_at=MINUTE
    )


def made_index(root: Path, images: Sequence[PosedImage], crs: str | None) -> OpenedIndex:
    """An index that knows these images but can search for none."""
    rows = [catalogue_row(n, "", image, "0" * 64, 640, 480) for n, image in enumerate(images)]
    return index_of(root, rows, crs)


def made_match(
    query: str,
    rank: int,
    lon_deg: float | None,
    lat_deg: float | None,
    *,
    image_id: int | None = None,
    score: float | None = None,
    heading_deg: float | None = 90.0,
    heading_derived: bool = False,
    hfov_deg: float | None = 82.0,
    captured_at: str | None = MINUTE,
) -> Feature:
    """A match of the image numbered `rank - 1`, unless it is said otherwise."""
    number = rank - 1 if image_id is None else image_id
    return match_feature(
        PlacedMatch(
            query=query,
            rank=rank,
            score=100.0 / rank if score is None else score,
            image=f"{number:02d}.jpg",
            uri=f"/survey/{number:02d}.jpg",
            image_id=number,
            lon_deg=lon_deg,
            lat_deg=lat_deg,
            heading_deg=heading_deg,
            pitch_deg=1.5,
            roll_deg=None,
            hfov_deg=hfov_deg,
            captured_at=captured_at,
            detectors=("hesaff", "mser"),
            k=5,
            predicted_map=0.5,
            generation=1,
            choice="as asked",
            heading_derived=heading_derived,
            position_error_m=0.4,
        )
    )


def made_estimate(query: str, lon_deg: float, lat_deg: float, *, in_survey: bool = True) -> Feature:
    """An estimate of 12 and 25 m."""
    return estimate_feature(
        PlacedEstimate(
            query=query,
            lon_deg=lon_deg,
            lat_deg=lat_deg,
            radius_m=12.0,
            support=7,
            detectors=("hesaff", "mser"),
            k=5,
            radius_95_m=25.0,
            confidence=0.875,
            in_survey=in_survey,
        )
    )


def failed(query: str, message: str = "no such file") -> Located:
    """The answer to a photo that could not be read."""
    return Located(query, (error_feature(query, message),), 0.0)
