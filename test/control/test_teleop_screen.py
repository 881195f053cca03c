"""The screen of teleop, with the pilot of Textual."""

import asyncio
import math
import re

import numpy as np
import pytest

pytest.importorskip('textual')

from evidence import tables  # noqa: E402
from evidence.teleop_screen import SIZE, example, picture, settled_text_of, text_of  # noqa: E402
from manta_sim_ros.control.joystick import JoystickSettings  # noqa: E402
from manta_sim_ros.control.manual import Demand, ManualControl  # noqa: E402
from manta_sim_ros.control.teleop_screen import TeleopScreen  # noqa: E402
from manta_sim_ros.control.teleoperation import KEYS, Teleoperation  # noqa: E402


def after(*keys, view=example):
    """Return the actions that these keys caused, whether the screen is still there, and what it shows."""
    actions = []
    screen = TeleopScreen(view, actions.append)

    async def press():
        async with screen.run_test(size=SIZE) as pilot:
            await pilot.press(*keys)
            await pilot.pause()
            return actions, screen.is_running and not screen._exit, text_of(screen)

    return asyncio.run(press())


def test_every_key_does_what_its_table_says():
    keys = [(name, action) for action, key in KEYS.items() for name in key.keys]
    actions, running, _ = after(*(name for name, _ in keys))
    assert actions == [action for _, action in keys] and running
    listed = {name for row in tables.teleop_keys().splitlines()[2:] for name in re.findall('`(.+?)`', row)}
    assert listed == {name for name, _ in keys} | {'q', 'ctrl+c'}


@pytest.mark.parametrize('key', ['q', 'ctrl+c', 'ctrl+q'])
def test_a_key_leaves_the_screen(key):
    actions, running, _ = after(key)
    assert not actions and not running


def test_the_footer_has_all_actions_where_the_terminal_is_wide_enough():
    footer = picture().splitlines()[-1]
    assert [f'{key.label} {key.word}' in footer for key in KEYS.values()] == [True] * len(KEYS)
    assert 'q quit' in footer


def test_what_a_key_does_is_shown_at_once():
    teleoperation = Teleoperation(ManualControl(), JoystickSettings())

    def view():
        return example()._replace(demand=teleoperation.demand)

    screen = TeleopScreen(view, teleoperation.press)

    async def press():
        async with screen.run_test(size=SIZE) as pilot:
            await pilot.press('up', 'up', 'left', 'f')
            return await settled_text_of(screen, pilot)

    text = asyncio.run(press())
    assert all(words in text for words in ('20% ahead', '20% left', '20% down'))


def line_of(text, label):
    return next(line for line in text.splitlines() if label in line)


def test_gauges_reach_from_zero_to_the_value_and_end_at_the_limits():
    level = example()._replace(demand=Demand(), rods=np.radians([[90.0, -90.0], [45.0, 0.0]]))
    text = picture(level)
    half = '───────'
    assert f'{half}│{half}' in line_of(text, 'throttle') and '0%' in line_of(text, 'throttle')
    assert f'{half}│███████ ' in line_of(text, 'front rod') and '90.0°' in line_of(text, 'front rod')
    assert f' ███████│{half} ' in line_of(text, 'rear rod') and '-90.0°' in line_of(text, 'rear rod')
    beyond = picture(level._replace(rods=np.radians([[150.0, -150.0], [45.0, 0.0]])))
    assert f'{half}│███████ ' in line_of(beyond, 'front rod') and '150.0°' in line_of(beyond, 'front rod')


def test_what_is_unknown_is_a_dash_and_what_is_wrong_is_listed():
    nothing = example()._replace(
        time=math.nan, speed=math.nan, depth=math.nan, attitude=np.full(3, math.nan), rods=np.full((2, 2), math.nan),
        pace='', troubles=('no simulator', 'waiting for /odom'), joystick=True)
    text = picture(nothing)
    for name in ('time', 'speed', 'depth', 'heading', 'pitch', 'roll', 'front rod', 'rear rod'):
        assert re.search(rf'{name} [ ─│]*- ', line_of(text, name)), name
    assert '! no simulator' in text and '! waiting for /odom' in text and 'Nothing is wrong' not in text
    assert 'The joystick commands.' in text and '│ ! no simulator' in text


@pytest.mark.parametrize('size', [(80, 24), (120, 40), (200, 60)])
def test_lines_stay_within_their_frames_at_every_size(size):
    lines = picture(size=size).splitlines()
    assert len(lines) == size[1] and max(map(len, lines)) <= size[0]
    for label in ('time', 'front rod', 'amplitude'):
        line = line_of('\n'.join(lines), label)
        assert line[0] == line[-1] == '│' and len(line) == size[0]
