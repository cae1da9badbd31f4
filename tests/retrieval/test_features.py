"""All channels of a photo together, on drawn and on real photos."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from picture_scenes import facade

from contracts.config import DESCRIPTOR_SIZES, DETECTORS, FeatureConfig
from contracts.errors import BadConfig
from retrieval.detectors import detect
from retrieval.features import Features, extract
from retrieval.pyramid import build_pyramid
from survey import decode_image

ROOT = Path(__file__).parents[2]


def test_every_channel_is_described_frame_by_frame() -> None:
    config = FeatureConfig(max_frames=50)
    features = extract(facade(), None, config)
    assert tuple(features.frames) == config.detectors
    assert tuple(features.descriptors) == config.channels()
    for channel, rows in features.descriptors.items():
        detector, descriptor = channel.split("-")
        n = len(features.frames[detector])  # type: ignore[index]
        assert rows.shape == (n, DESCRIPTOR_SIZES[descriptor])  # type: ignore[index]
        assert rows.dtype == np.uint8


def test_only_what_is_configured_is_extracted() -> None:
    config = FeatureConfig(detectors=("orb", "star"), descriptors=("sc",), max_frames=30)
    assert list(extract(facade(), None, config).descriptors) == ["orb-sc", "star-sc"]


def test_every_detector_keeps_as_many_frames_as_it_may() -> None:
    config = FeatureConfig(max_frames=60, max_frames_of={"orb": 20, "har": 90})
    found = {name: len(frames) for name, frames in extract(facade(), None, config).frames.items()}
    assert found == {**dict.fromkeys(config.detectors, 60), "orb": 20, "har": 90}


def test_frames_asked_of_a_detector_that_does_not_run_are_refused() -> None:
    with pytest.raises(BadConfig, match="max_frames names orb"):
        FeatureConfig.of(detectors=("har",), max_frames_of={"orb": 20})


def test_the_same_photo_gives_the_same_bytes() -> None:
    config = FeatureConfig(max_frames=80)
    first = extract(facade(), None, config)
    extract(facade(seed=3), None, config)
    second = extract(facade(), None, config)
    for channel, rows in first.descriptors.items():
        assert rows.tobytes() == second.descriptors[channel].tobytes()


def test_a_blank_photo_has_no_features_and_is_no_error() -> None:
    for shape in ((300, 400, 3), (1, 1, 3)):
        features = extract(np.full(shape, 255, np.uint8), None, FeatureConfig())
        assert {len(rows) for rows in features.descriptors.values()} == {0}


def test_a_mask_holds_for_every_detector() -> None:
    usable = np.zeros((360, 480), np.bool_)
    usable[:, :240] = True
    for frames in extract(facade(), usable, FeatureConfig(max_frames=100)).frames.values():
        assert len(frames) > 20
        assert (frames.xy[:, 0] < 240).all()


_WARM = """
import sys
sys.path.insert(0, sys.argv[1])
import numpy as np
from picture_scenes import facade
from contracts.config import FeatureConfig
from retrieval.features import compile_kernels, extract

def compiled():
    named = [(m, vars(m)) for n, m in sorted(sys.modules.items()) if n.startswith("retrieval.")]
    return {
        f"{module.__name__}.{key}": len(value.signatures)
        for module, names in named
        for key, value in names.items()
        if hasattr(value, "signatures")
    }

compile_kernels()
before = compiled()
extract(facade(), np.ones((360, 480), np.bool_), FeatureConfig())
extract(np.full((90, 90, 3), 9, np.uint8), None, FeatureConfig())
assert compiled() == before, (before, compiled())
print(sum(before.values()))
"""


def test_warming_up_compiles_all_that_a_photo_needs() -> None:
    here = str(Path(__file__).parent)
    done = subprocess.run(
        [sys.executable, "-c", _WARM, here], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    # Three descriptors, two steps of patches and eight of the detectors, at least.
    assert int(done.stdout) >= 13


def test_every_old_photograph_has_frames_of_most_detectors(test_data: Path) -> None:
    """Faded, halftoned, low in contrast, one of them 457 pixels wide."""
    photos = sorted((test_data / "budaors" / "then").iterdir())
    assert len(photos) == 9
    for photo in photos:
        pyramid = build_pyramid(decode_image(photo).rgb)
        found = [len(detect(pyramid, detector, 1000)) for detector in DETECTORS]
        assert sum(number >= 300 for number in found) >= 4, (photo.name, found)


def _ratio_matches(query: NDArray[np.uint8], reference: NDArray[np.uint8]) -> int:
    a, b = query.astype(np.float64), reference.astype(np.float64)
    squared = (a**2).sum(axis=1)[:, None] + (b**2).sum(axis=1) - 2 * a @ b.T
    nearest = np.partition(squared, 1, axis=1)
    return int((nearest[:, 0] < 0.8**2 * nearest[:, 1]).sum())


@pytest.fixture(scope="module")
def facades(test_data: Path) -> tuple[Features, Features, Features]:
    names = ("queries/obj10_t1.jpg", "references/obj10_1.jpg", "references/obj20_1.jpg")
    photos = [decode_image(test_data / "kth-buildings" / name).rgb for name in names]
    query, same, other = (extract(photo, None, FeatureConfig()) for photo in photos)
    return query, same, other


@pytest.mark.parametrize("channel", FeatureConfig().channels())
def test_a_facade_matches_itself_on_another_day_better_than_another_facade(
    facades: tuple[Features, Features, Features], channel: str
) -> None:
    query, same, other = (features.descriptors[channel] for features in facades)
    right, wrong = _ratio_matches(query, same), _ratio_matches(query, other)
    assert right > 60
    assert right > 2.5 * wrong
