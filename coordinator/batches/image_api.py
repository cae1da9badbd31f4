"""IIIF Image API 1 to 3: asking a server for an image no larger than it is wanted.

https://iiif.io/api/image/
"""

import re
from typing import Any

from coordinator.batches.iiif import id_of, objects, pixels

Json = dict[str, Any]


def image_url(service: Json, width_px: int, height_px: int, max_side_px: int) -> str | None:
    """The address of a whole image, at most `max_side_px` long where the server can do that.

    Parameters
    ----------
    service : as a manifest describes it, or its own info.json.
    width_px, height_px : of the whole image, where the manifest tells; else 0.

    Returns
    -------
    None : what is told is too little to ask; its info.json says more.
    """
    version, level = _version(service), _level(service)
    width_px = pixels(service.get("width")) or width_px
    height_px = pixels(service.get("height")) or height_px
    whole = "max" if version == 3 else "full"
    if width_px and height_px and max(width_px, height_px) <= max_side_px:
        return _request(service, version, whole)
    if level == 2:
        return _request(service, version, f"!{max_side_px},{max_side_px}")
    if not (width_px and height_px):
        return None
    if level == 1:
        width = max(1, round(width_px * max_side_px / max(width_px, height_px)))
        return _request(service, version, f"{width},")
    if "sizes" not in service and "tiles" not in service:  # not its info.json yet
        return None
    return _request(service, version, _listed_size(service, version, max_side_px) or whole)


def info_url(service: Json) -> str:
    """The address of what a server says of an image."""
    return f"{id_of(service).rstrip('/')}/info.json"


def _listed_size(service: Json, version: int, max_side_px: int) -> str | None:
    """The smallest size offered that is not too small, or the largest offered."""
    sizes = [
        (width, height)
        for each in objects(service.get("sizes"))
        if (width := pixels(each.get("width"))) and (height := pixels(each.get("height")))
    ]
    if not sizes:
        return None
    ample = [size for size in sizes if max(size) >= max_side_px]
    width, height = min(ample) if ample else max(sizes)
    return f"{width},{height}" if version == 3 else f"{width},"


def _request(service: Json, version: int, size: str) -> str:
    quality = "native" if version == 1 else "default"
    return f"{id_of(service).rstrip('/')}/full/{size}/0/{quality}.jpg"


def _version(service: Json) -> int:
    said = f"{service.get('type', '')} {service.get('@type', '')} {service.get('@context', '')}"
    for version in (3, 2, 1):
        if f"ImageService{version}" in said or f"image/{version}/" in said:
            return version
    return 1 if "image-api/1" in f"{said} {_profile(service)}" else 2


def _level(service: Json) -> int:
    """The level of compliance; where none is told, the least."""
    found = re.search(r"level([012])", _profile(service))
    return int(found[1]) if found else 0


def _profile(service: Json) -> str:
    profile = service.get("profile", "")
    return str(profile[0] if isinstance(profile, list) and profile else profile)
