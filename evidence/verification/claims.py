"""What the verification states: a claim with its measured error and tolerance, and a section of the page about some.

A theme is a module with a tuple `CHECKS` of functions `check(quick: bool = False) -> Section`; `quick` asks for the
smaller grid that the tests of every day can afford. Names and tolerances of the claims must not depend on it.
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

    `error` is at most `tolerance`; or, where the tolerance is a pair, from its first to its second value, both included
    (a measured order of convergence, say). `reference` is what it is measured against, `reason` where the tolerance
    comes from: derived, or measured with which margin. `unit` is that of both numbers; without one, they are relative.
    """

    name: str
    reference: str
    error: float
    tolerance: float | Bounds
    reason: str
    unit: str = ''

    @property
    def holds(self) -> bool:
        """Whether the error is within the tolerance; an error that is no number is not."""
        low, high = self.tolerance if isinstance(self.tolerance, tuple) else (-math.inf, self.tolerance)
        return math.isfinite(self.error) and low <= self.error <= high

    @property
    def error_text(self) -> str:
        """The error to two significant digits, as the page shows it; three where it lies between bounds."""
        return rounded(self.error, 3 if isinstance(self.tolerance, tuple) else 2, self.unit)

    @property
    def tolerance_text(self) -> str:
        """The tolerance as the page shows it."""
        if isinstance(self.tolerance, tuple):
            low, high = self.tolerance
            return f'{low:g} to {high:g} {self.unit}'.rstrip()
        return f'{self.tolerance:g} {self.unit}'.rstrip()


def rounded(value: float, digits: int = 2, unit: str = '') -> str:
    """Return `value` with so many significant digits and its unit: 1.3e-10, 0.024 m, 120 Hz."""
    text = f'{value:#.{digits}g}'
    if 'e+' in text and abs(value) < 1e6:
        text = f'{float(text):.0f}'
    return f'{text.rstrip(".")} {unit}'.rstrip()


@dataclasses.dataclass(frozen=True)
class Section:
    """A section of docs/verification.md: claims, the prose that goes with them, and the plot of the same data.

    `text` is Markdown: why the reference is independent, why the tolerances are what they are, what is not shown. All
    its numbers come from the run. `draw` fills a figure, which `caption` describes.
    """

    title: str
    text: str
    claims: tuple[Claim, ...]
    draw: Callable[[Figure], None] | None = None
    caption: str = ''


Check = Callable[..., Section]
