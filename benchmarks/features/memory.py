"""What an extract worker holds at most, by the format of a 24-megapixel image."""

import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

from benchmarks.table import print_table

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
from pathlib import Path
import workers.tasks
from contracts.config import FeatureConfig
from contracts.records import PosedImage
from retrieval.features import compile_kernels
from workers.stages.extract import image_features

compile_kernels()
if sys.argv[1:]:
    image_features(PosedImage("large", sys.argv[1]), FeatureConfig())
# Not ru_maxrss, which a process inherits from the one that starts it.
status = Path("/proc/self/status").read_text().splitlines()
print(next(int(line.split()[1]) // 1024 for line in status if line.startswith("VmHWM")))
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


def _peak_mb(*photo: str) -> str:
    done = subprocess.run(
        [sys.executable, "-c", EXTRACT, *photo], capture_output=True, text=True, check=True
    )
    return done.stdout.strip()
