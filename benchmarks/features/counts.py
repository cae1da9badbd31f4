"""How many frames each detector finds in faded, halftoned and small old photographs."""

from pathlib import Path

from benchmarks.table import print_table
from contracts.config import DETECTORS, FeatureConfig
from retrieval.detectors import detect
from retrieval.pyramid import build_pyramid
from survey import decode_image

ENOUGH = 300


def run(data: Path) -> None:
    """Print a row an old photograph: its size, and the frames of each detector."""
    config = FeatureConfig()
    rows = []
    for photo in sorted((data / "budaors" / "then").iterdir()):
        rgb = decode_image(photo).rgb
        pyramid = build_pyramid(rgb)
        counts = [
            len(detect(pyramid, detector, config.frames_of(detector))) for detector in DETECTORS
        ]
        enough = sum(count >= ENOUGH for count in counts)
        rows.append((photo.name, f"{rgb.shape[1]} x {rgb.shape[0]}", *counts, enough))
    print_table(("photo", "size", *DETECTORS, f"detectors with {ENOUGH} frames"), rows)
