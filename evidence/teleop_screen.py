"""The screen of teleop as text, for the documentation and for tests."""

from __future__ import annotations

import asyncio

import numpy as np
from textual.pilot import Pilot

from manta_sim_ros.control.manual import Demand, ManualControl
from manta_sim_ros.control.teleop_screen import TeleopScreen
from manta_sim_ros.control.teleop_view import View

SIZE = (80, 24)
"""Columns and lines of the smallest terminal that shows all."""

MOST_LOOKS, BETWEEN_LOOKS = 200, 0.05
"""Looks at a screen until it does not change any more, and the time between two of them [s]."""


def example() -> View:
    """Return a view of a robot that swims to the left and upward."""
    demand = Demand(throttle=0.6, steer=0.4, climb=0.2)
    return View(
        topic='/fin_command', time=42.0, speed=0.143, depth=0.512, attitude=np.radians([1.2, -2.5, 34.0]),
        demand=demand, joystick=False, gaits=ManualControl().update(10.0, demand),
        rods=np.radians([[21.0, -14.5], [24.5, -14.0]]), pace='simulated time runs at 1 times real time', troubles=())


def text_of(screen: TeleopScreen) -> str:
    """Return what a screen shows, one line of text for each of its lines."""
    strips = screen.screen._compositor.render_strips()
    return '\n'.join(''.join(segment.text for segment in strip).rstrip() for strip in strips)


async def settled_text_of(screen: TeleopScreen, pilot: Pilot[None]) -> str:
    """Return what a screen shows when it does not change any more. On a busy machine, the footer comes later."""
    before = ''
    for _ in range(MOST_LOOKS):
        await pilot.pause(BETWEEN_LOOKS)
        text = text_of(screen)
        if text == before and text.splitlines()[-1]:
            break
        before = text
    return text


def picture(view: View | None = None, size: tuple[int, int] = SIZE) -> str:
    """Return the screen for a view as text."""
    shown = example() if view is None else view
    screen = TeleopScreen(lambda: shown, lambda action: None)

    async def take() -> str:
        async with screen.run_test(size=size) as pilot:
            return await settled_text_of(screen, pilot)

    return asyncio.run(take())
