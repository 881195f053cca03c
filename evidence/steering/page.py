"""The page docs/controller.md."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from evidence.report import prose, table
from evidence.steering.responses import (
    AMPLITUDE,
    AVERAGED,
    CHAINS,
    CONFIGURATIONS,
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
    TURNS,
    Change,
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
ros2 run manta_sim_ros sim_node --ros-args --params-file config/freshwater.yaml
python3 examples/turn_with_feedback.py --ros-args -p use_sim_time:=true
```

`gait_node` publishes a list of gaits without feedback. In lockstep (`examples/lockstep.py`) the controller decides when
simulated time advances, so that results do not depend on the speed of the machine.

## With which configuration

`config/freshwater.yaml` is the configuration to develop controllers with: its densities are true, its fins resist
twist, and its body moves water, so that it turns as a robot does. `config/manta.yaml`, the default, is the robot of the
paper. All measurements below are given for both.
"""
TITLES = {
    'manta': 'With the parameters of the paper, `config/manta.yaml`',
    'freshwater': 'In fresh water, `config/freshwater.yaml`',
}


class Measured(NamedTuple):
    """All measurements with one configuration."""

    responses: Sequence[Response]
    """Of each of `CHANGES`."""
    speeds: Sequence[float]
    """Of each gait of `GRID` [m/s]."""
    yaw_rates: Sequence[float]
    """Of each of `TURNS` with each number of `CHAINS` [degrees/s]."""


def text(measured: Mapping[str, Measured]) -> str:
    """Return the page, from what was measured with each of `CONFIGURATIONS`."""
    gait = f'an amplitude of {AMPLITUDE:g}°, a frequency of {FREQUENCY:g} Hz and a phase of {PHASE:g}° on both sides'
    time_constant = Parameters().rods.command_time_constant
    return '\n\n'.join([
        HEAD.strip(),
        '## What each input does',
        prose(f"""
The reference is the straight gait with {gait}. Each row changes it.

In the first table of each configuration, forces and moments are those of both fins on the body, in the body frame: x
points forward, y to the left, z up. They are means over {AVERAGED:g} s with the body held (`solver.fixed_base`).

In the second table, the robot swims freely, and the gait changes {CRUISE:g} s after the start. The yaw rate is the mean
of the first {TURN:g} s after the change. Speed, pitch and roll are means of the last {SETTLED:.2g} s of {SWIM:g} s, and
the vertical velocity is the mean of these {SWIM:g} s. A positive yaw rate turns to the left, a positive pitch lowers
the nose, and a positive roll raises the left side."""),
        *(block for name, each in measured.items() for block in (
            f'### {TITLES[name]}', force_table(each.responses), motion_table(each.responses))),
        '## Rules',
        rules({name: each.responses for name, each in measured.items()}),
        '## Turns and the number of chains',
        prose("""
Yaw rates [°/s] with other numbers of chains, `fin.chains`. The fins of the paper do not resist twist along the chord,
and in turns 30 chains show the chordwise instability ([Model](model.md)): the yaw rate depends on the number of chains.
With the shear modulus of `config/freshwater.yaml` it does not."""),
        chains_table({name: each.yaw_rates for name, each in measured.items()}),
        '## What speed to expect',
        prose(f"""
Straight gaits with a phase of {PHASE:g}°: mean speed [m/s] of two periods after {2.0 * CRUISE:g} s from rest."""),
        speed_table({name: each.speeds for name, each in measured.items()}),
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
    """Return the mean forces and moments with the body held, with one configuration."""
    head = ('change', 'F_x [N]', 'F_y [N]', 'F_z [N]', 'M_x [N m]', 'M_y [N m]', 'M_z [N m]')
    return table(head, ((one.change.name, *(_number(value, 2) for value in one.wrench)) for one in responses))


def motion_table(responses: Sequence[Response]) -> str:
    """Return the motions that follow when the robot is free, with one configuration."""
    head = ('change', 'yaw rate [°/s]', 'speed [m/s]', 'pitch [°]', 'roll [°]', 'vertical velocity [m/s]')
    return table(head, (
        (one.change.name, _number(one.yaw_rate, 1), _number(one.speed, 3), _number(one.pitch, 1),
         _number(one.roll, 1), _number(one.climb, 3)) for one in responses))


def chains_table(yaw_rates: Mapping[str, Sequence[float]]) -> str:
    """Return the yaw rates of `TURNS` with each number of `CHAINS` for each configuration."""
    return table(('configuration', 'change', *(f'{chains} chains' for chains in CHAINS)), (
        (name, change.name, *(_number(rate, 2) for rate in rates[len(CHAINS) * row:][:len(CHAINS)]))
        for name, rates in yaw_rates.items() for row, change in enumerate(TURNS)))


def speed_table(speeds: Mapping[str, Sequence[float]]) -> str:
    """Return the speeds of the straight gaits of `GRID` for each configuration."""
    return table(('amplitude [°]', 'frequency [Hz]', *speeds), (
        (f'{amplitude:g}', f'{frequency:g}', *(_number(speed, 3) for speed in row))
        for (amplitude, frequency), *row in zip(GRID, *speeds.values(), strict=True)))


def rules(responses: Mapping[str, Sequence[Response]]) -> str:
    """Return what follows from the tables, in words. The first number of each pair is of the paper's configuration."""
    paper, fresh = ({one.change.name: one for one in responses[name]} for name in CONFIGURATIONS)

    def both(quantity: str, change: Change, digits: int) -> str:
        return ' and '.join(_number(getattr(found[change.name], quantity), digits) for found in (paper, fresh))

    risen, sunk = paper[FRONT_BIAS.name], fresh[FRONT_BIAS.name]
    lift = ' and '.join(_number(one.wrench[2], 1) for one in (risen, sunk))
    return '\n'.join(f'- {prose(line)}' for line in (
        'Of two numbers, the first one is with `config/manta.yaml` and the second one with `config/freshwater.yaml`.',
        'Amplitude and frequency set the thrust and so the speed. A negative phase reverses it: '
        f'{both("speed", REVERSED, 2)} m/s.',
        'The robot turns to the side of the weaker fin, with both configurations. With a smaller phase on the right it '
        f'turns to the right with {both("yaw_rate", RIGHT_PHASE, 1)}°/s, and with a smaller amplitude there with '
        f'{both("yaw_rate", RIGHT_AMPLITUDE, 1)}°/s.',
        'In turns, the fins of the paper show the chordwise instability, so that the yaw rate depends on the number of '
        'chains (below). Use `config/freshwater.yaml` for turns.',
        f'Biases set the incidence of the fins. A positive front bias of both fins gives a lift of {lift} N on a body '
        'that is held.',
        'When it swims freely, the two configurations differ in sign. With `config/manta.yaml` it rises with '
        f'{risen.climb:.3f} m/s and pitches by {risen.pitch:.1f}°. With `config/freshwater.yaml` it lowers its nose by '
        f'{sunk.pitch:.1f}° and sinks with {-sunk.climb:.3f} m/s, because the added mass of its body turns the nose '
        'away from the direction of motion (Munk moment). The same holds for a negative rear bias. So the sign of the '
        'gain of a depth controller depends on the configuration.',
        f'Opposite front biases roll the robot by {both("roll", OPPOSITE_BIASES, 1)}°. The buoyancy restores pitch and '
        'roll.',
    ))


def _number(value: float, digits: int) -> str:
    text = f'{value:.{digits}f}'
    return f'{0.0:.{digits}f}' if float(text) == 0.0 else text  # no negative zero
