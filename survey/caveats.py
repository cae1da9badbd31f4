"""What a person should know of how positions and headings reach WGS 84 and true north."""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from contracts.records import PosedImage
from geo.crs import ToWgs84
from geo.magnetic import FIRST_YEAR, LAST_YEAR, decimal_years, declination_deg

WHY_NO_DECLINATION = (
    f"its declination is not known: dates must be {FIRST_YEAR:.0f} to {LAST_YEAR - 1:.0f} and not "
    "near a magnetic pole; their matches will show no direction"
)


def caveats(images: Sequence[PosedImage], place: ToWgs84) -> Iterator[str]:
    """A sentence for each thing that a person should know.

    images : all with a pose, in the system of `place`.

    Raises
    ------
    UnknownCrs : a position has no place on the Earth.
    """
    if place.operation.ballpark:
        yield (
            f"positions are converted to WGS 84 by {place.operation.name}: off by up to hundreds "
            "of metres, as --allow-ballpark permits"
        )
    magnetic = [image for image in images if image.pose and image.pose.north == "magnetic"]
    lost = int(without_declination(magnetic, _declination_deg(magnetic, place)).sum())
    if lost:
        yield (f"{lost:,} magnetic headings cannot be turned to true north: {WHY_NO_DECLINATION}")


def without_declination(
    images: Sequence[PosedImage], declination_deg: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """(n,) which headings count from a magnetic north that is not known.

    declination_deg : (n,) of each image's place and day, NaN: not known.
    """
    stated = [
        image.pose is not None
        and image.pose.north == "magnetic"
        and image.pose.heading_deg is not None
        for image in images
    ]
    return np.array(stated, bool) & ~np.isfinite(declination_deg)


def _declination_deg(images: Sequence[PosedImage], place: ToWgs84) -> NDArray[np.float64]:
    poses = [pose for image in images if (pose := image.pose) is not None]
    lon, lat = place.lon_lat([pose.easting for pose in poses], [pose.northing for pose in poses])
    years = decimal_years([image.captured_at for image in images])
    heights = np.zeros(len(images))  # of no account: see `declination_deg`
    return declination_deg(lon, lat, heights, years)
