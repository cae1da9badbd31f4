"""Bare extraction: processes that do nothing but decode images and describe them."""

import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

from workers.run import worker_environment

_PROGRAM = "from benchmarks.scaling.bare import main; main()"


def bare_extraction(survey: Path, n_processes: int) -> tuple[float, list[float]]:
    """Let each of some processes extract its part of a survey, all at once.

    Returns
    -------
    images a second, of all processes until the last one is done; and the seconds of each image.
    """
    processes = [
        subprocess.Popen(
            [sys.executable, "-c", _PROGRAM, str(survey), str(number), str(n_processes)],
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, **worker_environment()},
        )
        for number in range(n_processes)
    ]
    each = [np.fromstring(process.communicate()[0], sep=" ") for process in processes]
    if any(process.returncode for process in processes):
        raise RuntimeError(f"bare extraction of {survey} failed")
    seconds = np.concatenate(each)
    return len(seconds) / max(part.sum() for part in each), seconds.tolist()


def main() -> None:
    """Extract every n-th image of a survey, and print the seconds of each.

    Arguments: the survey, where to begin, and n.
    """
    import cv2

    from contracts.config import FeatureConfig
    from retrieval.features import compile_kernels
    from survey import ReadOptions, read_survey
    from workers.stages.extract import image_features

    cv2.setNumThreads(1)
    compile_kernels()
    survey, number, n_processes = Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])
    for image in read_survey(survey, ReadOptions()).images[number::n_processes]:
        began = time.perf_counter()
        image_features(image, FeatureConfig())
        print(time.perf_counter() - began)
