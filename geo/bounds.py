"""The box around many places, kept as they come: memory does not grow with their number."""

import itertools
import math
from collections.abc import Sequence


class Bounds:
    """The smallest `bbox` of RFC 7946, section 5, around every position added.

    Across longitude 180 the box's west is greater than its east. Of the longitudes only the
    westernmost and the easternmost in each whole degree are kept. That is exact wherever the
    widest empty arc leaves a degree; a box around places in every degree of the Earth may be up
    to a degree wider than it must.
    """

    def __init__(self) -> None:
        self._span_in: dict[int, tuple[float, float]] = {}
        self._south = self._low = math.inf
        self._north = self._high = -math.inf

    def add(self, position: Sequence[float]) -> None:
        """Widen the box. position : longitude, latitude in degrees, perhaps a height in metres."""
        lon, lat = position[0], position[1]
        degree = math.floor(lon)
        west, east = self._span_in.get(degree, (lon, lon))
        self._span_in[degree] = (min(west, lon), max(east, lon))
        self._south, self._north = min(self._south, lat), max(self._north, lat)
        if len(position) > 2:
            self._low, self._high = min(self._low, position[2]), max(self._high, position[2])

    def bbox(self) -> list[float] | None:
        """west, south, east, north; with heights west, south, low, east, north, high.

        None: nothing was added.
        """
        if not self._span_in:
            return None
        west, east = self._narrowest_span()
        if self._low > self._high:
            return [west, self._south, east, self._north]
        return [west, self._south, self._low, east, self._north, self._high]

    def _narrowest_span(self) -> tuple[float, float]:
        """West and east of the shortest arc that holds every longitude."""
        spans = sorted(self._span_in.values())
        around = spans[0][0] + 360.0 - spans[-1][1]
        gap, west, east = max(
            ((right[0] - left[1], right[0], left[1]) for left, right in itertools.pairwise(spans)),
            default=(0.0, 0.0, 0.0),
        )
        return (west, east) if gap > around else (spans[0][0], spans[-1][1])
