"""The photographs that features are measured on, and pairs whose geometry is known."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from survey import ReadOptions, decode_image, read_survey

_EVERY = 40
_CAMERAS = ("301", "303")


@dataclass(frozen=True, slots=True)
class Photograph:
    """One photograph. rgb : (h, w, 3) uint8, upright, at most 1024 px long."""

    name: str
    rgb: NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class WidePair:
    """Two photographs of one place and points that someone found in both.

    first_xy, second_xy : (n, 2) float64, pixels of the two pictures as decoded.
    """

    name: str
    first: NDArray[np.uint8]
    second: NDArray[np.uint8]
    first_xy: NDArray[np.float64]
    second_xy: NDArray[np.float64]


def read_photographs(data: Path) -> list[Photograph]:
    """Read every 40th KTH reference by name, and the first view of two Stereopolis cameras."""
    kth = sorted((data / "kth-buildings" / "references").iterdir())[::_EVERY]
    photographs = [Photograph(path.stem, decode_image(path).rgb) for path in kth]
    survey = read_survey(data / "stereopolis-paris6", ReadOptions()).images
    for camera in _CAMERAS:
        view = next(image for image in survey if image.camera.name == camera)
        rgb = decode_image(view.path, quarter_turns=view.quarter_turns).rgb
        photographs.append(Photograph(Path(view.path).stem, rgb))
    return photographs


def read_wide_pairs(data: Path) -> Iterator[WidePair]:
    """Read the pairs of WxBS (Mishkin et al., BMVC 2015), one at a time, by name."""
    for truth in sorted((data / "wxbs").glob("*/*/corrs.txt")):
        images = sorted(path for path in truth.parent.iterdir() if path.stem in {"01", "02"})
        first, second = (decode_image(path) for path in images)
        points = np.loadtxt(truth, ndmin=2)
        yield WidePair(
            name=f"{truth.parent.parent.name}/{truth.parent.name}",
            first=first.rgb,
            second=second.rgb,
            first_xy=(points[:, :2] + 0.5) / first.scale - 0.5,
            second_xy=(points[:, 2:] + 0.5) / second.scale - 0.5,
        )
