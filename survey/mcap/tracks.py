"""What a topic says at moments between its messages."""

from array import array
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from geo.rotations import interpolated, rotations_from_quaternions

Floats = NDArray[np.float64]
Moments = NDArray[np.int64]


@dataclass(slots=True)
class Samples:
    """Numbers with the moments they hold for, as they come in: 64 bits each, no objects."""

    n_columns: int
    times_ns: "array[int]" = field(default_factory=lambda: array("q"))
    values: "array[float]" = field(default_factory=lambda: array("d"))

    def add(self, time_ns: int, values: tuple[float, ...]) -> None:
        """Raises OverflowError for a moment beyond the year 2262."""
        self.times_ns.append(time_ns)
        self.values.extend(values)

    def extend(self, other: "Samples") -> None:
        """Those of a further file."""
        self.times_ns.extend(other.times_ns)
        self.values.extend(other.values)

    def track(self) -> "Track":
        """In order of time; of several with one moment the first that came in counts."""
        times = np.array(self.times_ns, np.int64)
        _, kept = np.unique(times, return_index=True)
        return Track(times[kept], np.array(self.values).reshape(-1, self.n_columns)[kept])


@dataclass(frozen=True, slots=True)
class Track:
    """times_ns : (n,) int64 ascending without repetition. values : (n, k) float64."""

    times_ns: Moments
    values: Floats

    @property
    def constant(self) -> bool:
        """Whether it always says the same."""
        return bool(np.ptp(self.values, axis=0).max(initial=0.0) <= 1e-9)


@dataclass(frozen=True, slots=True)
class Asked:
    """at_ns : (m,) int64, moments at which something is to be known. max_gap_s : messages farther
    apart than this are not interpolated between."""

    at_ns: Moments
    max_gap_s: float

    def __len__(self) -> int:
        return len(self.at_ns)


@dataclass(frozen=True, slots=True)
class Bracket:
    """The messages around each of m moments.

    before, after : (m,) int64, indices; equal where a message has just that moment.
    fraction : (m,) float64, of the way from one to the other. gap_s : (m,) between the two,
    infinite before the first and after the last. within : (m,) bool, whether the gap is allowed.
    """

    before: NDArray[np.int64]
    after: NDArray[np.int64]
    fraction: Floats
    gap_s: Floats
    within: NDArray[np.bool_]


def bracket(times_ns: Moments, asked: Asked) -> Bracket:
    """Find the messages around each moment; `times_ns` ascends and is not empty."""
    at_ns = asked.at_ns
    last = len(times_ns) - 1
    before = np.clip(np.searchsorted(times_ns, at_ns, side="right") - 1, 0, last)
    after = np.minimum(before + (at_ns > times_ns[before]), last)
    gap_ns = times_ns[after] - times_ns[before]
    outside = (at_ns < times_ns[0]) | (at_ns > times_ns[-1])
    gap_s = np.where(outside, np.inf, gap_ns / 1e9)
    fraction = (at_ns - times_ns[before]) / np.maximum(gap_ns, 1)
    return Bracket(before, after, np.clip(fraction, 0.0, 1.0), gap_s, gap_s <= asked.max_gap_s)


def values_at(track: Track, around: Bracket) -> Floats:
    """(m, k) float64, linear between messages; NaN where the gap is not allowed."""
    fraction = around.fraction[:, None]
    before, after = track.values[around.before], track.values[around.after]
    found = np.where(fraction == 0.0, before, before + fraction * (after - before))
    found[~around.within] = np.nan
    return found


@dataclass(frozen=True, slots=True)
class Rigid:
    """How one frame lies in another at m moments; NaN: not known.

    rotation : (m, 3, 3), maps vectors of the inner frame to the outer. position : (m, 3) metres,
    the inner frame's origin in the outer.
    """

    rotation: Floats
    position: Floats

    def after(self, inner: "Rigid") -> "Rigid":
        """A frame that lies so in the inner frame of this one, in the outer one."""
        return Rigid(
            self.rotation @ inner.rotation,
            self.position + _turned(self.rotation, inner.position),
        )

    def inverse(self) -> "Rigid":
        """How the outer frame lies in the inner."""
        back = self.rotation.transpose(0, 2, 1)
        return Rigid(back, -_turned(back, self.position))


def identity(count: int) -> Rigid:
    """A frame in itself."""
    return Rigid(np.tile(np.eye(3), (count, 1, 1)), np.zeros((count, 3)))


def rigid_at(track: Track, asked: Asked) -> Rigid:
    """Positions linear, rotations by slerp, of a track of (x, y, z, qx, qy, qz, qw)."""
    around = bracket(track.times_ns, asked)
    position = values_at(track, around)[:, :3]
    # A drive has hundreds of poses a second, of which its images need few.
    used = np.unique(np.concatenate([around.before, around.after]))
    x, y, z, w = track.values[used, 3:].T
    known = rotations_from_quaternions(w, x, y, z)
    rotation = interpolated(track.times_ns[used], known, asked.at_ns)
    rotation[~around.within] = np.nan
    return Rigid(rotation, position)


def rigid_held(track: Track, asked: Asked) -> Rigid:
    """What was said last, or first of all: of what holds until it is said anew."""
    last = len(track.times_ns) - 1
    before = np.clip(np.searchsorted(track.times_ns, asked.at_ns, side="right") - 1, 0, last)
    x, y, z, w = track.values[before, 3:].T
    return Rigid(rotations_from_quaternions(w, x, y, z), track.values[before, :3])


def _turned(rotation: Floats, vectors: Floats) -> Floats:
    """(m, 3); a vector of no length stays so, even where the rotation is not known."""
    turned = np.einsum("nij,nj->ni", rotation, vectors)
    return np.where(np.any(vectors, axis=1, keepdims=True), turned, 0.0)
