"""What can be set, with its defaults: refused on unknown keys, digested into every artefact."""

import hashlib
import json
from itertools import combinations
from math import isfinite
from typing import Annotated, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from contracts.dates import span_of
from contracts.errors import BadConfig
from contracts.faults import first_fault

Detector = Literal["hesaff", "mser", "star", "har", "orb", "colsym"]
Descriptor = Literal["sift", "surf", "sc"]
Vote = Literal["union", "intersection", "pairwise"]
Weight = Literal["idf", "norm", "burst"]
DistanceScale = Literal["range", "percentile"]
UnionDistance = Literal["sum", "mean"]
VariantName = Literal[
    "fixed", "eq1", "paper", "kp_only", "intercept", "offsets", "gain", "crowding", "look"
]
"""Forms of the regression that chooses detectors and k (retrieval/regression.py)."""
North = Literal["grid", "true", "magnetic"]

DETECTORS: tuple[Detector, ...] = ("hesaff", "mser", "star", "har", "orb", "colsym")
DESCRIPTORS: tuple[Descriptor, ...] = ("sift", "surf", "sc")
DESCRIPTOR_SIZES: dict[Descriptor, int] = {"sift": 128, "surf": 64, "sc": 36}
MAX_NEIGHBOURS = 10
"""Largest k of a query; dmin and dmax are stored for every k up to it."""


