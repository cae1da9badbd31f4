"""What is wrong with data that pydantic has refused, for our own messages."""

from pydantic import ValidationError


def first_fault(error: ValidationError) -> tuple[str, str]:
    """The first fault: where it is, as a dotted path ("" for the whole), and what it is."""
    first = error.errors()[0]
    return ".".join(str(part) for part in first["loc"]), first["msg"]
