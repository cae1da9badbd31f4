"""A street-level survey that Flaneur renders itself, with query photos and the truth."""

from survey.synthetic.demo import DemoQuery, DemoSurvey, render_survey
from survey.synthetic.shots import ShotOptions

__all__ = ["DemoQuery", "DemoSurvey", "ShotOptions", "render_survey"]
