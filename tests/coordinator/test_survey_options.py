"""What a survey may be named."""

import pytest

from contracts.errors import BadConfig
from coordinator.cli.survey_options import survey_name


def test_no_survey_is_named_as_the_one_without_a_name_is_called() -> None:
    with pytest.raises(BadConfig, match="leave --name away"):
        survey_name("main", "refused")


@pytest.mark.parametrize("name", ["a/b", ".", ".."])
def test_a_name_is_one_folder_of_an_uri(name: str) -> None:
    with pytest.raises(BadConfig, match="refused"):
        survey_name(name, "refused")


def test_the_main_survey_has_no_name() -> None:
    assert survey_name("", "refused") == ""
