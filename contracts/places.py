"""Places: a path of this machine, or the URL of an object store such as `s3://bucket/survey`."""

import errno
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from contracts.errors import BadConfig, FlaneurError

if TYPE_CHECKING:
    from upath import UPath

    Place: TypeAlias = Path | UPath
else:  # upath is imported where there is a URL: most runs have none. And typer knows no unions.

    class Place:
        """A path or a URL."""


_HERE = frozenset({"file", "local"})
_NO_CREDENTIALS = frozenset({"NoCredentialsError", "PartialCredentialsError"})
"""Of botocore, which need not be installed."""


def is_url(text: str) -> bool:
    """Whether a text names something in a store. No `Path` has two slashes in a row."""
    return "://" in text


def place_of(text: str) -> Place:
    """The place that a text means, a path unless it is a URL.

    Credentials and the address of the store come from the environment, as its library has it
    (`AWS_ACCESS_KEY_ID`, `AWS_ENDPOINT_URL`).

    Raises
    ------
    BadConfig : a URL of a store that is not known, whose library is not installed, or that holds
        credentials or several URLs.
    """
    if not is_url(text):
        return Path(text)
    protocol, _, rest = text.partition("://")
    if protocol in _HERE:
        return Path(rest)
    if "@" in rest.partition("/")[0]:
        raise BadConfig(
            f"A URL of {protocol}:// holds credentials, which would be written into plans and "
            "logs. Leave them out and set the store's variables, such as AWS_ACCESS_KEY_ID."
        )
    if "::" in protocol or not rest.strip("/"):
        raise BadConfig(f"{text!r} is no URL of a store; expected such as s3://bucket/folder")
    from upath import UPath

    try:
        place = UPath(text.rstrip("/"), use_listings_cache=False)
        _ = place.fs
    except ImportError as error:
        mend = "pip install 'flaneur[s3]'" if protocol in {"s3", "s3a"} else str(error)
        raise BadConfig(f"{text} needs a library that is missing: {mend}") from error
    except ValueError as error:
        raise BadConfig(
            f"{text}: stores of {protocol}:// are not known; expected s3:// or another that "
            f"fsspec knows ({error})"
        ) from error
    return place


@contextmanager
def store_errors(place: object) -> Iterator[None]:
    """What a store's library raises becomes an OSError with a reason and the name of `place`.

    Raises
    ------
    FileNotFoundError, PermissionError : of the store. OSError : anything else it raises.
    """
    try:
        yield
    except FlaneurError:
        raise
    except FileNotFoundError as error:
        raise FileNotFoundError(errno.ENOENT, "not in the store", str(place)) from error
    except PermissionError as error:
        reason = error.strerror or str(error) or "access denied"
        raise PermissionError(
            errno.EACCES, f"the store refuses it: {reason}", str(place)
        ) from error
    except Exception as error:
        if type(error).__name__ in _NO_CREDENTIALS:
            raise PermissionError(errno.EACCES, "it has no credentials", str(place)) from error
        told = " ".join(str(error).split()) or type(error).__name__
        raise OSError(
            errno.EIO, f"the store does not answer as it should: {told}", str(place)
        ) from error
