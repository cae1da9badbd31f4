"""URIs that other software can open: of files, and of one image within a file."""

from pathlib import Path
from urllib.parse import quote

from contracts.places import is_url


def image_uri(path: str, fragment: str = "") -> str:
    """The `file://` URI (RFC 8089) of an image; of one in a store, that of the store.

    Every byte of the path that a URI may not hold is percent-encoded, also those of a name that
    is not UTF-8.

    Parameters
    ----------
    path : absolute, or a URL with its letters as the store has them. fragment : what within the
        file is the image (`survey.fragments`), already percent-encoded; "" = all of it.

    Raises
    ------
    ValueError : `path` is relative, which a `file://` URI cannot be.
    """
    if is_url(path):
        protocol, _, name = path.partition("://")
        uri = f"{protocol}://{quote(name, safe='/:')}"
    else:
        uri = Path(path).as_uri()
    return f"{uri}#{fragment}" if fragment else uri
