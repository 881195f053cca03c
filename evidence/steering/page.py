"""The page docs/controller.md."""

from __future__ import annotations

from collections.abc import Sequence

from evidence.report import prose, table
from evidence.steering.responses import (
    AMPLITUDE,
    AVERAGED,
    CRUISE,
    FREQUENCY,
    FRONT_BIAS,
    GRID,
    OPPOSITE_BIASES,
    PHASE,
    REVERSED,
    RIGHT_AMPLITUDE,
    RIGHT_PHASE,
    SETTLED,
    SWIM,
    TURN,
    Response,
)
from manta_sim_ros.dynamics import Parameters

HEAD = """# Writing a controller

A controller is a node that publishes `fin_command` and subscribes to what it needs: `odom`, or `imu/data` and
`pressure`. This page says what each input does, how fast commands may come, and what speed to expect. `make steering`
measured all numbers on this page and wrote it.

## The smallest controller

`examples/turn_with_feedback.py` is a complete node in less than 60 lines: it holds a heading with the difference of the
phases of both fins. Start the simulator, then the controller, with simulated time:

```bash
ros2 run manta_sim_ros sim_node
python3 examples/turn_with_feedback.py --ros-args -p use_sim_time:=true
```

`gait_node` publishes a list of gaits without feedback. In lockstep (`examples/lockstep.py`) the controller decides when
simulated time advances, so that results do not depend on the speed of the machine.
"""


def text(responses: Sequence[Response], speeds: Sequence[float]) -> str:
    """Return the page."""
    gait = f'an amplitude of {AMPLITUDE:g}°, a frequency of {FREQUENCY:g} Hz and a phase of {PHASE:g}° on both sides'
    time_constant = Parameters().rods.command_time_constant
    return '\n\n'.join([
        HEAD.strip(),
        '## What each input does',
        prose(f"""
The reference is the straight gait with {gait}, with the parameters of `config/manta.yaml`. Each row changes it. Forces
and moments are those of both fins on the body, in the body frame: x points forward, y to the left, z up. They are means
over {AVERAGED:g} s with the body held (`solver.fixed_base`)."""),
        force_table(responses),
        prose(f"""
The same changes, {CRUISE:g} s after the start, while the robot swims freely. The yaw rate is the mean of the first
{TURN:g} s after the change. Speed, pitch and roll are means of the last {SETTLED:.2g} s of {SWIM:g} s, and the vertical
velocity is the mean of these {SWIM:g} s. A positive yaw rate turns to the left, a positive pitch lowers the nose, and a
positive roll raises the left side."""),
        motion_table(responses),
        '## Rules',
        rules(responses),
        '## What speed to expect',
        prose(f"""
Straight gaits with a phase of {PHASE:g}°: mean speed of two periods after {2.0 * CRUISE:g} s from rest."""),
        speed_table(speeds),
        '## How fast commands may come',
        prose(f"""
Commands may come at any rate: the node takes each one, and the last one counts. Frequency, amplitude, phase and biases
pass through a critically damped filter with the time constant `rods.command_time_constant`, {time_constant:g} s by
default, so that rod angles and rates never jump. Therefore more than about ten commands per second make no difference.
The robot flaps at {FREQUENCY:g} Hz, and its body oscillates at this frequency: average the feedback over a period, or
filter this frequency out, before the controller uses it.

A command that the mechanism cannot follow, or cannot reach from the present gait, is refused as a whole with a warning
that names the value and the bound; the previous gait continues. With `command_timeout` the amplitudes go to zero when
no command comes for that time."""),
    ]) + '\n'


def force_table(responses: Sequence[Response]) -> str:
    """Return the mean forces and moments with the body held."""
    head = ('change', 'F_x [N]', 'F_y [N]', 'F_z [N]', 'M_x [N m]', 'M_y [N m]', 'M_z [N m]')
    return table(head, ((one.change.name, *(_number(value, 2) for value in one.wrench)) for one in responses))


def motion_table(responses: Sequence[Response]) -> str:
    """Return the motions that follow when the robot is free."""
    head = ('change', 'yaw rate [°/s]', 'speed [m/s]', 'pitch [°]', 'roll [°]', 'vertical velocity [m/s]')
    return table(head, (
        (one.change.name, _number(one.yaw_rate, 1), _number(one.speed, 3), _number(one.pitch, 1),
         _number(one.roll, 1), _number(one.climb, 3)) for one in responses))


def speed_table(speeds: Sequence[float]) -> str:
    """Return the speeds of the straight gaits of `GRID`."""
    return table(('amplitude [°]', 'frequency [Hz]', 'speed [m/s]'), (
        (f'{amplitude:g}', f'{frequency:g}', _number(speed, 3))
        for (amplitude, frequency), speed in zip(GRID, speeds, strict=True)))


def rules(responses: Sequence[Response]) -> str:
    """Return what follows from the tables, in words."""
    found = {one.change.name: one for one in responses}
    back, phase, amplitude = found[REVERSED.name], found[RIGHT_PHASE.name], found[RIGHT_AMPLITUDE.name]
    lift, roll = found[FRONT_BIAS.name], found[OPPOSITE_BIASES.name]
    return '\n'.join(f'- {prose(line)}' for line in (
        f'Amplitude and frequency set the thrust and so the speed. A negative phase reverses it: {back.speed:.2f} m/s.',
        'The robot turns to the side of the weaker fin. With a smaller phase or a smaller amplitude on the right it '
        f'turns to the right, with {phase.yaw_rate:.1f} and {amplitude.yaw_rate:.1f}°/s.',
        'In turns, the fins of the paper show the chordwise instability, and the yaw rate depends on `fin.chains` '
        '([Model](model.md)).',
        f'Biases set the incidence of the fins. A positive front bias lifts the robot with {lift.climb:.3f} m/s. '
        f'Opposite front biases roll it by {roll.roll:.1f}°. The buoyancy restores pitch and roll.',
    ))


def _number(value: float, digits: int) -> str:
    text = f'{value:.{digits}f}'
    return f'{0.0:.{digits}f}' if float(text) == 0.0 else text  # no negative zero
