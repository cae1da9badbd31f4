"""A good survey of four cameras round a block, as a table to be spoilt; pictures to go with it."""

import csv
import math
from collections.abc import Iterable
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
from PIL import Image

NOW = datetime(2024, 1, 1, tzinfo=UTC)
START = datetime(2020, 6, 1, 9, tzinfo=UTC)
CAMERAS = {"ahead": 0.0, "right": 90.0, "back": 180.0, "left": 270.0}
N_STATIONS = 60
STEP_M = 5.0
EAST_M, NORTH_M = 652_000.0, 6_862_000.0
FIELDS = ("file", "x", "y", "z", "heading", "pitch", "roll", "time", "camera")

Row = dict[str, str | float]


def stations(n: int = N_STATIONS) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """x, y in metres and the direction of travel, along a wave that ends in a bend."""
    along = np.arange(n * 20) * STEP_M / 20.0
    direction = 360.0 * along / along[-1] + 40.0 * np.sin(along / 40.0)
    x = np.cumsum(np.sin(np.radians(direction))) * STEP_M / 20.0
    y = np.cumsum(np.cos(np.radians(direction))) * STEP_M / 20.0
    return x[::20], y[::20], direction[::20] % 360.0


def good_rows(n: int = N_STATIONS) -> list[Row]:
    """Lambert-93 near 3 degrees east, where grid and true north agree."""
    rng = np.random.default_rng(3)
    rows: list[Row] = []
    for number, (x, y, direction) in enumerate(zip(*stations(n), strict=True)):
        time = START + timedelta(seconds=number)
        for camera, offset in CAMERAS.items():
            rows.append(
                {
                    "file": f"{camera}-{number:03d}.jpg",
                    "x": EAST_M + x,
                    "y": NORTH_M + y,
                    "z": 40.0 + 0.05 * number,
                    "heading": (direction + offset + rng.normal(0.0, 0.5)) % 360.0,
                    "pitch": rng.normal(0.0, 0.5),
                    "roll": rng.normal(0.0, 0.5),
                    "time": time.isoformat(),
                    "camera": camera,
                }
            )
    return rows


def at(rows: Iterable[Row], lon_deg: float, lat_deg: float) -> list[Row]:
    """The same survey around another place, in degrees; headings then count from true north."""
    moved = []
    for row in rows:
        north = (float(row["y"]) - NORTH_M) / 111_132.0
        east = (float(row["x"]) - EAST_M) / (111_320.0 * math.cos(math.radians(lat_deg)))
        moved.append({**row, "x": lon_deg + east, "y": lat_deg + north})
    return moved


def of_camera(rows: Iterable[Row], camera: str) -> list[Row]:
    return [row for row in rows if row["camera"] == camera]


def write_table(file: Path, rows: Iterable[Row], fields: Iterable[str] = FIELDS) -> Path:
    with file.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, list(fields), extrasaction="ignore")
        writer.writeheader()
        writer.writerows(rows)
    return file


def write_pictures(folder: Path, rows: Iterable[Row]) -> None:
    """A street of coarse random blocks, each picture another."""
    for number, row in enumerate(rows):
        write_picture(folder / str(row["file"]), number)


def write_picture(file: Path, seed: int, size: tuple[int, int] = (512, 384)) -> None:
    blocks = np.random.default_rng(seed).integers(0, 256, (9, 12, 3), np.uint8)
    Image.fromarray(blocks).resize(size, Image.Resampling.BILINEAR).save(file, quality=80)
