"""From the antenna to the camera: positions moved along the lever arm."""

import numpy as np
import pyproj

from survey.mcap.frames import FrameTree
from survey.mcap.tracks import Asked, Floats

_ELLIPSOID = pyproj.Geod(ellps="WGS84")
_LONGEST_LEVER_M = 30.0


def lever_m(tree: FrameTree, antenna: str, camera: str, asked: Asked) -> Floats | str:
    """(m, 3) metres from the antenna to the camera, in the camera's axes, or why not known."""
    if antenna == camera:
        return np.zeros((len(asked), 3))
    lies = tree.between(camera, antenna, asked)
    if lies is None or not tree.mounted(camera, antenna):
        return f"no fixed transforms join it to the antenna's frame {antenna!r}"
    if np.abs(lies.position).max(initial=0.0) > _LONGEST_LEVER_M:
        return f"the antenna's frame {antenna!r} lies more than {_LONGEST_LEVER_M:g} m away"
    return -lies.position


def moved_by(position: Floats, offset_m: Floats) -> Floats:
    """Positions (m, 3), longitude, latitude, height, moved by (m, 3) metres east, north and up.

    On the WGS 84 ellipsoid. A position whose offset is NaN stays where it is.
    """
    found = position.copy()
    known = np.isfinite(offset_m).all(axis=1) & np.isfinite(position[:, :2]).all(axis=1)
    east, north, up = offset_m[known].T
    found[known, 0], found[known, 1], _ = _ELLIPSOID.fwd(
        position[known, 0],
        position[known, 1],
        np.degrees(np.arctan2(east, north)),
        np.hypot(east, north),
    )
    found[known, 2] += up
    return found
