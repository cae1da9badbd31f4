"""A mapping file: what the columns of a table of no known kind are, as TOML written by a person."""

import codecs
import tomllib
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal
from zoneinfo import ZoneInfo

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from contracts.config import North
from contracts.errors import BadConfig
from survey.tables.convention import (
    AngleUnit,
    CameraAxes,
    Convention,
    HeadingTurn,
    HeadingZero,
    MatrixOrder,
    PitchSense,
    PitchZero,
    RollSense,
    RotationMaps,
)
from survey.tables.profile import Profile, Role, plain_name
from survey.tables.text import WHITESPACE, Layout

if TYPE_CHECKING:
    from pydantic_core import ErrorDetails

_SEPARATORS = {"comma": ",", "semicolon": ";", "tab": "\t", "bar": "|", "whitespace": WHITESPACE}
_UNIX = ("iso", "unix_s", "unix_ms", "unix_us", "unix_ns")
_PLACEHOLDERS = ("{file}", "{camera}")
ColumnNumber = Annotated[int, Field(ge=1)]


class _Section(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)


class _Angles(_Section):
    unit: AngleUnit = "deg"
    heading_zero: HeadingZero = "north"
    heading_turn: HeadingTurn = "clockwise"
    pitch_zero: PitchZero = "horizon"
    pitch_sense: PitchSense = "up"
    roll_sense: RollSense = "right_down"


class _Rotation(_Section):
    order: MatrixOrder = "row"
    maps: RotationMaps = "world_from_camera"
    axes: CameraAxes = "rub"


class _Time(_Section):
    format: str = "iso"
    zone: str | None = None

    @field_validator("format")
    @classmethod
    def _readable(cls, pattern: str) -> str:
        if pattern in _UNIX:
            return pattern
        moment = datetime(2020, 2, 29, 12, 30, 15)
        try:
            datetime.strptime(moment.strftime(pattern), pattern)
        except ValueError as error:
            raise ValueError(
                f"{pattern!r} is neither one of {', '.join(_UNIX)} nor a pattern of strptime: "
                f"{error}"
            ) from error
        return pattern

    @field_validator("zone")
    @classmethod
    def _known(cls, zone: str | None) -> str | None:
        try:
            return None if zone is None else str(ZoneInfo(zone))
        except (KeyError, ValueError, OSError) as error:
            raise ValueError(f"{zone!r} is no IANA time zone such as Europe/Paris") from error


class _Files(_Section):
    template: str = "{file}"
    match: Literal["path", "name"] = "path"

    @field_validator("template")
    @classmethod
    def _fillable(cls, template: str) -> str:
        rest = template
        for placeholder in _PLACEHOLDERS:
            rest = rest.replace(placeholder, "")
        if "{" in rest or "}" in rest or "{file}" not in template:
            raise ValueError(f"{template!r} must hold {{file}}, may hold {{camera}}, nothing else")
        return template


class TableMapping(_Section):
    """Everything a mapping file may say; docs/surveys.md explains each key."""

    columns: dict[Role, str | ColumnNumber]
    table: str | None = None
    separator: str | None = None
    header: bool = True
    skip_lines: Annotated[int, Field(ge=0)] = 0
    encoding: str | None = None
    decimal_comma: bool | None = None
    crs: str | None = None
    north: North | None = None
    unknown: tuple[float, ...] = ()
    angles: _Angles = _Angles()
    rotation: _Rotation = _Rotation()
    time: _Time = _Time()
    files: _Files = _Files()

    @field_validator("unknown", mode="before")
    @classmethod
    def _several(cls, unknown: object) -> object:
        numbers = unknown if isinstance(unknown, list) else [unknown]
        return tuple(float(n) if isinstance(n, int) else n for n in numbers)

    @field_validator("separator")
    @classmethod
    def _one_character(cls, separator: str | None) -> str | None:
        if separator is None or separator in _SEPARATORS:
            return _SEPARATORS.get(separator or "")
        if len(separator) != 1 or separator in '\r\n"':
            raise ValueError(
                f"{separator!r} is neither one character nor one of {', '.join(_SEPARATORS)}"
            )
        return separator

    @field_validator("encoding")
    @classmethod
    def _text_encoding(cls, encoding: str | None) -> str | None:
        try:
            return None if encoding is None else codecs.lookup(encoding).name
        except (LookupError, ValueError) as error:
            raise ValueError(f"{encoding!r} is no encoding such as utf-8 or cp1252") from error

    @model_validator(mode="after")
    def _complete(self) -> "TableMapping":
        if "file" not in self.columns:
            raise ValueError("columns must name the file")
        if "camera" not in self.columns and "{camera}" in self.files.template:
            raise ValueError("files.template holds {camera}, but columns name no camera")
        named = [name for name in self.columns.values() if isinstance(name, str)]
        if named and not self.header:
            raise ValueError(
                f"a table without a header has columns by number from 1; found {named[0]!r}"
            )
        return self

    @property
    def layout(self) -> Layout:
        """How the text is written."""
        return Layout(
            self.separator, self.header, self.skip_lines, self.encoding, self.decimal_comma
        )

    @property
    def profile(self) -> Profile:
        """What the columns are."""
        return Profile(
            name="mapping",
            columns={
                role: name if isinstance(name, int) else (plain_name(name),)
                for role, name in self.columns.items()
            },
            convention=Convention(
                angles=self.angles.unit,
                **self.angles.model_dump(exclude={"unit"}),
                matrix_order=self.rotation.order,
                rotation_maps=self.rotation.maps,
                camera_axes=self.rotation.axes,
                unknown=self.unknown,
                time_format=self.time.format,
                time_zone=self.time.zone,
            ),
            crs=self.crs,
            north=self.north,
            loose_names=self.files.match == "name",
            template=self.files.template,
            all_needed=True,
        )


def read_mapping(path: Path) -> TableMapping:
    """A mapping file.

    Raises
    ------
    BadConfig : unreadable, not TOML, or a key or value that is not known; says which.
    """
    try:
        settings = tomllib.loads(path.read_text("utf-8"))
        return TableMapping.model_validate(settings)
    except OSError as error:
        raise BadConfig(f"mapping {path} cannot be read: {error.strerror}") from error
    except ValidationError as error:
        problems = "; ".join(_problem(each) for each in error.errors())
        raise BadConfig(f"mapping {path}: {problems}") from error
    except (ValueError, RecursionError) as error:  # of TOML and of UTF-8
        raise BadConfig(f"mapping {path} is not TOML in UTF-8: {error}") from error


def _problem(error: "ErrorDetails") -> str:
    where = ".".join(str(part) for part in error["loc"])
    known = {
        "extra_forbidden": "is no key of a mapping; check its spelling",
        "missing": "is missing",
    }
    if error["type"] in known:
        return f"{where} {known[error['type']]}"
    message = error["msg"].removeprefix("Value error, ")
    return f"{where}: {message}" if where else message
