"""Parameters: what is known about each, and groups of them whose values are checked when they are made."""

from __future__ import annotations

import dataclasses
import math
import numbers
from collections.abc import Iterable, Sequence
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

Vector = tuple[float, float, float]

SixVector = tuple[float, float, float, float, float, float]
"""Along x, y, z, then about x, y, z."""

LARGEST_SEED = 10**9
"""Upper bound of the seeds of random numbers."""


LONGEST_ECHO = 200
"""Largest number of characters of a value in a message."""


def shown(value: object) -> str:
    """Return a value as a message shows it: what `repr` returns, cut to `LONGEST_ECHO` characters."""
    try:
        text = repr(value)
    except Exception:  # a whole number of thousands of digits, for example
        text = f'of the type {type(value).__name__}'
    return cut(text)


def shown_name(name: object) -> str:
    """Return a name from outside as a message shows it: as `shown`, without quotation marks."""
    return cut(repr(str(name))[1:-1])


def shown_names(names: Iterable[object]) -> str:
    """Return names from outside as a message lists them, cut to `LONGEST_ECHO` characters together."""
    return cut(', '.join(map(shown_name, names)))


def cut(text: str, longest: int = LONGEST_ECHO) -> str:
    """Return a text cut to so many characters."""
    return text if len(text) <= longest else f'{text[:longest - 3]}...'


def real_array(name: str, values: Any) -> FloatArray:
    """Return a new array of real numbers, or raise a ValueError that names what is wrong with `values`."""
    try:
        given = np.asarray(values)
        real = given.dtype.kind in 'iuf' or given.dtype.kind == 'O' and all(map(_is_real, given.ravel().tolist()))
        if real and not np.ma.is_masked(values):
            return np.array(given, dtype=np.float64, order='C')  # a copy: Numba compiles again for a read-only array
    except (TypeError, ValueError, OverflowError):  # rows of unequal length, or a whole number that no float holds
        pass
    raise ValueError(f'{name} is {shown(values)}, but must be an array of real numbers, none of them masked')


def _is_real(value: object) -> bool:
    return isinstance(value, numbers.Real) and not isinstance(value, bool)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Quantity:
    """What is known about one parameter, whatever its present value."""

    kind: type
    """bool, int, float, str, or tuple for a vector of `size` numbers."""
    size: int
    """Number of components of a vector, else 1."""
    unit: str
    low: float
    """Lower bound, included; of each component of a vector."""
    high: float
    """Upper bound, included."""
    description: str
    source: str
    """Where the default comes from."""
    choices: tuple[str, ...]
    """The texts that are allowed; empty when any will do."""
    live: bool
    """Whether the value may change while a node runs."""

    @property
    def bounds(self) -> str:
        """The bounds of a number in words, with the unit."""
        return f'from {self.low:g} to {self.high:g} {self.unit}'.rstrip()


def quantity(
    default: Any, *, description: str, source: str, unit: str = '', low: float = -math.inf, high: float = math.inf,
    choices: tuple[str, ...] = (), live: bool = False,
) -> Any:
    """Return a dataclass field that carries its `Quantity`; `default` is the value, or a type if one must be given."""
    required = isinstance(default, type)
    about = Quantity(
        kind=default if required else type(default), size=len(default) if isinstance(default, tuple) else 1,
        unit=unit, low=low, high=high, description=description, source=source, choices=choices, live=live)
    if required:
        return dataclasses.field(metadata={'quantity': about})
    return dataclasses.field(default=default, metadata={'quantity': about})


class ParameterGroup:
    """Base of a frozen dataclass whose fields are made by `quantity`: each is checked when the group is made.

    Raises
    ------
    ValueError
        A value is not of its kind or out of its bounds; names the parameter, the value and the bound.

    """

    prefix: ClassVar[str] = ''
    """What goes before the names of the parameters in a parameter file, such as `fin.`."""

    def __post_init__(self) -> None:
        """Check and convert every field."""
        for name, about in self.quantities().items():
            object.__setattr__(self, name, checked(self.prefix + name, getattr(self, name), about))

    @classmethod
    def quantities(cls) -> dict[str, Quantity]:
        """Return the `Quantity` of each field by its name."""
        return {field.name: field.metadata['quantity'] for field in dataclasses.fields(cls)}  # type: ignore[arg-type]


def checked(name: str, value: Any, about: Quantity) -> Any:
    """Return a value as its kind, or raise a ValueError that names it and its bound."""
    if about.kind is bool:
        if not isinstance(value, bool):
            raise ValueError(f'{name} is {shown(value)}, but must be true or false')
        return value
    if about.kind is str:
        if not isinstance(value, str) or not value:
            raise ValueError(f'{name} is {shown(value)}, but must be a text that is not empty')
        if about.choices and value not in about.choices:
            raise ValueError(f'{name} is {shown(value)}, but must be {" or ".join(about.choices)}')
        return value
    if about.kind is tuple:
        parts = value.tolist() if hasattr(value, 'tolist') else value
        if isinstance(parts, str) or not isinstance(parts, Sequence) or len(parts) != about.size:
            raise ValueError(
                f'{name} is {shown(parts)}, but must be a list of {about.size} numbers {about.unit}'.rstrip())
        return tuple(_number(f'{name}[{axis}]', part, float, about) for axis, part in enumerate(parts))
    return _number(name, value, about.kind, about)


def _number(name: str, value: Any, kind: type, about: Quantity) -> Any:
    if not _is_real(value):
        raise ValueError(f'{name} is {shown(value)}, but must be a number {about.bounds}')
    if kind is int and not isinstance(value, numbers.Integral):
        raise ValueError(f'{name} is {shown(value)}, but must be a whole number {about.bounds}')
    try:
        number = kind(value) + 0  # 0.0 for -0.0: what is equal has the same bits
    except OverflowError:  # a whole number that no float holds
        number = math.inf
    if not about.low <= number <= about.high:  # also refuses nan
        raise ValueError(f'{name} is {shown(number)}, but must be {about.bounds}')
    return number
