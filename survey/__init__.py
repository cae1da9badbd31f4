"""What a survey is on disk: one reader per format, one decoder for every image."""

from survey.decode import DecodedImage, decode_image, decode_mask
from survey.options import ReadOptions, Survey
from survey.reading import read_survey

__all__ = [
    "DecodedImage",
    "ReadOptions",
    "Survey",
    "decode_image",
    "decode_mask",
    "read_survey",
]
