"""Where a compass points: the declination of the World Magnetic Model.

The model of NOAA and the British Geological Survey, evaluated by pygeomag (MIT).
"""

import functools
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pygeomag import GeoMag
from pygeomag.wmm.wmm_2010 import WMM_2010
from pygeomag.wmm.wmm_2015v2 import WMM_2015v2
from pygeomag.wmm.wmm_2020 import WMM_2020
from pygeomag.wmm.wmm_2025 import WMM_2025

FIRST_YEAR, LAST_YEAR = 2010.0, 2030.0
"""Outside these the declination is not known: no model of the field is at hand."""
_EPOCHS = np.array([2010.0, 2015.0, 2020.0, 2025.0])
_COEFFICIENTS = (WMM_2010, WMM_2015v2, WMM_2020, WMM_2025)
_CELL = np.array([0.01, 0.01, 500.0, 0.1])
"""Degrees, degrees, metres, years within which one value serves: off by about 0.01 degrees, where
the model itself is off by 0.3."""
_LOWEST_M, _HIGHEST_M = -1_000.0, 850_000.0


def declination_deg(
    lon_deg: ArrayLike, lat_deg: ArrayLike, height_m: ArrayLike, decimal_year: ArrayLike
) -> NDArray[np.float64]:
    """Bearing of magnetic north from true north, east positive: true = magnetic + declination.

    Parameters
    ----------
    lon_deg, lat_deg : (n,) WGS 84. height_m : (n,) above the ellipsoid or the sea; NaN: taken as
        0, which is off by less than 0.01 degrees for each kilometre.
    decimal_year : (n,), such as 2020.5 (`decimal_years`).

    Returns
    -------
    declination_deg : (n,) float64 in [-180, 180], NaN where it is not known: before 2010 and from
    2030, without date or place, and near the magnetic poles where a compass is of no use
    (horizontal intensity under 2000 nT, the model's "blackout zone").

    Raises
    ------
    ValueError : not (n,) alike.
    """
    columns = [np.asarray(part, np.float64) for part in (lon_deg, lat_deg, height_m, decimal_year)]
    if any(column.ndim != 1 or column.shape != columns[0].shape for column in columns):
        shapes = " and ".join(str(column.shape) for column in columns)
        raise ValueError(f"lon, lat, height and year must be (n,) alike; got {shapes}")
    points = np.column_stack(columns)
    points[:, 2] = np.clip(np.nan_to_num(points[:, 2]), _LOWEST_M, _HIGHEST_M)
    year = points[:, 3]
    known = np.isfinite(points).all(axis=1) & (year >= FIRST_YEAR) & (year < LAST_YEAR)
    found = np.full(len(points), np.nan)
    if not known.any():
        return found
    models = np.searchsorted(_EPOCHS, year[known], side="right") - 1
    cells = np.column_stack([np.round(points[known] / _CELL), models]).astype(np.int64)
    lowest = cells.min(axis=0)
    numbers = np.ravel_multi_index((cells - lowest).T, cells.max(axis=0) - lowest + 1)
    _, first, which = np.unique(numbers, return_index=True, return_inverse=True)
    values = np.array([_of_cell(*map(int, cell)) for cell in cells[first]])
    found[known] = values[which]
    return found


def decimal_years(captured_at: Sequence[str | None]) -> NDArray[np.float64]:
    """Years with their fraction, (n,) float64, of ISO 8601 dates or times; NaN for None.

    The day counts, not the hour: the field turns by less than 0.001 degrees a day.

    Raises
    ------
    ValueError : one does not begin with a date.
    """
    days = np.array([text[:10] if text else "NaT" for text in captured_at], "datetime64[D]")
    years = days.astype("datetime64[Y]")
    start, end = years.astype("datetime64[D]"), (years + 1).astype("datetime64[D]")
    fraction = (days - start) / (end - start)
    return np.where(np.isnat(days), np.nan, years.astype(np.int64) + 1970 + fraction)


@functools.lru_cache(maxsize=65536)
def _of_cell(lon: int, lat: int, height: int, year: int, model: int) -> float:
    """Declination in the middle of a cell, NaN in the blackout zone."""
    lon_deg, lat_deg, height_m, decimal_year = np.array([lon, lat, height, year]) * _CELL
    found = _model(model).calculate(
        glat=float(np.clip(lat_deg, -90.0, 90.0)),
        glon=float(lon_deg),
        alt=float(height_m) / 1000.0,
        time=float(decimal_year),
        allow_date_outside_lifespan=True,  # the middle of a cell on New Year of 2015
    )
    return float("nan") if found.in_blackout_zone else float(found.d)


@functools.cache
def _model(number: int) -> GeoMag:
    return GeoMag(coefficients_data=_COEFFICIENTS[number])
