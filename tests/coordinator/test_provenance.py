"""Where results come from, and whose images they show."""

from pathlib import Path

import pytest
from made_catalogue import ROW, index_of
from made_results import failed, made_estimate

from coordinator.cli.locate import _Tally
from coordinator.export.attribution import attributions
from coordinator.export.geojson import provenance
from coordinator.querying import Located


def test_results_name_whose_images_they_show(tmp_path: Path) -> None:
    index = index_of(tmp_path, [ROW], "EPSG:2154")
    assert provenance(index)["attribution"] == ["© A survey"]


def test_each_survey_is_named_once_and_one_that_says_nothing_not_at_all(tmp_path: Path) -> None:
    generation = index_of(tmp_path, [ROW], "EPSG:2154").generation
    (segment,), (entry,) = generation.segments, generation.surveys
    said = [entry.model_copy(update={"attribution": text}) for text in ("B", "", "© A survey", "B")]
    told = segment.model_copy(update={"surveys": tuple(said)})
    assert attributions(generation.model_copy(update={"segments": (told,)})) == [
        "B",
        "© A survey",
    ]


@pytest.mark.parametrize(("in_survey", "counted"), [((True, False, False), 2), ((True,), 0)])
def test_photos_that_may_be_of_another_place_are_counted(
    in_survey: tuple[bool, ...], counted: int
) -> None:
    answers = [
        Located(f"{n}.jpg", (made_estimate(f"{n}.jpg", 2.0, 48.0, in_survey=each),), 0.1)
        for n, each in enumerate(in_survey)
    ]
    tally = _Tally()
    list(tally.count([*answers, failed("gone.jpg")]))
    assert tally.n_doubtful == counted
