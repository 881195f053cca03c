"""Messages in which only numbers change: serialized once by rclpy, then written number by number."""

from __future__ import annotations

import itertools
import re
import struct
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from numpy.typing import NDArray
from rclpy.serialization import serialize_message

from manta_sim_ros.dynamics import FloatArray

Numbers = float | Sequence[float] | FloatArray

STAMP = struct.Struct('=iI')  # sec, nanosec
MARK = Time(sec=1_234_567_891, nanosec=987_654_321)
"""The stamp that is found again in the bytes."""


class Template:
    """A message whose texts and lengths stay, so that each number keeps its place in the serialized message.

    To write the numbers there and publish the bytes takes a small part of the time of making and publishing a message.

    Parameters
    ----------
    example
        The message with all values that stay; it becomes a part of the template.
    stamps
        Paths of its stamps, such as `header.stamp`, or `transforms.0.header.stamp` with the index in a list; all get
        the same time.
    fields
        Paths of the fields that change. Each is a number, a message of numbers in the order of its definition, or a
        list of these that is not empty. The numbers of a field are all doubles, or all of single precision.
    numbers_of
        Returns the numbers of each field from what is to be published.

    """

    def __init__(
        self, example: Any, stamps: Sequence[str], fields: Sequence[str],
        numbers_of: Callable[[Any], Sequence[Numbers]],
    ) -> None:
        self._example, self._stamps, self._fields, self._numbers_of = example, stamps, fields, numbers_of
        for stamp in stamps:
            _set(example, stamp, MARK)
        marks = _marks()
        parts = [_fill(example, field, marks) for field in fields]
        self._buffer = bytearray(serialize_message(example))
        mark = re.escape(STAMP.pack(MARK.sec, MARK.nanosec))
        self._stamps_at = [found.start() for found in re.finditer(mark, self._buffer)]
        self._places = [place for part in parts if (place := _place(self._buffer, part)) is not None]
        self._has_places = len(self._stamps_at) == len(stamps) and len(self._places) == len(parts)

    def write(self, stamp: Time, source: Any) -> Any:
        """Return the serialized message, or the message itself where its numbers are not found in the bytes.

        Publishers take both. The bytes that only align others are those of the example.
        """
        if not self._has_places:
            return self.message(stamp, source)
        for at in self._stamps_at:
            STAMP.pack_into(self._buffer, at, stamp.sec, stamp.nanosec)
        for place, numbers in zip(self._places, self._numbers_of(source), strict=True):
            place[:] = numbers
        return bytes(self._buffer)

    def message(self, stamp: Time, source: Any) -> Any:
        """Return the message; the next call changes it."""
        for path in self._stamps:
            _set(self._example, path, stamp)
        for field, numbers in zip(self._fields, self._numbers_of(source), strict=True):
            _fill(self._example, field, iter(np.ravel(numbers).tolist()))
        return self._example


def _marks() -> Iterator[float]:
    """Yield numbers, without end, that are found again in the bytes: of single precision, so that none is rounded."""
    generator = np.random.default_rng(0)
    while True:
        yield float(generator.random(dtype=np.float32))


def _place(buffer: bytearray, marks: Sequence[float]) -> NDArray[Any] | None:
    """Return the part of the buffer that has these numbers, as an array; None if it is not found, or twice."""
    for precision in (np.float64, np.float32):
        part = np.array(marks, precision)
        if buffer.count(part.tobytes()) == 1:
            return np.frombuffer(buffer, precision, part.size, buffer.index(part.tobytes()))
    return None


def _set(message: Any, path: str, value: Any) -> None:
    owner, name = _owner(message, path)
    setattr(owner, name, value)


def _fill(message: Any, path: str, numbers: Iterator[float]) -> list[float]:
    """Set all numbers of a field to the next ones, and return these."""
    owner, name = _owner(message, path)
    field = getattr(owner, name)
    if isinstance(field, float):
        setattr(owner, name, next(numbers))
        return [getattr(owner, name)]
    if hasattr(field, 'get_fields_and_field_types'):
        return [number for inner in field.get_fields_and_field_types() for number in _fill(field, inner, numbers)]
    if hasattr(field[0], 'get_fields_and_field_types'):
        return [number for each in field for inner in each.get_fields_and_field_types()
                for number in _fill(each, inner, numbers)]
    filled = list(itertools.islice(numbers, len(field)))
    setattr(owner, name, filled)
    return filled


def _owner(message: Any, path: str) -> tuple[Any, str]:
    """Return the message that has the last field of a path, and the name of that field."""
    *owners, name = path.split('.')
    for owner in owners:
        message = message[int(owner)] if owner.isdigit() else getattr(message, owner)
    return message, name
