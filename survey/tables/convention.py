"""What the numbers of a table mean: units, zeros, senses, unknown values, clocks."""

from dataclasses import dataclass
from typing import Literal

AngleUnit = Literal["deg", "grad", "rad"]
HeadingZero = Literal["north", "east", "south", "west"]
HeadingTurn = Literal["clockwise", "counterclockwise"]
PitchZero = Literal["horizon", "nadir"]
PitchSense = Literal["up", "down"]
RollSense = Literal["right_down", "left_down"]
MatrixOrder = Literal["row", "column"]
RotationMaps = Literal["world_from_camera", "camera_from_world"]
CameraAxes = Literal["rdf", "rub", "flu", "frd"]


@dataclass(frozen=True, slots=True)
class Convention:
    """How a table writes attitudes, unknown values and times; the defaults are Flaneur's own.

    angles : unit of heading, pitch, roll, omega, phi and kappa. heading_zero, heading_turn : from
    where and which way headings count. pitch_zero, pitch_sense : from where and which way pitches
    count. roll_sense : which side of the camera is down when the roll is positive.
    matrix_order : "row": m12 is in the first row; "column": m12 is in the first column.
    rotation_maps : what a matrix or quaternion turns into what. camera_axes : which way the
    camera's own x, y and z point, of right, left, up, down, forward, back: "rdf" is OpenCV's,
    "rub" photogrammetry's, "flu" ROS's, "frd" a vehicle's.
    unknown : numbers that stand for "not known", other than in positions.
    zero_headings_unknown : headings that are all exactly 0 were never measured.
    time_format : "iso", "unix_s", "unix_ms", "unix_us", "unix_ns" or a pattern of strptime.
    time_zone : IANA name of the zone of times without one; None: such times are not known.
    """

    angles: AngleUnit = "deg"
    heading_zero: HeadingZero = "north"
    heading_turn: HeadingTurn = "clockwise"
    pitch_zero: PitchZero = "horizon"
    pitch_sense: PitchSense = "up"
    roll_sense: RollSense = "right_down"
    matrix_order: MatrixOrder = "row"
    rotation_maps: RotationMaps = "world_from_camera"
    camera_axes: CameraAxes = "rub"
    unknown: tuple[float, ...] = ()
    zero_headings_unknown: bool = False
    time_format: str = "iso"
    time_zone: str | None = None


OWN = Convention()
"""Flaneur's own convention."""
