"""XMP packets: their plain properties, and what those say of where a camera looks.

Parsed by expat with every document type refused: a packet has none, and entities are how a small
file becomes a large memory.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from xml.parsers import expat

from geo.headings import wrapped_180

_GPANO = "http://ns.google.com/photos/1.0/panorama"
_CAMERA = "http://pix4d.com/camera/1.0"
_DJI = "http://www.dji.com/drone-dji/1.0"
_RDF = "http://www.w3.org/1999/02/22-rdf-syntax-ns#"
_MAX_BYTES = 1_000_000
"""A packet in a JPEG has at most 65,502 bytes; other formats are given more."""
_MAX_DEPTH = 100
_MAX_CAMERA_PITCH_DEG = 60.0

Properties = Mapping[tuple[str, str], str]


@dataclass(frozen=True, slots=True)
class StatedAngles:
    """Degrees as in `contracts.records.Pose`, heading from true north; None: not stated."""

    heading_deg: float | None
    pitch_deg: float | None
    roll_deg: float | None


def xmp_properties(packet: bytes) -> Properties:
    """Simple properties of a packet: (namespace, name) -> text; the first one counts.

    Namespaces are written without their last `/`, which some writers leave out.

    Properties are attributes or elements of an `rdf:Description`; lists and structures are left
    out, their parts too.

    Raises
    ------
    ValueError : larger than a megabyte, not XML, or with a document type; says which.
    """
    if len(packet) > _MAX_BYTES:
        raise ValueError(f"XMP of {len(packet)} bytes, expected at most {_MAX_BYTES}")
    found: dict[tuple[str, str], str] = {}
    open_elements: list[tuple[str, str]] = []
    text: list[str] = []

    def start(element: str, attributes: dict[str, str]) -> None:
        text.clear()
        open_elements.append(_split(element))
        if len(open_elements) > _MAX_DEPTH:
            raise ValueError(f"XMP nested more than {_MAX_DEPTH} deep")
        if open_elements[-1] == (_RDF, "Description"):
            for name, value in attributes.items():
                found.setdefault(_split(name), value.strip())

    def end(_element: str) -> None:
        name = open_elements.pop()
        if open_elements and open_elements[-1] == (_RDF, "Description") and "".join(text).strip():
            found.setdefault(name, "".join(text).strip())
        text.clear()

    def refuse(*_declaration: object) -> None:
        raise ValueError("XMP with a document type; it may have none")

    parser = expat.ParserCreate(namespace_separator=" ")
    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.CharacterDataHandler = text.append
    parser.StartDoctypeDeclHandler = refuse
    try:
        # Writers pad a packet with zero bytes, which XML does not know.
        parser.Parse(packet.strip(b"\0 \t\r\n"), True)
    except (expat.ExpatError, LookupError) as error:
        raise ValueError(f"XMP that is not XML: {error}") from error
    return found


def gpano_text(properties: Properties, name: str) -> str:
    """A property of Google's photo sphere namespace, "" if it is not there."""
    return properties.get((_GPANO, name), "")


def gpano_number(properties: Properties, name: str) -> float | None:
    """A number of Google's photo sphere namespace, None if it is not there or not finite."""
    return _number(gpano_text(properties, name))


def stated_angles(properties: Properties) -> StatedAngles:
    """Angles of the optical axis, or of a panorama's middle, from the first source that has each.

    In turn: GPano, DJI's gimbal, and `Camera:`, whose pitch is read as Panoramax does, 0 at the
    horizon. Pix4D, which made that name, has 0 at the nadir: a pitch that cannot be told from
    that (more than 60 degrees from the horizon) is taken as not known.
    """

    def first(*sources: tuple[str, str]) -> float | None:
        numbers = (_number(properties.get(source, "")) for source in sources)
        return next((number for number in numbers if number is not None), None)

    pitch = first((_GPANO, "PosePitchDegrees"), (_DJI, "GimbalPitchDegree"))
    if pitch is None and (stated := first((_CAMERA, "Pitch"))) is not None:
        above_horizon = wrapped_180(stated)
        pitch = above_horizon if abs(above_horizon) <= _MAX_CAMERA_PITCH_DEG else None
    return StatedAngles(
        first((_GPANO, "PoseHeadingDegrees"), (_DJI, "GimbalYawDegree"), (_CAMERA, "Yaw")),
        pitch,
        first((_GPANO, "PoseRollDegrees"), (_DJI, "GimbalRollDegree"), (_CAMERA, "Roll")),
    )


def _split(name: str) -> tuple[str, str]:
    namespace, _, local = name.rpartition(" ")
    return namespace.removesuffix("/"), local


def _number(text: str) -> float | None:
    try:
        number = float(text)
    except ValueError:
        return None
    return number if math.isfinite(number) else None
