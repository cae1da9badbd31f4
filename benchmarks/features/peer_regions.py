"""Our component tree beside OpenCV's MSER: are its regions ours, and are their ellipses right?"""

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from benchmarks.features.pairs import read_photographs
from benchmarks.features.warps import Picture
from benchmarks.table import print_table
from retrieval.detectors.component_tree import TOP_LEVEL, build_tree, region_moments
from retrieval.detectors.mser import moment_ellipses
from retrieval.pyramid import build_pyramid

Doubles = NDArray[np.float64]

_MIN_AREA = 60
"""OpenCV's default."""


def run(data: Path) -> None:
    """Print the share of OpenCV's regions in our trees, and what our ellipses are off by.

    OpenCV's regions are lists of pixels; their moments are taken by plain sums. A region is ours
    if one of the same area has the same centre.
    """
    rows = []
    for photograph in read_photographs(data):
        grey = np.minimum(build_pyramid(photograph.rgb).grey8, TOP_LEVEL)
        regions, _ = cv2.MSER.create(min_area=_MIN_AREA).detectRegions(grey)
        pixels = [np.asarray(region, np.float64) for region in regions]
        centres = np.array([(len(region), *region.mean(axis=0)) for region in pixels])
        spreads = np.array([4 * np.cov(region.T, bias=True) for region in pixels])
        ours, shape = _all_regions(grey)
        distance, nearest = KDTree(ours).query(centres)
        squared = shape[nearest] @ shape[nearest].transpose(0, 2, 1)
        same = (distance < 1e-3) & (shape[nearest, 0, 0] > 0)
        off = np.abs(squared - spreads).max(axis=(1, 2)) / np.abs(spreads).max(axis=(1, 2))
        found = f"{(distance < 1e-3).sum()}/{len(pixels)}"
        rows.append(
            (photograph.name, found, f"{distance[same].max():.0e}", f"{off[same].max():.0e}")
        )
    print("OpenCV's MSER regions in our trees; largest differences of those\n")
    print_table(("", "found", "centre, px", "ellipse, relative"), rows)


def _all_regions(grey: Picture) -> tuple[Doubles, Doubles]:
    """Area, x and y (n, 3) and shape (n, 2, 2) of the dark and the bright regions."""
    rows, shapes = [], []
    for picture in (grey, np.asarray(TOP_LEVEL - grey, np.uint8)):
        tree = build_tree(picture, _MIN_AREA)
        moments = region_moments(tree, np.arange(len(tree.area)))
        rows.append(np.column_stack((tree.area, moments[:, :2])))
        shapes.append(moment_ellipses(moments[:, 2], moments[:, 3], moments[:, 4]))
    return np.concatenate(rows), np.concatenate(shapes).astype(np.float64)
