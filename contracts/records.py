"""The records that travel between rooms."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contracts.config import North


@dataclass(frozen=True, slots=True)
class Pose:
    """Where a camera stood and how it looked, in its survey's own coordinates.

    `easting` and `northing` are in the axis unit of `crs`, always x before y: metres for a
    projected system, degrees of longitude and latitude for a geographic one. `heading_deg` is
    clockwise from `north`, of the optical axis; `pitch_deg` is up positive; `roll_deg` is right
    side down positive. None: not known. `crs` may be compound or three-dimensional: then it says
    from what `altitude_m` counts. `heading_derived`: the heading is the track's direction, not
    measured. `position_error_m`: as the survey states it, horizontal.
    """

    easting: float
    northing: float
    crs: str
    altitude_m: float | None = None
    heading_deg: float | None = None
    pitch_deg: float | None = None
    roll_deg: float | None = None
    north: North = "grid"
    heading_derived: bool = False
    position_error_m: float | None = None


@dataclass(frozen=True, slots=True)
class Camera:
    """What is known of the lens; angles in degrees, of the upright image."""

    name: str = ""
    hfov_deg: float | None = None
    width_px: int | None = None
    height_px: int | None = None


@dataclass(frozen=True, slots=True)
class PosedImage:
    """One image of a survey, before it is numbered.

    `uri` is relative to its survey, NFC, with `/`, prefixed `NAME/` for `--also` surveys;
    `path` can be opened; `fragment` says what within that file is the image (a message of an MCAP
    file, a view cut from a panorama; survey/fragments.py), "" = all of it. `quarter_turns`
    counter-clockwise turns of 90 degrees put the stored image upright (after EXIF). `mask_path`
    is stored turned like the image; bright = not scenery.
    `captured_at` is ISO 8601 with a zone, or None.
    """

    uri: str
    path: str
    pose: Pose | None = None
    camera: Camera = Camera()
    captured_at: str | None = None
    quarter_turns: int = 0
    mask_path: str | None = None
    fragment: str = ""


@dataclass(frozen=True, slots=True)
class Skipped:
    """An image that was left out, and why."""

    uri: str
    reason: str


@dataclass(frozen=True, slots=True)
class Frames:
    """Local affine frames of one detector in one image, best response first.

    xy : (n, 2) float32, pixels of the detection image, centre of the top-left pixel is (0, 0).
    shape : (n, 2, 2) float32, maps the unit circle to the frame's region (columns dx, dy order).
    response : (n,) float32, descending.
    """

    xy: NDArray[np.float32]
    shape: NDArray[np.float32]
    response: NDArray[np.float32]

    def __len__(self) -> int:
        return len(self.xy)


@dataclass(frozen=True, slots=True)
class Postings:
    """An inverted index of one channel: word -> ascending unique image ids.

    indptr : (n_words + 1,) int64. image_ids : (n_postings,) uint32.
    """

    indptr: NDArray[np.int64]
    image_ids: NDArray[np.uint32]

    @property
    def n_words(self) -> int:
        return len(self.indptr) - 1


@dataclass(frozen=True, slots=True)
class PackedPostings:
    """An inverted index of one channel as it is stored, a word's images packed into bytes.

    offsets : (n_words + 1,) int64, where each word's bytes begin. counts : (n_words,) uint32,
    images of each word. packed : (n_bytes,) uint8; retrieval/packing.py.
    """

    offsets: NDArray[np.int64]
    counts: NDArray[np.uint32]
    packed: NDArray[np.uint8]

    @property
    def n_words(self) -> int:
        return len(self.counts)

    @property
    def n_postings(self) -> int:
        return int(self.counts.sum(dtype=np.int64))


@dataclass(frozen=True, slots=True)
class Match:
    """One image of a ranking. rank : 1 = best."""

    image_id: int
    rank: int
    score: float


@dataclass(frozen=True, slots=True)
class Receipt:
    """Proof that one task of a job is done: what it wrote, and how much.

    outputs : path relative to the index -> sha256. counts : totals to add up. made_from : a digest
    of what else it depends on than the job, such as the words.
    """

    stage: str
    key: str
    outputs: dict[str, str]
    counts: dict[str, int]
    skipped: tuple[Skipped, ...] = ()
    instruction_set: str = ""
    made_from: str = ""
