"""Gaits in degrees and Hz, as commands and study files have them."""

from __future__ import annotations

import math
from collections.abc import Sequence

from manta_sim_ros.dynamics import SIDES, FinCommand, cut

Gaits = tuple[FinCommand, FinCommand]
"""The gaits of the left and the right fin."""

NAMES = ('amplitude', 'frequency', 'phase', 'front_bias', 'rear_bias')
"""The values of a gait, in the order of FinCommand."""

UNITS = dict.fromkeys(NAMES, 'degrees') | {'frequency': 'Hz'}

ORDER = 'A_l,A_r,f_l,f_r,phi_l,phi_r'
"""The order of six values of both fins; ten have the biases front_l, front_r, rear_l, rear_r, too."""


def gait_of(side: str, values: dict[str, float]) -> FinCommand:
    """Return the gait of a fin from values of NAMES [degrees, Hz].

    Raises
    ------
    ValueError
        A value is out of its bounds; names the side, the value as it was given, and the bound.

    """
    gait = {'amplitude': 0.0, 'frequency': 0.0, 'phase': 0.0}
    for name, value in values.items():
        gait[name] = value if UNITS[name] == 'Hz' else math.radians(value)
        try:
            FinCommand(**{**dict.fromkeys(NAMES, 0.0), name: gait[name]})
        except ValueError as error:
            raise ValueError(f'{side} {name} {value:g} {UNITS[name]}: {error}') from error
    return FinCommand(**gait)


def gaits_of(text: str) -> Gaits:
    """Return the gaits from a text of six or ten values in the order of ORDER [degrees, Hz].

    Raises
    ------
    ValueError
        A part is no number, their number is wrong, or a value is out of its bounds.

    """
    return gaits_from(values_of(text))


def values_of(text: str) -> list[float]:
    """Return the numbers of a text of six or ten values; errors as `gaits_of`."""
    parts = text.split(',')
    if len(parts) not in (6, 10):
        raise ValueError(f'{cut(text)!r} has {len(parts)} values, but must have 6 ({ORDER}) or 10')
    return [_number(part) for part in parts]


def gaits_from(values: Sequence[float]) -> Gaits:
    """Return the gaits from six or ten values in the order of ORDER [degrees, Hz]; errors as `gait_of`."""
    left, right = (
        gait_of(side, dict(zip(NAMES, values[index::2], strict=False))) for index, side in enumerate(SIDES))
    return left, right


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise ValueError(f'{cut(text)!r} is not a number') from None
