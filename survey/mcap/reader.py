"""MCAP files of robots and mobile mapping: images stay inside, poses are joined by time.

North: true for positions in degrees, grid for those of a projected `--crs`, as the east-north-up
world of ROS REP 103 means it; the `north` option overrides it.
"""

from collections.abc import Callable

from contracts.errors import BadSurvey
from contracts.places import Place
from contracts.records import PosedImage, Skipped
from survey.mcap.drives import drives
from survey.mcap.listing import is_mcap, mcap_files
from survey.mcap.placing import placed
from survey.mcap.posing import (
    bare_images,
    posed_images,
    refuse_unless_inside,
    system,
    topics,
)
from survey.mcap.recording import Recording, read_recording
from survey.options import Reader, Reading, ReadOptions
from survey.stored import is_file


def recognises(path: Place) -> bool:
    """A file that begins as MCAP does or is named so, or a folder with one that does both."""
    if is_file(path):
        return is_mcap(path) or path.suffix.lower() == ".mcap"
    return bool(mcap_files(path)[0])


def read(path: Place, options: ReadOptions, wanted: Callable[[str], bool]) -> Reading:
    """Every image message asked for; no image is decoded.

    Raises
    ------
    BadSurvey : no MCAP file, no image in them, or no positions.
    UnknownCrs : positions are in a frame of their own and no `--crs` says what it is.
    """
    files, skipped = mcap_files(path)
    if not files:
        raise BadSurvey(_why_none(path))
    recordings: dict[str, Recording] = {}
    for name, file in files.items():
        prefix = "" if is_file(path) else f"{name}/"
        try:
            recordings[name] = read_recording(
                file, name, prefix, wanted, with_poses=not options.no_pose
            )
        except OSError as error:
            skipped.append(Skipped(name, f"cannot be read: {error.strerror}"))
    found = drives(recordings)
    skipped += [skip for drive in found for skip in drive.skipped]
    notes = [note for drive in found for note in drive.notes]
    if not skipped and not any(drive.images for drive in found):
        raise BadSurvey(
            f"survey {path}: no image messages that were asked for; expected CompressedImage, "
            f"RawImage or Image among its topics: {topics(found)}"
            + "".join(f"; {note}" for note in notes)
        )
    if options.no_pose:
        bare = [image for drive in found for image in bare_images(drive)]
        return Reading(tuple(bare), tuple(skipped), None, tuple(notes))
    return _posed(path, found, options, skipped, notes)


def _why_none(path: Place) -> str:
    if path.is_dir():
        return f"survey {path}: no MCAP file in the folder (names end in .mcap)"
    if not path.stat().st_size:
        return f"survey {path} is empty (0 bytes); copy or record it again"
    return (
        f"survey {path} is no MCAP file: it does not begin as one does. If its beginning was lost, "
        "copy it again; a file that only lacks its end can be read"
    )


def _posed(
    path: Place,
    found: list[Recording],
    options: ReadOptions,
    skipped: list[Skipped],
    notes: list[str],
) -> Reading:
    meaning = system(str(path), found, options)
    places = [
        (drive, place)
        for drive in found
        for place in placed(drive, options.max_gap_s, local=meaning.local)
    ]
    crs = meaning.named([place for _, place in places])
    images: list[PosedImage] = []
    for drive, place in places:
        posed, without = posed_images(drive, place, crs, meaning.north)
        images += posed
        skipped += without
        notes += place.notes
    if meaning.local:
        refuse_unless_inside(str(path), images, crs, found)
    return Reading(tuple(images), tuple(skipped), crs, tuple(dict.fromkeys(notes)))


READER = Reader("mcap", recognises, read)
