"""The text files of a kapture folder: comma separated, `#` begins a comment (format 1.1)."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contracts.errors import BadSurvey
from contracts.places import Place
from contracts.records import Camera
from geo.rotations import rotations_from_quaternions
from survey.poses import finite_number

_PARTS = ("qw", "qx", "qy", "qz", "tx", "ty", "tz")
# Camera models of COLMAP whose middle of the picture is a pinhole's: where cx stands among the
# parameters, after width, height and the focal length along x.
_CX_AT = {
    "SIMPLE_PINHOLE": 3,
    "SIMPLE_RADIAL": 3,
    "RADIAL": 3,
    "PINHOLE": 4,
    "OPENCV": 4,
    "FULL_OPENCV": 4,
}


@dataclass(frozen=True, slots=True)
class Rigid:
    """x_device = rotation @ x_world + translation_m; of a rig, x_sensor from x_rig.

    rotation : (3, 3) float64. translation_m : (3,) float64.
    """

    rotation: NDArray[np.float64]
    translation_m: NDArray[np.float64]

    def after(self, first: "Rigid") -> "Rigid":
        """`first`, then this."""
        return Rigid(
            self.rotation @ first.rotation,
            self.rotation @ first.translation_m + self.translation_m,
        )


@dataclass(frozen=True, slots=True)
class Line:
    """A line that is no comment. number : counted from 1. cells : without spaces around."""

    number: int
    cells: list[str]


def lines(path: Place) -> Iterator[Line]:
    """The lines of a file that hold something.

    Raises
    ------
    BadSurvey : the file cannot be read or is not UTF-8.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise BadSurvey(f"{path} cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise BadSurvey(f"{path} is not UTF-8: {error}; save it as UTF-8") from error
    for number, line in enumerate(text.split("\n"), start=1):
        if line.strip() and not line.lstrip().startswith("#"):
            yield Line(number, [cell.strip() for cell in line.split(",")])


def timestamp(text: str) -> int:
    """Raises ValueError where it is no integer."""
    try:
        return int(text)
    except ValueError:
        raise ValueError(f"timestamp is {text[:40]!r}, expected an integer") from None


def pose_numbers(cells: list[str]) -> list[float]:
    """Seven cells: qw, qx, qy, qz, tx, ty, tz.

    Raises
    ------
    ValueError : a part is missing, as kapture allows, is no number or no rotation, or there are
        more; says which.
    """
    if len(cells) > len(_PARTS):
        raise ValueError(f"a pose of {len(cells)} numbers, expected 7; are commas decimal?")
    missing = [name for name, cell in zip(_PARTS, cells, strict=False) if not cell]
    missing += _PARTS[len(cells) :]
    if missing:
        raise ValueError(f"a partial pose without {', '.join(missing)}")
    numbers = [finite_number(name, cell) for name, cell in zip(_PARTS, cells, strict=False)]
    if not math.hypot(*numbers[:4]) > 0.0:
        raise ValueError("quaternion 0, 0, 0, 0 is no rotation")
    return numbers


def rigids(numbers: list[list[float]]) -> list[Rigid]:
    """The transforms of many rows of `pose_numbers`."""
    rows = np.array(numbers, np.float64).reshape(-1, len(_PARTS))
    rotations = rotations_from_quaternions(*rows[:, :4].T)
    return [Rigid(*parts) for parts in zip(rotations, rows[:, 4:], strict=True)]


def camera(sensor_id: str, cells: list[str]) -> Camera:
    """A camera from its line of sensors.txt: id, name, `camera`, model, parameters.

    The field of view is that of the pinhole in the model, without its distortion; not known for
    a fisheye.

    Raises
    ------
    ValueError : parameters that cannot be.
    """
    model, texts = (cells[3] if len(cells) > 3 else ""), cells[4:]
    numbers = [finite_number(f"parameter {at + 1}", text) for at, text in enumerate(texts) if text]
    if len(numbers) < 2:
        return Camera(sensor_id)
    width, height = numbers[:2]
    if not (width >= 1.0 and height >= 1.0):
        raise ValueError(f"size is {width:g} x {height:g}, expected at least one pixel")
    at = _CX_AT.get(model)
    hfov_deg = None
    if at is not None:
        if len(numbers) <= at or not numbers[2] > 0.0:
            raise ValueError(f"a {model} camera with parameters {', '.join(texts)[:80]}")
        focal, centre = numbers[2], numbers[at]
        left, right = math.atan(centre / focal), math.atan((width - centre) / focal)
        hfov_deg = math.degrees(left + right)
    return Camera(sensor_id, hfov_deg, int(width), int(height))
