"""MCAP files: images that stay inside them, placed by the poses recorded beside them."""

from survey.mcap.reader import READER

__all__ = ["READER"]
