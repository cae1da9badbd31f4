"""Whether headings follow the track better in another unit, sense or order of the axes."""

import numpy as np

from survey.doctor.circular import main_direction, wrapped
from survey.doctor.findings import Finding
from survey.doctor.mountings import MIN_IMAGES, moving_images
from survey.doctor.track import Floats, Track

_GOOD_DEG, _STEADY_DEG = 2.0, 15.0
_CUT_OFF_DEG = 45.0
_BETTER, _MUCH_BETTER = 0.6, 0.4
"""Another reading of the headings is likely, or sure, if it leaves less than this share of the
deviation. Degrees read as grads turn by a ninth: along a street with one corner that is not much.
"""
_WRAPPED_GRADS = 40.0


def misread_headings(track: Track) -> Finding | None:
    """What another reading makes of headings, if they follow the track much better so."""
    as_read = _total_deviation(track, track.heading_deg, track.travel_deg)
    if as_read < _GOOD_DEG:
        return None
    tried = {
        name: _total_deviation(track, headings, travel)
        for name, (headings, travel) in _other_readings(track).items()
    }
    name = min(tried, key=lambda each: tried[each])
    if tried[name] > min(_BETTER * as_read, _STEADY_DEG):
        return None
    sure = tried[name] < _MUCH_BETTER * as_read
    what, mend = _READINGS[name]
    return Finding(
        f"headings-{name}",
        "error" if sure else "warning",
        f"{what if sure else f'it seems that {what}'}: read so, headings keep to the direction of "
        f"travel within {tried[name]:.1f}°, as they are within {as_read:.1f}° only",
        mend=mend,
    )


_READINGS = {
    "grads": (
        "headings are in grads (400 a turn)",
        '--mapping with [angles] unit = "grad"',
    ),
    "radians": ("headings are in radians", '--mapping with [angles] unit = "rad"'),
    "mirrored": (
        "headings are counted counter-clockwise, or the axes x and y are swapped",
        '--mapping with [angles] heading_turn = "counterclockwise", or with x and y exchanged',
    ),
    "swapped": (
        "longitude and latitude are swapped",
        "exchange the names of the two columns, or --mapping with lon and lat in [columns]",
    ),
}
"""What each reading means, and what mends it."""


def _other_readings(track: Track) -> dict[str, tuple[Floats, Floats]]:
    """Headings and directions of travel in degrees, as they would be."""
    heading, travel = track.heading_deg, track.travel_deg
    readings = {"grads": (_from_grads(track), travel), "mirrored": (-heading, travel)}
    if np.nanmax(heading) <= 2.0 * np.pi:
        readings["radians"] = np.degrees(heading), travel
    if track.place.crs.is_geographic and np.abs(track.lon_deg).max() <= 90.0:
        readings["swapped"] = heading, _travel_if_swapped(track)
    return readings


def _from_grads(track: Track) -> Floats:
    """Readers wrap at 360, so that 0 to 40 may have been 360 to 400 grads.

    Of the two the one counts that is nearer to what the camera's other images say.
    """
    low = track.heading_deg * 0.9
    high = low + 360.0 * 0.9
    chosen = low.copy()
    for _, images in moving_images(track):
        sure = images[track.heading_deg[images] > _WRAPPED_GRADS]
        unsure = images[track.heading_deg[images] <= _WRAPPED_GRADS]
        if len(sure):
            offset = main_direction(low[sure] - track.travel_deg[sure])
            expected = track.travel_deg[unsure] + offset
            nearer = np.abs(wrapped(high[unsure] - expected)) < np.abs(
                wrapped(low[unsure] - expected)
            )
            chosen[unsure[nearer]] = high[unsure[nearer]]
    return chosen


def _travel_if_swapped(track: Track) -> Floats:
    """Degrees of longitude were measured as degrees of latitude, and the reverse."""
    travel = np.radians(track.travel_deg)
    east = np.cos(travel) * np.cos(np.radians(track.lon_deg))
    north = np.sin(travel) / np.cos(np.radians(track.lat_deg))
    return np.asarray(np.degrees(np.arctan2(east, north)))


def _total_deviation(track: Track, heading_deg: Floats, travel_deg: Floats) -> float:
    """Mean over all cameras, each about its own offset, of differences cut off at 45 degrees.

    0 where no camera has enough images. Not a median: along a street with one side street most
    images say nothing of the unit.
    """
    differences = []
    for _, images in moving_images(track):
        if len(images) >= MIN_IMAGES:
            difference = heading_deg[images] - travel_deg[images]
            differences.append(np.abs(wrapped(difference - main_direction(difference))))
    if not differences:
        return 0.0
    return float(np.minimum(np.concatenate(differences), _CUT_OFF_DEG).mean())
