"""Inputs that are refused: each is counted with its reason, and messages are warned of, whatever their topic."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import NamedTuple

WARNING_PERIOD = 1.0
"""Least time between two warnings about one topic [s]."""


class Refused(NamedTuple):
    """What was refused on a topic, or of another input."""

    total: int
    """Messages or requests since the start."""
    lately: int
    """Messages or requests since this was asked last."""
    reason: str
    """Why the last one was refused, empty when there was none."""


class Refusals:
    """What is refused of one input.

    Parameters
    ----------
    warn
        Takes a line.
    topic
        Its name, or what else the input is.
    consequence
        What happens instead, in words.
    done
        What is done with it, in a word.

    """

    def __init__(
        self, warn: Callable[[str], object], topic: str, consequence: str, done: str = 'refused',
    ) -> None:
        self._warn, self._topic, self._consequence, self._done = warn, topic, consequence, done
        self._total = self._told = 0
        self._reason = ''
        self._quiet_until = 0.0  # steady time [s]

    def count(self, reason: str) -> None:
        """Count a refused request, whose sender is told."""
        self._total, self._reason = self._total + 1, reason

    def add(self, error: ValueError | str) -> None:
        """Count a refused message, and warn unless there was a warning just now."""
        self.count(str(error))
        now = time.monotonic()
        if now >= self._quiet_until:
            self._quiet_until = now + WARNING_PERIOD
            self._warn(
                f'{self._topic} {self._done}, {self._consequence} ({self._total} {self._done} so far): {error}')

    def take(self) -> Refused:
        """Return what was refused; from now on, what comes is counted as lately."""
        lately, self._told = self._total - self._told, self._total
        return Refused(self._total, lately, self._reason)
