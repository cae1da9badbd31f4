"""What Flaneur finds for every photo, before it is said how sure that is."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter
from rich.console import Console
from rich.progress import track

from benchmarks.placing.photos import Asked, Known, Shot
from contracts.config import SearchConfig
from geo.confidence import Evidence, prominence
from geo.frames import LocalMetres
from index.opened import OpenedIndex
from retrieval.fusion import Scores, rank
from retrieval.score_curves import curve_features
from workers.stages.choose import choose
from workers.stages.place import ESTIMATE_FROM, find, searched_density
from workers.stages.retrieve import Photo, read_photo, search_photo
from workers.stages.spots import ground_of, spots_of


@dataclass(frozen=True, slots=True)
class Placed:
    """One photo's answer and how far it is from the truth.

    error_m : of the estimate; None: the photo is not of this survey. target_radius_m : None: no
    target was given; target_error_m : of it; None: nothing to compare with.
    """

    index: str
    set: str
    group: str
    evidence: Evidence
    distances_m: tuple[float, ...]
    error_m: float | None
    target_radius_m: float | None
    target_error_m: float | None


@dataclass(frozen=True, slots=True)
class Standing:
    """How far the best answer stands out, with the photo's place in the index and without."""

    set: str
    found: bool
    with_place: float
    without_place: float


_PLACED = TypeAdapter(list[Placed])
_STANDINGS = TypeAdapter(list[Standing])


def placed_photos(asked: Asked, kept: Path) -> list[Placed]:
    """Place every photo, or read from the file `kept` what was found before."""
    if not kept.is_file():
        kept.parent.mkdir(parents=True, exist_ok=True)
        shots = track(asked.shots, asked.name, console=Console(stderr=True))
        found = [_placed(asked, shot) for shot in shots]
        kept.write_bytes(_PLACED.dump_json(found))
    return _PLACED.validate_json(kept.read_bytes())


def standings(index: OpenedIndex, photos: Sequence[Known], kept: Path) -> list[Standing]:
    """Search for every photo, with the images of its place and with their scores taken away."""
    if not kept.is_file():
        kept.parent.mkdir(parents=True, exist_ok=True)
        shown = track(photos, "real sets", console=Console(stderr=True))
        found = [_standing(index, photo) for photo in shown]
        kept.write_bytes(_STANDINGS.dump_json(found))
    return _STANDINGS.validate_json(kept.read_bytes())


def _placed(asked: Asked, shot: Shot) -> Placed:
    scores, density = _scores(asked.index, read_photo(asked.index, str(shot.path)))
    matches = rank(scores, ESTIMATE_FROM)
    rows = asked.index.catalogue.rows([match.image_id for match in matches])
    ground = ground_of(asked.index)
    finding = (
        None
        if ground is None
        else find(matches, rows, spots_of(rows, ground), ground, scores, density)
    )
    if finding is None:
        raise ValueError(f"{shot.path} has no match with a pose in {asked.index.root}")
    target = finding.target
    return Placed(
        index=asked.name,
        set=shot.set,
        group=shot.group,
        evidence=finding.evidence,
        distances_m=tuple(np.round(finding.distances_m, 1).tolist()),
        error_m=_metres(shot.place, finding.place.lon_deg, finding.place.lat_deg),
        target_radius_m=None if target is None else target.radius_m,
        target_error_m=(
            None if target is None else _metres(shot.looks_at, target.lon_deg, target.lat_deg)
        ),
    )


def _standing(index: OpenedIndex, photo: Known) -> Standing:
    scores, density = _scores(index, read_photo(index, str(photo.path)))
    others = np.setdiff1d(np.arange(index.n_images), sorted(photo.relevant))
    best = rank(scores, 1)
    return Standing(
        set=photo.set,
        found=bool(best) and best[0].image_id in photo.relevant,
        with_place=_prominence(scores, density),
        without_place=_prominence(_of(scores, others), density),
    )


def _scores(index: OpenedIndex, photo: Photo) -> tuple[Scores, float]:
    """Of all images, and the density of the channels that were searched."""
    search = SearchConfig()
    chosen = choose(index, photo, search)
    scores = search_photo(index, photo, chosen, search)
    return scores, searched_density(index, chosen)


def _of(scores: Scores, images: NDArray[np.int64]) -> Scores:
    return Scores(scores.values[images], scores.touched[images])


def _prominence(scores: Scores, density: float) -> float:
    n_images = len(scores.values)
    found = prominence(curve_features(scores, n_images).z_score, n_images, density)
    if found is None:
        raise ValueError(f"{n_images} images are too few to tell what stands out of them")
    return found


def _metres(truth: tuple[float, float] | None, lon_deg: float, lat_deg: float) -> float | None:
    if truth is None:
        return None
    x, y = LocalMetres(*truth).from_lon_lat([lon_deg], [lat_deg])
    return float(np.hypot(x[0], y[0]))
