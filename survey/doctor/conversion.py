"""How exactly positions are converted to WGS 84 on this machine."""

import math
from collections.abc import Iterator

from geo.operations import Operation
from survey.doctor.findings import Finding
from survey.doctor.track import Track

_COARSE_M, _LOSS_M = 2.0, 3.0
"""Photos are placed within some 10 m at the best: a smaller loss is good to know, no more."""


def check_conversion(track: Track) -> Iterator[Finding]:
    """Shift grids that would convert better and are not installed; coarse conversions."""
    operation = track.place.operation
    reached = _metres(operation.accuracy_m)
    if operation.ballpark:
        yield Finding(
            "datum",
            "warning",
            "the datum of positions is taken for that of WGS 84, as allowed: they may be off by "
            f"hundreds of metres ({operation.name})",
            mend="without --allow-ballpark, with --crs that names the datum's shift",
        )
    elif operation.missing_grids:
        grids = ", ".join(operation.missing_grids)
        yield Finding(
            "datum-grids",
            "warning" if _lost_m(operation) > _LOSS_M else "note",
            f"positions are converted to WGS 84 within {reached} ({operation.name}); with {grids}, "
            f"which is not on this machine, within {_metres(operation.better_accuracy_m)}",
            mend=f"pyproj sync --file {operation.missing_grids[0]}",
        )
    elif operation.accuracy_m is not None and operation.accuracy_m > _COARSE_M:
        yield Finding(
            "datum",
            "note",
            f"positions are converted to WGS 84 within {reached} at best ({operation.name})",
        )


def _lost_m(operation: Operation) -> float:
    """Infinite where the accuracy that is reached is not stated."""
    if operation.accuracy_m is None:
        return math.inf
    return operation.accuracy_m - (operation.better_accuracy_m or 0.0)


def _metres(accuracy_m: float | None) -> str:
    return "an accuracy nobody states" if accuracy_m is None else f"{accuracy_m:g} m"
