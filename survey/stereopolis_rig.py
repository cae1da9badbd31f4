"""The rig of a Stereopolis vehicle: `cameraCalibration.json`.

Conventions, as iTowns 1 reads the same file and as the images confirm
(docs/decisions/0003-stereopolis-north.md):

- `position` is the camera's centre in the vehicle's frame FRD (forward, right, down), metres.
- `rotation`, row-major, maps FRD to the *upright* camera's frame (optical axis, left, up).
- `orientation` says how the JPEG is stored: 0, 1, 2, 3 = to be turned by 1, 3, 2, 0 quarter
  turns counter-clockwise. Sky cameras (3) are stored as their rotation has them.
- `projection` and `distortion` are of the stored image at `size`; the distortion maps ideal
  pixels to stored ones: r -> r (1 + a r^2 + b r^4 + c r^6), r from `pps`.
"""

import json
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contracts.errors import BadSurvey
from contracts.places import Place
from geo.attitude import is_rotation

_QUARTER_TURNS = {0: 1, 1: 3, 2: 2, 3: 0}


@dataclass(frozen=True, slots=True)
class RigCamera:
    """One camera of the rig.

    frd_from_camera : (3, 3) float64, columns right, down, optical axis of the upright image.
    lever_arm_m : (3,) float64 in FRD. mask : local uri of the vehicle's mask, or None.
    """

    name: str
    frd_from_camera: NDArray[np.float64]
    lever_arm_m: NDArray[np.float64]
    quarter_turns: int
    hfov_deg: float
    mask: str | None


def read_rig(path: Place) -> dict[str, RigCamera]:
    """Cameras by name, as in the files' names.

    Raises
    ------
    BadSurvey : unreadable, or a camera whose numbers do not hold.
    """
    cameras: dict[str, RigCamera] = {}
    for entry in read_json_list(path):
        try:
            camera = _camera(entry)
        except (KeyError, TypeError, ValueError) as error:
            name = entry.get("id", "?") if isinstance(entry, dict) else "?"
            what = f"no {error}" if isinstance(error, KeyError) else str(error)
            raise BadSurvey(f"{path}: camera {name}: {what}; mend the calibration") from error
        if camera.name in cameras:
            raise BadSurvey(f"{path}: camera {camera.name} is there twice; keep one")
        cameras[camera.name] = camera
    return cameras


def read_json_list(path: Place) -> list[object]:
    """The list that a JSON file holds.

    Raises
    ------
    BadSurvey : unreadable, not JSON, or not a list.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise BadSurvey(f"{path} cannot be read: {error.strerror}") from error
    except (ValueError, RecursionError) as error:
        raise BadSurvey(f"{path} is not JSON in UTF-8: {error}") from error
    if not isinstance(content, list):
        raise BadSurvey(f"{path} holds a {type(content).__name__}, expected a list of objects")
    return content


def _camera(entry: object) -> RigCamera:
    if not isinstance(entry, dict):
        raise TypeError(f"a {type(entry).__name__}, expected an object")
    orientation = entry["orientation"]
    if orientation not in _QUARTER_TURNS:
        raise ValueError(f"orientation is {orientation!r}, expected 0, 1, 2 or 3")
    axis, left, up = _numbers(entry, "rotation", 9).reshape(3, 3)
    frd_from_camera = np.stack([-left, -up, axis], axis=1)
    if not is_rotation(frd_from_camera):
        raise ValueError(f"rotation {entry['rotation']} is not a rotation matrix")
    mask = entry.get("mask")
    quarter_turns = _QUARTER_TURNS[orientation]
    return RigCamera(
        name=str(entry["id"]),
        frd_from_camera=frd_from_camera,
        lever_arm_m=_numbers(entry, "position", 3),
        quarter_turns=quarter_turns,
        hfov_deg=_hfov_deg(entry, along=quarter_turns % 2),
        mask=None if mask is None else str(mask),
    )


def _hfov_deg(entry: dict[str, object], along: int) -> float:
    """Field of view between the middles of the upright image's left and right edges.

    along : axis of the stored image that is horizontal once upright, 0 = x, 1 = y. The lens
    compresses the edges: without its distortion Paris-140616 would see 84 degrees instead of 92.
    """
    projection = _numbers(entry, "projection", 9).reshape(3, 3)
    size = _numbers(entry, "size", 2)
    focal, principal = projection[along, along], projection[along, 2]
    if not (focal > 0.0 and size[along] > 0.0):
        raise ValueError(f"focal length {focal:g} and size {size[along]:g} must be above 0")
    centre, terms = principal, np.zeros(3)
    distortion = entry.get("distortion")
    if isinstance(distortion, dict):
        centre = float(_numbers(distortion, "pps", 2)[along])
        terms = _numbers(distortion, "poly357", 3)
    edges = [
        centre + math.copysign(_ideal_radius(abs(edge - centre), terms), edge - centre) - principal
        for edge in (0.0, float(size[along]))
    ]
    return math.degrees(math.atan(edges[1] / focal) - math.atan(edges[0] / focal))


def _ideal_radius(stored: float, terms: NDArray[np.float64]) -> float:
    """Smallest r with r (1 + a r^2 + b r^4 + c r^6) = stored, by fixed point."""
    ideal = stored
    for _ in range(200):
        square = ideal * ideal
        factor = 1.0 + square * (terms[0] + square * (terms[1] + square * terms[2]))
        if not factor > 0.0:
            break
        closer = stored / factor
        if abs(closer - ideal) < 1e-6:
            return float(closer)
        ideal = closer
    raise ValueError(f"distortion {terms.tolist()} cannot be inverted at {stored:g} px")


def _numbers(entry: dict[str, object], key: str, count: int) -> NDArray[np.float64]:
    values = np.asarray(entry[key], np.float64)
    if values.shape != (count,) or not np.isfinite(values).all():
        raise ValueError(f"{key} is {entry[key]}, expected {count} finite numbers")
    return values
