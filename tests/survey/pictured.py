"""A survey of empty pictures: readers of tables open none of them."""

from pathlib import Path

from contracts.records import Pose
from survey import ReadOptions, Survey

AS_IT_IS = ReadOptions(cut_panoramas=False, derive_headings=False)
L93 = ReadOptions(crs="EPSG:2154", cut_panoramas=False, derive_headings=False)


def pictured(folder: Path, *names: str) -> Path:
    """The folder, with empty files of these names in it."""
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).touch()
    return folder


def pose_of(survey: Survey, uri: str = "a.jpg") -> Pose:
    """The pose of one image."""
    (pose,) = [image.pose for image in survey.images if image.uri == uri]
    assert pose is not None
    return pose


def reasons(survey: Survey) -> dict[str, str]:
    return {skip.uri: skip.reason for skip in survey.skipped}