class _Frozen(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")

    @classmethod
    def of(cls, **settings: object) -> Self:
        """Build from named settings; a wrong one is `BadConfig` and says which."""
        try:
            return cls.model_validate(settings)
        except ValidationError as error:
            where, what = first_fault(error)
            message = what.removeprefix("Value error, ")
            raise BadConfig(f"{where}: {message}" if where else message) from error

    def digest(self) -> str:
        """First 16 hex digits of the SHA-256 of the settings as canonical JSON."""
        canonical = json.dumps(self.model_dump(mode="json"), sort_keys=True, separators=(",", ":"))
        return hashlib.sha256(canonical.encode()).hexdigest()[:16]


FrameCount = Annotated[int, Field(ge=1, le=20_000)]


class FeatureConfig(_Frozen):
    """How an image becomes descriptors (METHOD section 1)."""

    detectors: tuple[Detector, ...] = DETECTORS
    descriptors: tuple[Descriptor, ...] = DESCRIPTORS
    max_frames: FrameCount = 1000
    """Frames kept per detector and image."""
    max_frames_of: dict[Detector, FrameCount] = {}
    """The same for some detectors, instead of `max_frames`."""
    max_side_px: Annotated[int, Field(ge=16, le=16_384)] = 1024
    max_pixels: Annotated[int, Field(ge=1)] = 250_000_000

    @model_validator(mode="after")
    def _makes_sense(self) -> Self:
        for name, chosen in (("detectors", self.detectors), ("descriptors", self.descriptors)):
            if not chosen or len(set(chosen)) != len(chosen):
                raise ValueError(f"{name} must be named once each, at least one; got {chosen}")
        unknown = set(self.max_frames_of) - set(self.detectors)
        if unknown:
            raise ValueError(f"max_frames names {', '.join(sorted(unknown))}, which does not run")
        return self

    def frames_of(self, detector: Detector) -> int:
        """How many frames of a detector are kept at most."""
        return self.max_frames_of.get(detector, self.max_frames)

    def channels(self) -> tuple[str, ...]:
        """Every detector-descriptor name, such as `hesaff-sift`, in index order."""
        return tuple(f"{det}-{desc}" for det in self.detectors for desc in self.descriptors)

    def pairs(self) -> tuple[tuple[Detector, Detector], ...]:
        """Every unordered pair of detectors, in index order."""
        return tuple(combinations(self.detectors, 2))


class CodebookConfig(_Frozen):
    """How a channel's visual words are made (METHOD section 2)."""

    codebook_ratio: Annotated[float, Field(gt=0, le=1)] = 0.2
    max_words: Annotated[int, Field(ge=1, le=1_000_000)] = 20_000
    max_train_points: Annotated[int, Field(ge=1)] = Field(
        default_factory=lambda given: max(1_000_000, 4 * given.get("max_words", 0))
    )
    """Descriptors that words are made from: a million, or four a word where that is more."""
    seed: Annotated[int, Field(ge=0, lt=2**31)] = 0


class IndexConfig(_Frozen):
    """All that decides an index's bytes. Shard size and workers are absent on purpose."""

    features: FeatureConfig = FeatureConfig()
    codebooks: CodebookConfig = CodebookConfig()


class Where(_Frozen):
    """Which images of an index are meant: those for which every condition given holds.

    An image that does not say (no pose, no date) is not meant where it is asked.
    """

    bbox: tuple[float, float, float, float] | None = None
    """West, south, east, north in WGS 84 degrees; west may lie east of east, across 180."""
    polygon: Annotated[str, Field(max_length=1_000_000)] | None = None
    """WKT of a polygon or several, WGS 84 longitude and latitude (geo/regions.py)."""
    since: str | None = None
    until: str | None = None
    """ISO 8601; a day, month or year `until` counts to its end; without a zone: UTC."""
    heading: tuple[float, float] | None = None
    """Degrees clockwise from true north, and how far to either side."""
    surveys: tuple[str, ...] = ()
    """As the catalogue names them: the main survey is ""."""
    uris: tuple[str, ...] = ()
    """Uris, or globs of them (contracts/globs.py)."""

    @model_validator(mode="after")
    def _makes_sense(self) -> Self:
        if self.bbox is not None:
            _check_bbox(*self.bbox)
        if self.heading is not None:
            middle, reach = self.heading
            if not (isfinite(middle) and 0.0 <= reach <= 180.0):
                raise ValueError(
                    "a heading takes a direction and 0 to 180 degrees to either side, such as "
                    f"180±45; got {middle:g}±{reach:g}"
                )
        since = None if self.since is None else span_of(self.since)[0]
        until = None if self.until is None else span_of(self.until)[1]
        if since is not None and until is not None and until <= since:
            raise ValueError(f"until {self.until} lies before since {self.since}; swap them")
        return self


def _check_bbox(west: float, south: float, east: float, north: float) -> None:
    on_earth = all(-180.0 <= lon <= 180.0 for lon in (west, east))
    if not (on_earth and -90.0 <= south <= north <= 90.0):
        raise ValueError(
            "a box takes west,south,east,north in degrees of longitude and latitude, such as "
            f"2.33,48.85,2.35,48.86; got {west:g},{south:g},{east:g},{north:g}"
        )


class SearchConfig(_Frozen):
    """How a photo is searched for (METHOD sections 3 and 4)."""

    pair: tuple[Detector, ...] | Literal["auto"] = "auto"
    """One detector or more, each once, or `auto`: the model chooses a pair."""
    k: Annotated[int, Field(ge=1, le=MAX_NEIGHBOURS)] | Literal["auto"] = "auto"
    descriptors: tuple[Descriptor, ...] | None = None
    """None: all that the index has."""
    vote: Vote = "pairwise"
    weights: tuple[Weight, ...] = ("idf", "norm")
    top: Annotated[int, Field(ge=1, le=10_000)] = 10
    max_images: Annotated[int, Field(ge=1)] | None = None
    """The T of the multi-sequence walk (`union` only); None: T does not bind."""
    distance_scale: DistanceScale = "range"
    """What is d' = 1: the largest distance to the k-th word in the codebook's sample, or its
    99th percentile, beyond which d' stays 1. For every vote."""
    union_distance: UnionDistance = "sum"
    """A cell of L words is as far as the sum of their d', so that a vote may be negative down to
    1 - L, or as their mean (`union` only; the same for one descriptor)."""

    where: Where = Where()
    """Only these images are candidates."""

    @model_validator(mode="after")
    def _makes_sense(self) -> Self:
        if self.pair != "auto" and (not self.pair or len(set(self.pair)) != len(self.pair)):
            raise ValueError(f"--pair takes one to six different detectors; got {self.pair}")
        if self.vote != "union" and self.max_images is not None:
            raise ValueError("max_images belongs to the vote `union`")
        if self.vote != "union" and self.union_distance != "sum":
            raise ValueError("union_distance belongs to the vote `union`")
        return self
