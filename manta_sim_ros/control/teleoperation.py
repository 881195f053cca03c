"""Teleoperation: keys and a joystick share one manual control."""

from __future__ import annotations

import math
from typing import NamedTuple

from manta_sim_ros.control.gaits import Gaits
from manta_sim_ros.control.joystick import JoystickSettings
from manta_sim_ros.control.manual import NEUTRAL, Demand, ManualControl


class Key(NamedTuple):
    """One thing that keys do."""

    keys: tuple[str, ...]
    """Names of the keys, in the words of Textual."""
    label: str
    """What is shown for the first key."""
    word: str
    """What it does, in a word."""
    change: Demand
    """By what it changes the demand."""
    meaning: str


KEYS = {
    'faster': Key(('up', 'w'), '↑', 'faster', Demand(throttle=0.1), 'a tenth more throttle'),
    'slower': Key(
        ('down', 's'), '↓', 'slower', Demand(throttle=-0.1), 'a tenth less throttle; below 0, it swims backward'),
    'left': Key(('left', 'a'), '←', 'left', Demand(steer=0.2), 'a fifth more steering to the left'),
    'right': Key(('right', 'd'), '→', 'right', Demand(steer=-0.2), 'a fifth more steering to the right'),
    'up': Key(('r', 'pageup'), 'r', 'rise', Demand(climb=0.2), 'a fifth more bias to climb'),
    'down': Key(('f', 'pagedown'), 'f', 'dive', Demand(climb=-0.2), 'a fifth more bias to dive'),
    'center': Key(('c',), 'c', 'center', NEUTRAL, 'straight and level, at the same throttle'),
    'stop': Key(('space',), 'space', 'stop', NEUTRAL, 'stops the fins at once, a joystick\'s command too'),
}
"""What the keys do, by the name of the action."""


class Teleoperation:
    """Who commands the fins: the keys, or a joystick while its dead-man button is held.

    The fins stop at once when the button is released, when the joystick falls silent, and with the key `stop`. After
    silence or `stop`, the button must be released before the joystick commands again. Times are those of one clock
    that runs on whatever the simulator does [s].

    Parameters
    ----------
    control
        The way from a demand to the gaits.
    joystick
        Its settings, of which the timeout is used.

    """

    def __init__(self, control: ManualControl, joystick: JoystickSettings) -> None:
        self._control, self._timeout = control, joystick.timeout
        self.demand = NEUTRAL
        """What is asked for now."""
        self.active = False
        """Whether anybody commanded yet."""
        self.held = False
        """Whether the joystick commands."""
        self.trouble = ''
        """Why the joystick does not command, empty for nothing."""
        self._blocked = False  # until the dead-man button is released
        self._heard = self._updated = math.nan

    def press(self, action: str) -> None:
        """Do what a key does, an action of `KEYS`; while the joystick commands, `stop` only."""
        if action == 'stop':
            self._block('stopped by a key: release the dead-man button to use the joystick again')
            self.stop()
            self.active = True
        elif not self.held:
            if action == 'center':
                self.demand = Demand(throttle=self.demand.throttle)
            else:
                change = zip(self.demand, KEYS[action].change, strict=True)
                self.demand = Demand(*(round(min(max(part + step, -1.0), 1.0), 3) for part, step in change))
            self.active = True

    def hear(self, demand: Demand | None, now: float) -> None:
        """Take what the joystick asks for, None where its dead-man button is not held."""
        self._heard = now
        if demand is None:
            if self.held:
                self.stop()
            self._blocked, self.trouble = False, ''
        elif not self._blocked:
            self.active = self.held = True
            self.demand = demand

    def command(self, now: float) -> Gaits | None:
        """Return the gaits for this time [s], None while nobody has commanded yet."""
        elapsed = now - self._updated if now > self._updated else 0.0
        self._updated = now
        if self.held and now - self._heard > self._timeout:
            self._block(f'joy was silent for {self._timeout:g} s: release the dead-man button to use it again')
            self.stop()
        return self._control.update(elapsed, self.demand) if self.active else None

    def stop(self) -> Gaits:
        """Stop the fins at once, and return their gaits."""
        self.held, self.demand = False, NEUTRAL
        return self._control.stop()

    @property
    def gaits(self) -> Gaits:
        """The gaits that were commanded last."""
        return self._control.gaits

    def _block(self, why: str) -> None:
        if self.held:
            self._blocked, self.trouble = True, why
