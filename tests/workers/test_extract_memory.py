"""What a process holds at most while it extracts a large image."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from benchmarks.features.memory import STATUS

ROOT = Path(__file__).parents[2]

_EXTRACT = """
import sys
import workers.tasks
from benchmarks.features.memory import own_peak_mb
from contracts.config import FeatureConfig
from contracts.records import PosedImage
from retrieval.features import compile_kernels
from workers.stages.extract import image_features

compile_kernels()
decoded, features = image_features(PosedImage("large", sys.argv[1]), FeatureConfig())
assert (decoded.width_px, decoded.height_px) == (6000, 4000), decoded
assert sum(map(len, features.frames.values())) > 1000
assert not {"geopandas", "sklearn", "pandas"} & set(sys.modules)
print(own_peak_mb())
"""


@pytest.mark.skipif(not STATUS.exists(), reason=f"peak memory is read from {STATUS}")
@pytest.mark.parametrize("suffix", [".jpg", ".png", ".tif"])
def test_an_image_of_24_megapixels_takes_less_than_600_mb(suffix: str, tmp_path: Path) -> None:
    small = np.random.default_rng(0).integers(0, 256, (80, 120, 3), dtype=np.uint8)
    path = tmp_path / f"large{suffix}"
    options = {"compress_level": 1} if suffix == ".png" else {}
    Image.fromarray(small).resize((6000, 4000), Image.Resampling.BICUBIC).save(path, **options)
    done = subprocess.run(
        [sys.executable, "-c", _EXTRACT, str(path)],
        cwd=ROOT,
        env={**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) < 600
