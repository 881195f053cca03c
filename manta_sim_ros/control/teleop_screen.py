"""The screen of teleoperation in a terminal, with Textual."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import ClassVar

from rich.text import Text
from textual.app import App, ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal, Vertical
from textual.reactive import reactive
from textual.widget import Widget
from textual.widgets import Footer, Header

from manta_sim_ros.control.manual import ManualSettings
from manta_sim_ros.control.teleop_view import View
from manta_sim_ros.control.teleoperation import KEYS
from manta_sim_ros.dynamics import SIDES

REFRESH = 0.1
"""Time between two looks at what is shown [s]."""

FREQUENCY_RANGE = 2.0
"""Range of the gauges of the frequency [Hz]."""

ROD_RANGE = 90.0
"""Range of the gauges of the rods, up and down [degrees]."""

LABEL_WIDTH, NUMBER_WIDTH = 10, 11


class Gauge(Widget):
    """A line with a label, a bar from zero to the value, and the value.

    Parameters
    ----------
    label
        Its name, of at most `LABEL_WIDTH` - 1 characters.
    low, high
        Ends of the bar.
    shown
        Returns the value in words.

    """

    DEFAULT_CSS = 'Gauge { height: 1; }'

    value: reactive[float] = reactive(math.nan)

    def __init__(self, label: str, low: float, high: float, shown: Callable[[float], str]) -> None:
        super().__init__()
        self._label, self._low, self._high, self._shown = label, low, high, shown

    def render(self) -> Text:
        """Return the line."""
        known = not math.isnan(self.value)
        number = self._shown(self.value) if known else '-'
        width = max(self.size.width - LABEL_WIDTH - NUMBER_WIDTH, 3)
        zero = self._cell(0.0, width)
        end = self._cell(self.value, width) if known else zero
        first, last = min(zero, end), max(zero, end)
        bar = Text.assemble(
            ('─' * first, 'dim'), '█' * (zero - first), '│', '█' * (last - zero), ('─' * (width - last - 1), 'dim'))
        return Text.assemble(f'{self._label:<{LABEL_WIDTH}}', bar, f'{number:>{NUMBER_WIDTH}}')

    def _cell(self, value: float, width: int) -> int:
        """Return the cell of the bar in which a value is, or the first or last one."""
        part = (value - self._low) / (self._high - self._low)
        return round(min(max(part, 0.0), 1.0) * (width - 1))


class Lines(Widget):
    """Some lines of text."""

    DEFAULT_CSS = 'Lines { height: auto; }'

    text: reactive[Text] = reactive(Text(), layout=True)

    def render(self) -> Text:
        """Return the lines."""
        return self.text


class Panel(Vertical):
    """Some widgets in a frame with a title."""

    DEFAULT_CSS = 'Panel { height: auto; border: round $primary; padding: 0 1; }'

    def __init__(self, title: str, *children: Widget, id: str | None = None) -> None:
        super().__init__(*children, id=id)
        self.border_title = title


class TeleopScreen(App[None]):
    """Shows the robot and what the fins are told, and passes the keys on.

    Parameters
    ----------
    view
        Returns what to show; called ten times a second.
    press
        Takes the action of a key, one of `KEYS`.
    settings
        The limits of the gaits, which are the ends of the gauges.

    """

    TITLE = 'manta_sim_ros teleop'
    ENABLE_COMMAND_PALETTE = False
    CSS = """
        .row { height: 8; }
        .row Panel { height: 100%; }
        #status { height: 1fr; min-height: 4; }
        .row Lines { text-wrap: nowrap; }
    """
    BINDINGS: ClassVar[list[BindingType]] = [
        *(Binding(','.join(key.keys), f'press({action!r})', key.word, key_display=key.label)
          for action, key in KEYS.items()),
        Binding('q,ctrl+c,ctrl+q', 'quit', 'quit', key_display='q', priority=True),
    ]

    def __init__(
        self, view: Callable[[], View], press: Callable[[str], None], settings: ManualSettings | None = None,
    ) -> None:
        super().__init__()
        self._view, self._press = view, press
        self._settings = ManualSettings() if settings is None else settings
        self._robot, self._source, self._status = Lines(), Lines(), Lines()
        demand = (
            Gauge('throttle', -1.0, 1.0, _percent('ahead', 'back')),
            Gauge('steer', -1.0, 1.0, _percent('right', 'left')), Gauge('climb', -1.0, 1.0, _percent('up', 'down')))
        self._gauges = {'demand': demand} | {side: self._fin() for side in SIDES}

    def compose(self) -> ComposeResult:
        """Make the widgets."""
        yield Header()
        with Horizontal(classes='row'):
            yield Panel('Robot', self._robot)
            yield Panel('Demand', *self._gauges['demand'], self._source)
        with Horizontal(classes='row'):
            for side in SIDES:
                yield Panel(f'{side.capitalize()} fin', *self._gauges[side])
        yield Panel('Status', self._status, id='status')
        yield Footer(compact=True)

    def _fin(self) -> tuple[Gauge, ...]:
        settings = self._settings
        phase = math.degrees(settings.phase + settings.largest_steering)
        bias = math.degrees(settings.largest_bias)
        return (
            Gauge('amplitude', 0.0, math.degrees(settings.largest_amplitude), _degrees),
            Gauge('frequency', 0.0, FREQUENCY_RANGE, lambda value: f'{value:.2f} Hz'),
            Gauge('phase', -phase, phase, _degrees), Gauge('bias', -bias, bias, _degrees),
            Gauge('front rod', -ROD_RANGE, ROD_RANGE, _degrees), Gauge('rear rod', -ROD_RANGE, ROD_RANGE, _degrees))

    def on_mount(self) -> None:
        """Begin to show."""
        self.show()
        self.set_interval(REFRESH, self.show)

    def show(self) -> None:
        """Show what there is now."""
        view = self._view()
        self.sub_title = view.topic
        roll, pitch, heading = map(math.degrees, view.attitude)
        rows = (
            ('time', _number(view.time, 2), 's'), ('speed', _number(view.speed, 3), 'm/s'),
            ('depth', _number(view.depth, 3), 'm'), ('heading', _number(math.remainder(heading, 360.0), 1), '°'),
            ('pitch', _number(abs(pitch), 1), f'° {_side(pitch, "nose down", "nose up")}'),
            ('roll', _number(abs(roll), 1), f'° {_side(roll, "left up", "right up")}'))
        self._robot.text = Text('\n'.join(f'{name:<13}{number:>8} {unit}' for name, number, unit in rows))
        demand = view.demand
        self._set('demand', demand.throttle, -demand.steer, demand.climb)  # the bar of steering to the left goes left
        self._source.text = Text('The joystick commands.' if view.joystick else 'The keys command.')
        for side, gait, (front, rear) in zip(SIDES, view.gaits, view.rods.tolist(), strict=True):
            amplitude, *others = map(math.degrees, (gait.amplitude, gait.phase, gait.front_bias, front, rear))
            self._set(side, amplitude, gait.frequency, *others)
        troubles = [Text(f'! {trouble}', style='bold') for trouble in view.troubles]
        pace = [Text(view.pace, style='dim')] if view.pace else []
        self._status.text = Text('\n').join([*pace, *(troubles or [Text('Nothing is wrong.')])])

    def _set(self, group: str, *values: float) -> None:
        for gauge, value in zip(self._gauges[group], values, strict=True):
            gauge.value = value

    def action_press(self, action: str) -> None:
        """Pass a key on, and show what it did."""
        self._press(action)
        self.show()


def _percent(positive: str, negative: str) -> Callable[[float], str]:
    def shown(value: float) -> str:
        return f'{abs(value):.0%} {_side(value, positive, negative)}'.rstrip()

    return shown


def _side(value: float, positive: str, negative: str) -> str:
    """Return the word for the sign of a value, none for 0 and NaN."""
    return positive if value > 0.0 else negative if value < 0.0 else ''


def _degrees(value: float) -> str:
    return f'{round(value, 1) + 0.0:.1f}°'  # no negative zero


def _number(value: float, digits: int) -> str:
    return '-' if math.isnan(value) else f'{round(value, digits) + 0.0:.{digits}f}'
