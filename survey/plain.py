"""A folder of images without poses (`--no-pose`)."""

from collections.abc import Callable

from contracts.places import Place
from contracts.records import PosedImage
from survey.files import list_images
from survey.options import Reader, Reading, ReadOptions


def recognises(path: Place) -> bool:
    """Never by itself: that poses are missing on purpose is for the user to say."""
    del path
    return False


def read(path: Place, options: ReadOptions, wanted: Callable[[str], bool]) -> Reading:
    """Every image of the folder, with no pose."""
    del options
    root = path if path.is_dir() else path.parent
    listing = list_images(root)
    images = tuple(
        PosedImage(uri=uri, path=file) for uri, file in listing.paths.items() if wanted(uri)
    )
    return Reading(images, listing.skipped, crs=None)


READER = Reader("plain", recognises, read)
