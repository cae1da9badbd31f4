"""A cursor over a message in CDR, the wire format of ROS 2 (OMG CORBA 3.3, part 2, 9.3).

The seven ROS 2 types read here have had the same layout since ROS 2 began, so neither the
definition stored beside them is needed nor classes made from its text. Array contents stay views
of the message.
"""

import struct

_NUMBERS = {
    order: {code: struct.Struct(order + code) for code in ("b", "B", "H", "i", "I", "d")}
    for order in "<>"
}


class Cdr:
    """Reads values one after the other.

    Raises
    ------
    ValueError : from every method, where the message ends too early or is in another encoding.
    """

    __slots__ = ("_at", "_data", "_numbers", "_order")

    def __init__(self, data: memoryview) -> None:
        if len(data) < 4 or data[0] != 0 or data[1] not in (0, 1):
            raise ValueError(f"is not plain CDR (encapsulation {bytes(data[:2]).hex()})")
        self._data, self._at = data, 4
        self._order = "<" if data[1] else ">"
        self._numbers = _NUMBERS[self._order]

    def int8(self) -> int:
        """A signed byte."""
        return int(self._number("b"))

    def uint8(self) -> int:
        """A byte."""
        return int(self._number("B"))

    def uint16(self) -> int:
        """Two bytes."""
        return int(self._number("H"))

    def int32(self) -> int:
        """Four bytes, signed."""
        return int(self._number("i"))

    def uint32(self) -> int:
        """Four bytes."""
        return int(self._number("I"))

    def doubles(self, count: int) -> tuple[float, ...]:
        """A fixed number of float64."""
        self._align(8)
        self._need(8 * count)
        values = struct.unpack_from(f"{self._order}{count}d", self._data, self._at)
        self._at += 8 * count
        return values

    def text(self) -> str:
        """A string; its terminating zero is left out."""
        content = self.octets()
        return bytes(content).rstrip(b"\0").decode("utf-8", "replace")

    def octets(self) -> memoryview:
        """A sequence of bytes, not copied."""
        length = self.uint32()
        self._need(length)
        self._at += length
        return self._data[self._at - length : self._at]

    def sequence_length(self, least_bytes: int) -> int:
        """How many elements follow; refused if so many of `least_bytes` each do not fit in."""
        count = self.uint32()
        self._need(count * least_bytes)
        return count

    def _number(self, code: str) -> float:
        number = self._numbers[code]
        self._align(number.size)
        self._need(number.size)
        (value,) = number.unpack_from(self._data, self._at)
        self._at += number.size
        return float(value) if code == "d" else int(value)

    def _align(self, size: int) -> None:
        self._at += -(self._at - 4) % size

    def _need(self, count: int) -> None:
        if self._at + count > len(self._data):
            raise ValueError(f"ends after {len(self._data)} bytes, before all of its fields")
