"""Read a survey: choose the reader, check what it found, put it in order."""

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np

from contracts.errors import BadSurvey
from contracts.places import Place, place_of
from contracts.records import Pose, PosedImage, Skipped
from geo.crs import ToWgs84
from survey.caveats import caveats
from survey.options import Reader, Reading, ReadOptions, Survey, selector
from survey.panorama import cut_panoramas
from survey.poses import outside_area
from survey.readers import choose_reader
from survey.track import with_track_headings


def read_survey(path: Place, options: ReadOptions) -> Survey:
    """Every image of a survey, with its pose, in the order of the bytes of the uris.

    The order and the content depend on the files alone, never on the order in which a file
    system lists them.

    Raises
    ------
    BadSurvey : nothing there, no image, no pose where poses are wanted, or metadata that does
        not hold. UnknownCrs : coordinates whose system is missing, unknown or has no exact
        conversion to WGS 84. BadConfig : `options.format` names no reader.
    """
    path = place_of(str(path))
    reader = choose_reader(path, options)
    reading = read_wanted(reader, path, options)
    if reading.crs is not None:
        reading = _inside_area(reading, path)
        reading = _with_caveats(reading, options)
        if options.derive_headings:
            reading = _with_headings(reading)
    if options.cut_panoramas:
        images, uncut = cut_panoramas(reading.images)
        reading = replace(reading, images=images, skipped=reading.skipped + uncut)
    if not reading.images:
        raise BadSurvey(why_empty(path, reading.skipped, options))
    return Survey(
        images=tuple(sorted(map(_named(options), reading.images), key=_uri_bytes)),
        skipped=_ordered(reading.skipped, options),
        crs=reading.crs,
        format=reader.name,
        notes=reading.notes,
    )


def _with_caveats(reading: Reading, options: ReadOptions) -> Reading:
    """A conversion that is missing is refused now, not when the first photo is to be placed."""
    posed = [image for image in reading.images if image.pose is not None]
    if reading.crs is None or not posed:
        return reading
    poses = [pose for image in posed if (pose := image.pose) is not None]
    x, y = [pose.easting for pose in poses], [pose.northing for pose in poses]
    place = ToWgs84.over(reading.crs, x, y, options.allow_ballpark)
    return replace(reading, notes=(*reading.notes, *caveats(posed, place)))


def _with_headings(reading: Reading) -> Reading:
    """Images without heading get their track's direction, and a note says how many."""
    if reading.crs is None:
        return reading
    images = with_track_headings(reading.images, reading.crs)
    n_derived = sum(image.pose is not None and image.pose.heading_derived for image in images)
    if n_derived == 0:
        return reading
    note = (
        f"{n_derived} of {len(images)} images have no heading: they get their track's direction, "
        "as if the camera looked forward (--no-track-headings leaves them without)"
    )
    return replace(reading, images=images, notes=(*reading.notes, note))


def read_wanted(reader: Reader, path: Place, options: ReadOptions) -> Reading:
    """What a reader finds of what is asked for, with poses if they are wanted; not yet judged.

    Raises
    ------
    BadSurvey, UnknownCrs : as the reader does.
    """
    wanted = selector(options)
    reading = reader.read(path, options, wanted)
    images = [image for image in reading.images if wanted(image.uri)]
    if options.no_pose:
        images = [replace(image, pose=None) for image in images]
    return replace(
        reading,
        images=tuple(images),
        skipped=tuple(skip for skip in reading.skipped if wanted(skip.uri)),
        crs=None if options.no_pose else reading.crs,
    )


def _inside_area(reading: Reading, path: Place) -> Reading:
    """Leave out poses that lie far from where the coordinate system is used."""
    crs, poses = reading.crs, [image.pose for image in reading.images]
    known = [pose for pose in poses if pose is not None]
    if crs is None or not known or len(known) != len(poses):
        return reading
    outside = outside_area(known, crs)
    if not outside.any():
        return reading
    if outside.all():
        raise BadSurvey(_all_outside(path, known[0], crs))
    reason = "easting {:g}, northing {:g} lie far outside the area of use of {}"
    skipped = tuple(
        Skipped(reading.images[at].uri, reason.format(known[at].easting, known[at].northing, crs))
        for at in np.flatnonzero(outside)
    )
    kept = tuple(image for image, out in zip(reading.images, outside, strict=True) if not out)
    return replace(reading, images=kept, skipped=reading.skipped + skipped)


def _all_outside(path: Place, first: Pose, crs: str) -> str:
    return (
        f"survey {path}: every pose lies far outside the area of use of {crs}; the first has "
        f"easting (x) {first.easting:g}, northing (y) {first.northing:g}. Either x and y are "
        "swapped or the coordinate system is another: mend the columns or give --crs"
    )


def why_empty(path: Place, skipped: tuple[Skipped, ...], options: ReadOptions) -> str:
    """What a person is told of a survey without one usable image."""
    if skipped:
        reasons = Counter(skip.reason for skip in skipped)
        reason, count = reasons.most_common(1)[0]
        return (
            f"survey {path}: not one usable image; {len(skipped)} were skipped, {count} of them "
            f"because: {reason} (first: {skipped[0].uri})"
        )
    if options.include or options.exclude:
        return (
            f"survey {path}: no image is left by --include {list(options.include)} and "
            f"--exclude {list(options.exclude)}; globs are matched against the path within the "
            "survey, such as 'images/*/*.jpg'"
        )
    return f"survey {path} is empty: no image in it or its folders (JPEG, PNG, TIFF, WebP...)"


def _named(options: ReadOptions) -> Callable[[PosedImage], PosedImage]:
    return lambda image: replace(image, uri=options.uri(image.uri))


def _uri_bytes(image: PosedImage) -> bytes:
    return image.uri.encode()


def _ordered(skipped: Iterable[Skipped], options: ReadOptions) -> tuple[Skipped, ...]:
    named = (Skipped(options.uri(skip.uri), skip.reason) for skip in skipped)
    return tuple(sorted(named, key=lambda skip: (skip.uri.encode(), skip.reason)))
