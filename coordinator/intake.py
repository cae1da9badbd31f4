"""Reading surveys: they become one ordered list of images in one coordinate system."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

from contracts.errors import BadConfig, BadSurvey
from contracts.places import Place
from contracts.records import PosedImage, Skipped
from geo.reprojection import reproject
from survey import ReadOptions, Survey, read_survey


@dataclass(frozen=True, slots=True)
class NamedSurvey:
    """A survey as the command line names it; the main one has the name ''."""

    name: str
    path: Place
    survey: Survey


@dataclass(frozen=True, slots=True)
class Intake:
    """All images that are to be indexed together, in the order of their uris."""

    surveys: tuple[NamedSurvey, ...]
    images: tuple[PosedImage, ...]
    survey_names: tuple[str, ...]
    """The survey of each image."""
    skipped: tuple[Skipped, ...]
    crs: str | None
    notes: tuple[str, ...]
    allow_ballpark: bool

    def without_images(self) -> "Intake":
        """The same, without what the shards of a job have by now: a kilobyte an image."""
        surveys = (
            replace(named, survey=replace(named.survey, images=())) for named in self.surveys
        )
        return replace(self, surveys=tuple(surveys), images=())


def read_surveys(
    sources: Sequence[tuple[str, Place]], options: ReadOptions, crs: str | None = None
) -> Intake:
    """Read every survey; `sources` are (name, path), the main survey's name is ''.

    crs : what poses are converted into; None: that of the first survey with poses.

    Raises
    ------
    BadSurvey : one is empty or no survey. UnknownCrs : a CRS cannot be converted.
    BadConfig : two have the same name.
    """
    name, count = Counter(name for name, _ in sources).most_common(1)[0]
    if count > 1:
        raise BadConfig(f"--also names {name!r} {count} times; give each survey its own name.")
    surveys = tuple(
        NamedSurvey(name, path, read_survey(path, replace(options, name=name)))
        for name, path in sources
    )
    if crs is None:
        crs = next((named.survey.crs for named in surveys if named.survey.crs is not None), None)
    if crs is not None:
        surveys = tuple(_in_crs(named, crs, options.allow_ballpark) for named in surveys)
    tagged = sorted(
        ((image, named.name) for named in surveys for image in named.survey.images),
        key=lambda pair: pair[0].uri.encode(),
    )
    if not tagged:
        raise BadSurvey("No image of the survey can be used; see the reasons above.")
    images = tuple(image for image, _ in tagged)
    for former, later in pairwise(images):
        if former.uri == later.uri:
            raise BadSurvey(
                f"Two images are called {later.uri!r}. Give each --also survey its own name."
            )
    return Intake(
        surveys=surveys,
        images=images,
        survey_names=tuple(name for _, name in tagged),
        skipped=tuple(skip for named in surveys for skip in named.survey.skipped),
        crs=crs,
        notes=tuple(note for named in surveys for note in named.survey.notes),
        allow_ballpark=options.allow_ballpark,
    )


def _in_crs(named: NamedSurvey, crs: str, allow_ballpark: bool) -> NamedSurvey:
    """A survey with its poses in the CRS of the index, and a note of how they were converted."""
    survey = named.survey
    if survey.crs in {crs, None}:
        return named
    posed = [row for row, image in enumerate(survey.images) if image.pose is not None]
    poses = [pose for image in survey.images if (pose := image.pose) is not None]
    found = reproject(poses, crs, allow_ballpark)
    images = list(survey.images)
    for row, pose in zip(posed, found.poses, strict=True):
        images[row] = replace(images[row], pose=pose)
    notes = (*survey.notes, *found.told(named.name))
    return replace(named, survey=replace(survey, images=tuple(images), crs=crs, notes=notes))
