"""The claims of the verification, with their measured errors and tolerances, and the sections of its page.

A theme is a module with a tuple `CHECKS` of functions `check(quick: bool = False) -> Section`. `quick` selects a
smaller grid that the regular tests can afford. The names and tolerances of the claims must not depend on it.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Bounds = tuple[float, float]


@dataclasses.dataclass(frozen=True)
class Claim:
    """One statement about the simulator, measured.

    `error` must be at most `tolerance`. Where the tolerance is a pair, the error must lie between its first and its
    second value, both included; such an error is, for example, a measured order of convergence. `reference` is what the
    error is measured against. `reason` says where the tolerance comes from: whether it is derived, or measured and with
    which margin. `unit` is the unit of both numbers; without a unit they are relative.
    """

    name: str
    reference: str
    error: float
    tolerance: float | Bounds
    reason: str
    unit: str = ''

    @property
    def holds(self) -> bool:
        """Whether the error is within the tolerance; an error that is NaN or infinite is not."""
        low, high = self.tolerance if isinstance(self.tolerance, tuple) else (-math.inf, self.tolerance)
        return math.isfinite(self.error) and low <= self.error <= high

    @property
    def error_text(self) -> str:
        """The error as the page shows it: two significant digits, or three where the tolerance is a pair."""
        return rounded(self.error, 3 if isinstance(self.tolerance, tuple) else 2, self.unit)

    @property
    def tolerance_text(self) -> str:
        """The tolerance as the page shows it."""
        if isinstance(self.tolerance, tuple):
            low, high = self.tolerance
            return f'{low:g} to {high:g} {self.unit}'.rstrip()
        return f'{self.tolerance:g} {self.unit}'.rstrip()


def rounded(value: float, digits: int = 2, unit: str = '') -> str:
    """Return `value` with this number of significant digits and its unit, such as 1.3e-10, 0.024 m or 120 Hz."""
    text = f'{value:#.{digits}g}'
    if 'e+' in text and abs(value) < 1e6:
        text = f'{float(text):.0f}'
    return f'{text.rstrip(".")} {unit}'.rstrip()


@dataclasses.dataclass(frozen=True)
class Section:
    """A section of docs/verification.md: claims, the prose about them, and the plot of the same data.

    `text` is Markdown. It says why the reference is independent and what the section does not verify. All its numbers
    come from the run. `draw` draws the plot into a figure, and `caption` describes it.
    """

    title: str
    text: str
    claims: tuple[Claim, ...]
    draw: Callable[[Figure], None] | None = None
    caption: str = ''


Check = Callable[..., Section]
