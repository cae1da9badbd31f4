"""Which image of the survey a row means."""

import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass

from survey.files import Listing


@dataclass(frozen=True, slots=True)
class ImageFinder:
    """The images of a survey, by path and, with `loose_names`, by the last part of it.

    by_name : last part -> uri; "" where several images share it.
    """

    listing: Listing
    by_name: dict[str, str]

    @classmethod
    def of(cls, listing: Listing, loose_names: bool) -> "ImageFinder":
        by_name: dict[str, str] = {}
        for uri in listing.paths if loose_names else ():
            name = uri.rpartition("/")[2]
            by_name[name] = "" if name in by_name else uri
        return cls(listing, by_name)

    def problem(self, uri: str) -> str | None:
        """Why there is no image of that uri, or None."""
        if uri in self.listing.paths:
            return None
        if not uri:
            return "names no file"
        if not _confined(uri):
            return (
                f"{uri!r} is not a path within the survey; paths are relative to the table's folder"
            )
        return f"pose without image: no image {uri!r} in the survey"

    def uri(self, name: str) -> str:
        """The uri a cell means: `/` for a backslash, no leading `./`, NFC. Confined elsewhere."""
        uri = unicodedata.normalize("NFC", name.replace("\\", "/")).removeprefix("./")
        if uri in self.listing.paths:
            return uri
        return self.by_name.get(uri.rpartition("/")[2]) or uri


def filled(template: str, files: Sequence[str], cameras: Sequence[str]) -> Sequence[str]:
    """The path of each file, as a template makes it of its cells."""
    if template == "{file}":
        return files
    return [
        template.replace("{camera}", camera).replace("{file}", file) if file else ""
        for file, camera in zip(files, cameras, strict=True)
    ]


def _confined(uri: str) -> bool:
    drive = uri[1:3] == ":/" or "://" in uri
    return not (uri.startswith("/") or drive or ".." in uri.split("/"))
