"""Images of a catalogue as STAC 1.1 items, with where and how their cameras looked.

Extensions: `view` 1.1, `pers` (perspective imagery) 1.0 and `proj` (projection) 2.0.
"""

import hashlib
import math
import mimetypes
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import PurePath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geo.crs import parse_full_crs
from geo.geojson import DECIMALS
from geo.headings import wrapped_360
from geo.rotations import PHOTOGRAMMETRIC_FROM_RDF, rotations_from_hpr
from index.catalogue import CatalogueRow
from survey.uris import image_uri
from workers.stages.spots import Ground, spots_of

Json = dict[str, Any]

STAC_VERSION = "1.1.0"
JSON_TYPE = "application/json"
_EXTENSIONS = "https://stac-extensions.github.io"
PROJECTION = f"{_EXTENSIONS}/projection/v2.0.0/schema.json"
PERSPECTIVE = f"{_EXTENSIONS}/perspective-imagery/v1.0.0/schema.json"
VIEW = f"{_EXTENSIONS}/view/v1.1.0/schema.json"

FIRST_PHOTOGRAPH = "1826-01-01T00:00:00.000000Z"
"""No photograph is older; where nothing else is known of its time, it was taken since."""


@dataclass(frozen=True, slots=True)
class _Place:
    """Where a camera stands, WGS 84, and looks, from true north; NaN: not known."""

    lon_deg: float
    lat_deg: float
    heading_deg: float
    convergence_deg: float


class ItemMaker:
    """Makes the items of one collection.

    Parameters
    ----------
    collection : its id.
    crs : of the rows' poses; None: there are none.
    ground : of the index (`workers.stages.spots.ground_of`).
    indexed_at : ISO 8601 with a zone; no image was taken later.
    """

    def __init__(
        self, collection: str, crs: str | None, ground: Ground | None, indexed_at: str
    ) -> None:
        self._collection = collection
        self._crs = None if crs is None else _crs_of_poses(crs)
        self._ground = ground
        self._indexed_at = utc_time(indexed_at) or FIRST_PHOTOGRAPH

    def items(self, rows: Sequence[CatalogueRow]) -> list[Json]:
        """The items of some rows, in their order."""
        spots = spots_of(rows, self._ground)
        convergence = np.zeros(len(rows))
        posed = np.flatnonzero(np.isfinite(spots.lon_deg)).tolist()
        if self._ground is not None and posed:
            x, y = np.array([(rows[n].easting, rows[n].northing) for n in posed], np.float64).T
            convergence[posed] = self._ground.to_wgs84.convergence_deg(x, y)
        columns = (spots.lon_deg, spots.lat_deg, spots.heading_deg, convergence)
        return [
            self._item(row, _Place(*numbers))
            for row, numbers in zip(rows, np.column_stack(columns).tolist(), strict=True)
        ]

    def _item(self, row: CatalogueRow, place: _Place) -> Json:
        properties: Json = {"title": row.uri, **self._times(row.captured_at)}
        extensions = [PROJECTION]
        # An image that is not rectified has no projection of its own: null, says the extension.
        properties |= {"proj:code": None, "proj:shape": [row.height_px, row.width_px]}
        where: Json = {"geometry": None}
        if math.isfinite(place.lon_deg):
            lon, lat = round(place.lon_deg, DECIMALS) + 0.0, round(place.lat_deg, DECIMALS) + 0.0
            where = {
                "geometry": {"type": "Point", "coordinates": [lon, lat]},
                "bbox": [lon, lat, lon, lat],
            }
            view, pose = _view(row, place), self._pose(row, place)
            properties |= {**view, **pose}
            extensions += [VIEW, PERSPECTIVE] if view else [PERSPECTIVE]
        properties["flaneur:image_id"] = row.image_id
        return {
            "type": "Feature",
            "stac_version": STAC_VERSION,
            "stac_extensions": extensions,
            "id": item_id(row.uri),
            **where,
            "properties": properties,
            "links": [
                {"rel": "root", "href": "../collection.json", "type": JSON_TYPE},
                {"rel": "parent", "href": "./catalog.json", "type": JSON_TYPE},
                {"rel": "collection", "href": "../collection.json", "type": JSON_TYPE},
            ],
            "assets": {"image": _asset(row)},
            "collection": self._collection,
        }

    def _times(self, captured_at: str | None) -> Json:
        moment = None if captured_at is None else utc_time(captured_at)
        if moment is not None:
            return {"datetime": moment}
        # Without a moment an item must have an interval: the one that is certainly true.
        return {
            "datetime": None,
            "start_datetime": FIRST_PHOTOGRAPH,
            "end_datetime": self._indexed_at,
        }

    def _pose(self, row: CatalogueRow, place: _Place) -> Json:
        altitude = _known(row.altitude_m)
        centre = [row.easting, row.northing]
        pose: Json = {
            "pers:crs": self._crs,
            "pers:perspective_center": centre if altitude is None else [*centre, altitude],
        }
        rotation = _image_from_ground(row, place)
        if rotation is not None and altitude is not None:  # the extension wants both or neither
            pose["pers:rotation_matrix"] = [round(each, 12) + 0.0 for each in rotation.flat]
        lens: Json = {}
        if row.camera:
            lens["camera_id"] = row.camera
        hfov = _known(row.hfov_deg)
        if hfov is not None and 0.0 < hfov <= 360.0:
            lens["field_of_view"] = hfov
        return {**pose, "pers:interior_orientation": lens} if lens else pose


