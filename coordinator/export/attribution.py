"""Whose images are shown: what the surveys of an index ask to be named with."""

from index.manifest import Generation


def attributions(generation: Generation) -> list[str]:
    """What the surveys say, each once, in their order; none where none says anything."""
    said = (survey.attribution for survey in generation.surveys)
    return list(dict.fromkeys(filter(None, said)))
