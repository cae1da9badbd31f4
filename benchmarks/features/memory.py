"""What an extract worker holds at most, by the format of a 24-megapixel image."""

import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

from benchmarks.table import print_table

STATUS = Path("/proc/self/status")
SIZE = (6000, 4000)
FORMATS = {
    "JPEG": ("large.jpg", {"quality": 92}),
    "JPEG, progressive": ("progressive.jpg", {"quality": 92, "progressive": True}),
    "PNG": ("large.png", {"compress_level": 1}),
    "TIFF": ("large.tif", {}),
    "WebP": ("large.webp", {"quality": 90}),
}
EXTRACT = """
import sys
import workers.tasks
from benchmarks.features.memory import own_peak_mb
from contracts.config import FeatureConfig
from contracts.records import PosedImage
from retrieval.features import compile_kernels
from workers.stages.extract import image_features

compile_kernels()
if sys.argv[1:]:
    image_features(PosedImage("large", sys.argv[1]), FeatureConfig())
print(own_peak_mb())
"""


def run(data: Path) -> None:
    """Enlarge one photograph, save it in every format, and extract each in a fresh process."""
    source = min((data / "kth-buildings" / "references").glob("*.jpg"))
    rows: list[tuple[str, str]] = [("(kernels compiled, no image)", _peak_mb())]
    with tempfile.TemporaryDirectory() as scratch, Image.open(source) as photo:
        large = photo.convert("RGB").resize(SIZE, Image.Resampling.BICUBIC)
        for name, (file, options) in FORMATS.items():
            path = Path(scratch) / file
            large.save(path, **options)
            rows.append((name, _peak_mb(str(path))))
    print_table((f"{SIZE[0]} x {SIZE[1]} pixels", "peak MB"), rows)


def own_peak_mb() -> int:
    """What this process has held at most; not ru_maxrss, which it inherits from its parent."""
    lines = STATUS.read_text().splitlines()
    return next(int(line.split()[1]) // 1024 for line in lines if line.startswith("VmHWM"))


def _peak_mb(*photo: str) -> str:
    done = subprocess.run(
        [sys.executable, "-c", EXTRACT, *photo], capture_output=True, text=True, check=True
    )
    return done.stdout.strip()
