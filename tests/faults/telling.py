"""What the schedules of a session came to, for the summary at its end."""

from schedules import Story

STORIES: list[Story] = []
