"""Pose tables: text, JSON and layers of points, with the column names in use or a mapping."""

from survey.tables.reader import READER

__all__ = ["READER"]
