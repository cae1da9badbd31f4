"""The layers of a results GeoPackage, from the one drawn on top to the one at the bottom."""

from dataclasses import dataclass

from coordinator.export.columns import INTEGER, JPEG, MOMENT, REAL, TEXT, YES_NO, Column

_QUERY = (
    Column("query", TEXT, "Photo", "path of the photo as it was given; the same in every layer"),
    Column("name", TEXT, "Name", "file name of the photo"),
)
_CHOICE = (
    Column("detectors", TEXT, "Detectors", "detectors that voted, with commas"),
    Column("k", INTEGER, "k", "nearest words a descriptor"),
    Column("predicted_map", REAL, "Predicted mAP", "0 to 1, what the model expected of them"),
    Column("choice", TEXT, "Choice", "how the detectors and k came to be"),
)
_RADII = (
    Column("radius_m", REAL, "Radius 68 % (m)", "metres; the photographer stood within it, 68 %"),
    Column(
        "radius_95_m", REAL, "Radius 95 % (m)", "metres; the photographer stood within it, 95 %"
    ),
    Column("confidence", REAL, "Confidence", "0 to 1, that the photo was taken in this survey"),
    Column(
        "in_survey",
        YES_NO,
        "In survey",
        "false: no likelier to be of this survey than a photo of elsewhere",
    ),
)
_RANKED = (
    Column("rank", INTEGER, "Rank", "1 = best"),
    Column("score", REAL, "Score", "votes, higher = better; compare within one photo only"),
    Column("image", TEXT, "Image", "uri of the matched image, relative to its survey"),
)
_HEADING = Column("heading_deg", REAL, "Heading (°)", "degrees clockwise from true north")
_DERIVED = Column(
    "heading_derived", YES_NO, "Heading from track", "the heading is the track's direction"
)


@dataclass(frozen=True, slots=True)
class Layer:
    """One layer; `geometry_type` as OGR names it."""

    name: str
    geometry_type: str
    description: str
    columns: tuple[Column, ...]


QUERIES = Layer(
    "queries",
    "Point",
    "One row a photo, at its estimated place; photos without one have no geometry",
    (
        *_QUERY,
        Column("n_matches", INTEGER, "Matches", "number of matches written"),
        Column("best_score", REAL, "Best score", "score of rank 1"),
        Column("best_image", TEXT, "Best image", "uri of the image of rank 1"),
        *_RADII,
        *_CHOICE,
        Column("seconds", REAL, "Seconds", "time a worker took"),
        Column("error", TEXT, "Error", "why the photo could not be located"),
        Column("thumbnail", JPEG, "Thumbnail", "the photo, reduced, as JPEG"),
    ),
)
MATCHES = Layer(
    "matches",
    "Point",
    "Images of the survey that match, numbered by rank, where their cameras stood",
    (
        *_QUERY,
        *_RANKED,
        Column("uri", TEXT, "File", "where the image can be opened"),
        Column("image_id", INTEGER, "Image number", "number of the image in the index"),
        Column("survey", TEXT, "Survey", "name of its survey, empty for the first"),
        Column("camera", TEXT, "Camera", "name of the camera"),
        _HEADING,
        _DERIVED,
        Column("pitch_deg", REAL, "Pitch (°)", "degrees, up positive"),
        Column("roll_deg", REAL, "Roll (°)", "degrees, right side down positive"),
        Column("hfov_deg", REAL, "Field of view (°)", "degrees, horizontal"),
        Column("altitude_m", REAL, "Altitude (m)", "as the survey gives it"),
        Column("position_error_m", REAL, "Position error (m)", "metres, as the survey states it"),
        Column("captured_at", MOMENT, "Captured at", "moment of capture, UTC"),
        *_CHOICE,
        Column("generation", INTEGER, "Generation", "generation of the index that was asked"),
        Column("thumbnail", JPEG, "Thumbnail", "the image, reduced and upright, as JPEG"),
    ),
)
ESTIMATES = Layer(
    "estimates",
    "Point",
    "Where the photographers probably stood",
    (
        *_QUERY,
        *_RADII,
        Column("support", INTEGER, "Support", "matches that agree on the place"),
        *_CHOICE,
    ),
)
TARGETS = Layer(
    "targets",
    "Point",
    "What the photographs probably show: where the views of the matches meet",
    (
        *_QUERY,
        Column("radius_m", REAL, "Radius (m)", "metres; within which the views meet"),
        Column("support", INTEGER, "Support", "matches whose views meet there"),
    ),
)
LINKS = Layer(
    "links",
    "MultiLineString",
    "From each estimate to its matches",
    (
        *_QUERY,
        *_RANKED,
        Column("distance_m", REAL, "Distance (m)", "metres from the estimate to the camera"),
    ),
)
ESTIMATE_AREAS = Layer(
    "estimate_areas",
    "MultiPolygon",
    "Circles within which the photographers stood, with 68 % and with 95 % probability",
    (
        *_QUERY,
        Column("percent", INTEGER, "Probability (%)", "68 or 95"),
        Column("radius_m", REAL, "Radius (m)", "metres"),
    ),
)
VIEWS = Layer(
    "views",
    "MultiPolygon",
    "Fields of view of the matches, from true north, as far as range_m",
    (
        *_QUERY,
        *_RANKED,
        _HEADING,
        _DERIVED,
        Column("hfov_deg", REAL, "Field of view (°)", "degrees, horizontal, as drawn"),
        Column("assumed_hfov", YES_NO, "Assumed angle", "the field of view is not known"),
        Column("range_m", REAL, "Range (m)", "metres, as drawn; the camera may see farther"),
    ),
)

LAYERS = (QUERIES, MATCHES, ESTIMATES, TARGETS, LINKS, ESTIMATE_AREAS, VIEWS)
