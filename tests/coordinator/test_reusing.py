"""Words decide what an index made with them can be."""

import pytest
from made_index import FEATURES, made_index

from contracts.config import CodebookConfig
from contracts.errors import BadConfig
from coordinator.reusing import config_of_words, misfit
from index.word_sets import WordSet, open_words


@pytest.fixture(scope="module")
def words(tmp_path_factory: pytest.TempPathFactory) -> WordSet:
    root = tmp_path_factory.mktemp("made")
    made_index(root, sizes=(2,), seed=3)
    return open_words(root).words


def test_by_default_an_index_is_what_its_words_are_for(words: WordSet) -> None:
    config = config_of_words(words, (), (), {})
    assert config == words.config
    assert config.codebooks == CodebookConfig(max_words=20, seed=3)


def test_some_of_the_channels_may_be_chosen(words: WordSet) -> None:
    features = config_of_words(words, (), ("sc",), {"max_frames": 50}).features
    assert features.channels() == ("hesaff-sc",)
    assert features.max_frames == FEATURES.max_frames


@pytest.mark.parametrize(
    ("detectors", "descriptors", "limits", "said"),
    [
        (("hesaff", "orb"), (), {}, "--detectors: .* not for orb; they are for hesaff"),
        ((), ("surf",), {}, "--descriptors: .* not for surf; they are for sift, sc"),
        ((), (), {"max_frames": 51}, "--max-frames: .* for 50 frames of hesaff an image, not 51"),
    ],
)
def test_what_the_words_are_not_for_is_refused(
    words: WordSet,
    detectors: tuple[str, ...],
    descriptors: tuple[str, ...],
    limits: dict[str, object],
    said: str,
) -> None:
    with pytest.raises(BadConfig, match=said):
        config_of_words(words, detectors, descriptors, limits)


def test_words_that_do_not_fit_are_told_with_their_channels(words: WordSet) -> None:
    as_before = dict(words.quantisation)
    assert misfit(as_before, as_before, "train") is None
    said = misfit(as_before, {**as_before, "hesaff-sc": 100 * as_before["hesaff-sc"]}, "train")
    assert said is not None
    assert "in hesaff-sc (100.0 times)" in said
    assert "hesaff-sift" not in said
