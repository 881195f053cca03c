"""Messages in which only numbers change: serialized once by rclpy, then written number by number."""

from __future__ import annotations

import itertools
import random
import struct
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
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
    stamp
        Path of its stamp, such as `header.stamp`, or `transforms.0.header.stamp` with the index in a list.
    fields
        Paths of the fields that change. Each is a double, an array of doubles, or a message of these, whose numbers
        have the order of its definition.
    numbers_of
        Returns the numbers of each field from what is to be published.

    """

    def __init__(
        self, example: Any, stamp: str, fields: Sequence[str], numbers_of: Callable[[Any], Sequence[Numbers]],
    ) -> None:
        self._example, self._stamp, self._fields, self._numbers_of = example, stamp, fields, numbers_of
        marks = iter(random.Random(0).random, None)  # without end  # nosec B311 # marks in bytes, no secret
        _set(example, stamp, MARK)
        parts = [np.array(_fill(example, field, marks)) for field in fields]
        data, stamp_mark = serialize_message(example), STAMP.pack(MARK.sec, MARK.nanosec)
        self._has_places = all(data.count(mark) == 1 for mark in (stamp_mark, *(part.tobytes() for part in parts)))
        if self._has_places:
            self._buffer = bytearray(data)
            self._stamp_at = data.index(stamp_mark)
            self._places = [
                np.frombuffer(self._buffer, np.float64, part.size, data.index(part.tobytes())) for part in parts]

    def write(self, stamp: Time, source: Any) -> Any:
        """Return the serialized message, or the message itself where its numbers are not found in the bytes.

        Publishers take both. The bytes that only align others are those of the example.
        """
        if not self._has_places:
            return self.message(stamp, source)
        STAMP.pack_into(self._buffer, self._stamp_at, stamp.sec, stamp.nanosec)
        for place, numbers in zip(self._places, self._numbers_of(source), strict=True):
            place[:] = numbers
        return bytes(self._buffer)

    def message(self, stamp: Time, source: Any) -> Any:
        """Return the message; the next call changes it."""
        _set(self._example, self._stamp, stamp)
        for field, numbers in zip(self._fields, self._numbers_of(source), strict=True):
            _fill(self._example, field, iter(np.ravel(numbers).tolist()))
        return self._example


def _set(message: Any, path: str, value: Any) -> None:
    owner, name = _owner(message, path)
    setattr(owner, name, value)


def _fill(message: Any, path: str, numbers: Iterator[float]) -> list[float]:
    """Set all doubles of a field to the next numbers, and return these."""
    owner, name = _owner(message, path)
    field = getattr(owner, name)
    if hasattr(field, 'get_fields_and_field_types'):
        return [number for inner in field.get_fields_and_field_types() for number in _fill(field, inner, numbers)]
    filled = list(itertools.islice(numbers, 1 if isinstance(field, float) else len(field)))
    setattr(owner, name, filled[0] if isinstance(field, float) else filled)
    return filled


def _owner(message: Any, path: str) -> tuple[Any, str]:
    """Return the message that has the last field of a path, and the name of that field."""
    *owners, name = path.split('.')
    for owner in owners:
        message = message[int(owner)] if owner.isdigit() else getattr(message, owner)
    return message, name