def item_id(uri: str) -> str:
    """The id of an image's item, and its file's name: 32 hex digits that its uri decides."""
    return hashlib.sha256(uri.encode("utf-8", "surrogatepass")).hexdigest()[:32]


def utc_time(moment: str) -> str | None:
    """RFC 3339 in UTC, as STAC demands, texts in the order of time; None if it is no moment."""
    try:
        known = datetime.fromisoformat(moment)
        if known.tzinfo is None:
            return None
        in_utc = known.astimezone(UTC).isoformat(timespec="microseconds")
        return in_utc.replace("+00:00", "Z")
    except (ValueError, OverflowError):
        return None


def _crs_of_poses(crs: str) -> int | Json:
    """As the extension has it: an EPSG code, or PROJJSON for a system without one."""
    parsed = parse_full_crs(crs)
    authority = parsed.to_authority(auth_name="EPSG", min_confidence=100)
    if authority is not None:
        return int(authority[1])
    projjson: Json = parsed.to_json_dict()
    return projjson


def _view(row: CatalogueRow, place: _Place) -> Json:
    """Where the optical axis points, of what is known.

    `view:off_nadir` counts from straight down and ends at the horizon: a camera that looks up has
    none.
    """
    view: Json = {}
    heading = _known(place.heading_deg)
    if heading is not None:
        view["view:azimuth"] = round(heading, 6)
    pitch = _known(row.pitch_deg)
    if pitch is not None and -90.0 <= pitch <= 0.0:
        view["view:off_nadir"] = round(90.0 + pitch, 6)
    return view


def _image_from_ground(row: CatalogueRow, place: _Place) -> NDArray[np.float64] | None:
    """(3, 3) rotation from the axes of the poses' system to the image's: x right, y up, z back.

    None: not all of heading, pitch and roll are known. The axes of a geographic system are taken
    as east, north, up at the camera.
    """
    heading = _known(place.heading_deg)
    pitch, roll = _known(row.pitch_deg), _known(row.roll_deg)
    if heading is None or pitch is None or roll is None:
        return None
    grid_heading = wrapped_360(heading - place.convergence_deg)
    (ground_from_camera,) = rotations_from_hpr([grid_heading], [pitch], [roll])
    return np.asarray(PHOTOGRAMMETRIC_FROM_RDF @ ground_from_camera.T, np.float64)


def _asset(row: CatalogueRow) -> Json:
    asset: Json = {"href": image_uri(row.path, row.fragment), "roles": ["data"]}
    media_type, _ = mimetypes.guess_type(PurePath(row.path).name)
    if media_type is not None and media_type.startswith("image/"):
        asset["type"] = media_type
    return asset


def _known(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else value
