"""Which coordinate operation PROJ has between two systems, and how good it is."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import pyproj
from pyproj.transformer import AreaOfInterest, TransformerGroup

from contracts.errors import UnknownCrs


@dataclass(frozen=True, slots=True)
class Operation:
    """How coordinates were converted: what a result has to say of itself.

    name : of the operation, as its authority has it. definition : what PROJ computes.
    accuracy_m : as the authority states it, 0.0 for a projection alone; None: not stated.
    missing_grids : shift grids of a better operation that are not on this machine, sorted.
    better_accuracy_m : what that operation would reach; None: there is none, or not stated.
    ballpark : no operation of known accuracy exists, the datums were taken for one another.
    """

    name: str
    definition: str
    accuracy_m: float | None
    missing_grids: tuple[str, ...]
    better_accuracy_m: float | None
    ballpark: bool


@dataclass(frozen=True, slots=True)
class Converter:
    """A PROJ transformer, x before y, and what is to be said of it."""

    transformer: pyproj.Transformer
    operation: Operation


def best_converter(
    source: pyproj.CRS, target: pyproj.CRS, area: AreaOfInterest | None, allow_ballpark: bool
) -> Converter:
    """The best operation between two systems, of those whose grids are on this machine.

    Parameters
    ----------
    source, target : any two systems.
    area : where the points lie: one operation is chosen for all of it. None: not known, so that
        PROJ chooses anew for each point, no more can be said than of its worst choice, and a
        place near where two operations meet may come back some metres away.
    allow_ballpark : take the datums for one another where PROJ knows nothing better. The points
        may then be off by hundreds of metres.

    Raises
    ------
    UnknownCrs : PROJ has no operation, or only a ballpark one, which is not allowed.
    """
    group = _group(source, target, area, allow_ballpark=False)
    if area is not None and not group.transformers:
        # Made for another part of the Earth, still better than none: stray points have a place.
        return best_converter(source, target, None, allow_ballpark)
    missing, better_m = _better(group)
    ballpark = not group.transformers
    if ballpark and not allow_ballpark:
        raise UnknownCrs(_refusal(source, target, missing))
    choices = group.transformers
    if ballpark:
        choices = _group(source, target, area, allow_ballpark=True).transformers
    if not choices:
        raise UnknownCrs(
            f"PROJ {pyproj.proj_version_str} has no way from {source.name} to {target.name}; "
            "name another coordinate system"
        )
    transformer = choices[0]
    if area is None and len(choices) > 1:
        transformer = pyproj.Transformer.from_crs(
            source, target, always_xy=True, allow_ballpark=ballpark
        )
    else:
        choices = choices[:1]
    operation = Operation(
        name=" or ".join(dict.fromkeys(_name(choice) for choice in choices)),
        definition=" or ".join(dict.fromkeys(choice.definition for choice in choices)),
        accuracy_m=None if ballpark else _worst_accuracy_m(choices),
        missing_grids=missing,
        better_accuracy_m=better_m,
        ballpark=ballpark,
    )
    return Converter(transformer, operation)


def missing_grids(
    source: pyproj.CRS, target: pyproj.CRS, area: AreaOfInterest | None
) -> tuple[str, ...]:
    """Names of grids that the best operation needs and this machine lacks, sorted."""
    return _better(_group(source, target, area, allow_ballpark=False))[0]


def joined(first: Operation, then: Operation, missing: tuple[str, ...]) -> Operation:
    """Two operations, one after the other, where a better one lacks the grids `missing`."""
    accuracies = (first.accuracy_m, then.accuracy_m)
    known = [accuracy for accuracy in accuracies if accuracy is not None]
    return Operation(
        name=f"{first.name}, then back by {then.name}",
        definition=f"{first.definition}; back by {then.definition}",
        accuracy_m=sum(known) if len(known) == len(accuracies) else None,
        missing_grids=missing,
        better_accuracy_m=None,
        ballpark=first.ballpark or then.ballpark,
    )


def _group(
    source: pyproj.CRS, target: pyproj.CRS, area: AreaOfInterest | None, allow_ballpark: bool
) -> TransformerGroup:
    with warnings.catch_warnings():
        # A better grid that is missing is reported by `Operation.missing_grids`.
        warnings.simplefilter("ignore", UserWarning)
        return TransformerGroup(
            source, target, always_xy=True, area_of_interest=area, allow_ballpark=allow_ballpark
        )


def _better(group: TransformerGroup) -> tuple[tuple[str, ...], float | None]:
    """Grids that the best operation lacks, and its accuracy; () and None where it can be had."""
    if group.best_available or not group.unavailable_operations:
        return (), None
    best = group.unavailable_operations[0]
    names = {grid.short_name for grid in best.grids if not grid.available}
    return tuple(sorted(names)), None if best.accuracy < 0 else float(best.accuracy)


def _worst_accuracy_m(choices: Sequence[pyproj.Transformer]) -> float | None:
    accuracies = [float(choice.accuracy) for choice in choices]
    return None if min(accuracies) < 0 else max(accuracies)


def _name(transformer: pyproj.Transformer) -> str:
    """The operation's name without PROJ's own steps, which say nothing to a person."""
    steps = [step for step in transformer.description.split(" + ") if "axis order" not in step]
    return " + ".join(steps) or transformer.description


def _refusal(source: pyproj.CRS, target: pyproj.CRS, missing: tuple[str, ...]) -> str:
    grids = ", ".join(missing) or "its survey uses"
    return (
        f"coordinate system {source.srs!r} ({source.name}) has no conversion to {target.name} of "
        "known accuracy, only a ballpark one; name it by its authority's code, or give its shift "
        f"(+towgs84 or a bound system), or install the shift grid {grids} (pyproj sync), or "
        "accept an error of up to hundreds of metres (--allow-ballpark)"
    )
