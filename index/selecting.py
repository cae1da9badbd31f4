"""Which images of an index a search is about: those that live, and for which conditions hold."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from contracts.config import Where
from contracts.dates import span_of
from contracts.errors import BadConfig
from contracts.globs import glob_matcher
from geo.headings import wrapped_180
from geo.poses import Poses, true_headings_of
from geo.regions import box_region, places_within, polygon_region, rectangle_around
from index.opened import OpenedIndex

Value = TypeVar("Value", bound=np.generic)

MAIN = "main"
"""How people name the survey whose name is empty."""


@dataclass(frozen=True, slots=True)
class Candidates:
    """The images that a search may find, numbered from 0 among themselves.

    So that no other image counts in whatever is made of all scores. ids : (n,) int64, ascending.
    kept : (n_images,) bool, what inverted indices are read with; None: every image of the index.
    """

    ids: NDArray[np.int64]
    kept: NDArray[np.bool_] | None

    def of(self, values: NDArray[Value]) -> NDArray[Value]:
        """Their share of (n_images,) values."""
        return values if self.kept is None else values[self.ids]

    def places(self, image_ids: Collection[int]) -> tuple[int, ...]:
        """Their numbers of some images; who is no candidate has none."""
        wanted = np.array(sorted(image_ids), dtype=np.int64)
        found = np.flatnonzero(np.isin(self.ids, wanted, assume_unique=True))
        return tuple(found.tolist())


@lru_cache(maxsize=4)
def candidates(index: OpenedIndex, where: Where) -> Candidates:
    """Who can be found; kept between the photos that a process works on. Errors as `selected`."""
    kept = index.kept if where == Where() else selected(index, where)
    ids = np.arange(index.n_images) if kept is None else np.flatnonzero(kept)
    return Candidates(ids, kept)


def selected(index: OpenedIndex, where: Where) -> NDArray[np.bool_]:
    """Which live images are meant; (n_images,) bool.

    Raises
    ------
    BadConfig : the polygon does not hold.
    BadIndex : the catalogue is damaged.
    """
    ids = index.live_ids
    for condition in _conditions(index, where):
        ids = ids[condition.holds(ids)]
    meant = np.zeros(index.n_images, dtype=np.bool_)
    meant[ids] = True
    return meant


def n_selected(index: OpenedIndex, where: Where) -> int:
    """How many images are meant.

    Raises
    ------
    BadConfig : none; says how many each condition leaves on its own. Else as `selected`.
    """
    count = int(np.count_nonzero(selected(index, where)))
    if count:
        return count
    live = index.live_ids
    if not len(live):
        raise BadConfig(f"{index.root} has no image left: all were removed. Add some.")
    left = [
        f"{condition.text} leaves {np.count_nonzero(condition.holds(live))} of {len(live)} images"
        for condition in _conditions(index, where)
    ]
    together = "; together they leave none" if len(left) > 1 else ""
    raise BadConfig(f"No image is meant: {'; '.join(left)}{together}. Ask for less.")


@dataclass(frozen=True, slots=True)
class _Condition:
    """One that an image meets or not. text : as on the command line.

    holds : of image ids (m,) int64, for which it does, (m,) bool.
    """

    text: str
    holds: Callable[[NDArray[np.int64]], NDArray[np.bool_]]


def _conditions(index: OpenedIndex, where: Where) -> list[_Condition]:
    """All that are asked, the cheapest first: each is asked of those only that met the former."""
    asked: list[_Condition] = []
    if where.surveys:
        names = ", ".join(name or MAIN for name in where.surveys)
        meant = index.catalogue.is_among("survey", where.surveys)
        asked.append(_Condition(f"--survey {names}", lambda ids: meant[ids]))
    if where.uris:
        asked.append(
            _Condition(f"--uri {', '.join(where.uris)}", lambda ids: _named(index, where.uris, ids))
        )
    if where.since is not None or where.until is not None:
        options = (("--since", where.since), ("--until", where.until))
        text = " ".join(f"{option} {date}" for option, date in options if date is not None)
        asked.append(_Condition(text, lambda ids: _taken(index, where, ids)))
    if where.bbox is not None:
        text = f"--bbox {','.join(f'{each:.9g}' for each in where.bbox)}"
        asked.append(_inside(text, index, box_region(*where.bbox)))
    if where.polygon is not None:
        asked.append(_inside("--within", index, polygon_region(where.polygon)))
    if where.heading is not None:
        middle, reach = where.heading
        asked.append(
            _Condition(
                f"--heading {middle:g}±{reach:g}",
                lambda ids: np.abs(wrapped_180(_headings(index, ids) - middle)) <= reach,
            )
        )
    return asked


def _named(index: OpenedIndex, wanted: Sequence[str], ids: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Whose uri is one of those wanted, or like one that is a glob."""
    named = index.catalogue.is_among("uri", wanted)[ids]
    globs = [glob_matcher(text) for text in wanted if set(text) & set("*?[")]
    if globs:
        uris = index.catalogue.column("uri")
        for at in np.flatnonzero(~named).tolist():
            named[at] = any(matches(uris[ids[at]]) for matches in globs)
    return named


def _taken(index: OpenedIndex, where: Where, ids: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Which were taken in time; NaT, an unknown moment, is before and after nothing."""
    moments = index.catalogue.moments()[ids]
    taken = ~np.isnat(moments)
    if where.since is not None:
        taken &= moments >= span_of(where.since)[0]
    if where.until is not None:
        taken &= moments < span_of(where.until)[1]
    return taken


def _inside(text: str, index: OpenedIndex, region: BaseGeometry) -> _Condition:
    def holds(ids: NDArray[np.int64]) -> NDArray[np.bool_]:
        inside = np.zeros(len(ids), dtype=np.bool_)
        system = index.to_wgs84
        if system is None or system.area is None:
            return inside
        rectangle = rectangle_around(region, system, system.area)
        if rectangle is None:
            return inside
        x = index.catalogue.numbers("easting")[ids]
        y = index.catalogue.numbers("northing")[ids]
        near = np.flatnonzero(rectangle.holds(x, y))
        inside[near] = places_within(region, *system.lon_lat(x[near], y[near]))
        return inside

    return _Condition(text, holds)


def _headings(index: OpenedIndex, ids: NDArray[np.int64]) -> NDArray[np.float64]:
    """Clockwise from true north as results tell them; NaN: not known."""
    found = np.full(len(ids), np.nan)
    if index.to_wgs84 is None:
        return found
    catalogue = index.catalogue
    x, y = catalogue.numbers("easting")[ids], catalogue.numbers("northing")[ids]
    heading = catalogue.numbers("heading_deg")[ids]
    posed = np.flatnonzero(np.isfinite(x) & np.isfinite(y) & np.isfinite(heading))
    which = ids[posed]
    poses = Poses(
        easting=x[posed],
        northing=y[posed],
        altitude_m=catalogue.numbers("altitude_m")[which],
        heading_deg=heading[posed],
        norths=np.array(catalogue.texts("north", which), dtype=np.str_),
        captured_at=tuple(catalogue.texts("captured_at", which)),
    )
    found[posed] = true_headings_of(poses, index.to_wgs84)
    return found
