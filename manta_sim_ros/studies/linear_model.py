"""The linear model of a periodic gait, per flapping period: matrices, modes, continuous equivalent, file."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import Any

import numpy as np
import scipy.linalg

from manta_sim_ros.dynamics import FinCommand, FloatArray, State
from manta_sim_ros.figures.files import whole

FASTEST_DECAY = 1e-3
"""Least magnitude of an eigenvalue in the continuous equivalent: a mode that decays further in a period is gone."""


@dataclasses.dataclass(frozen=True, eq=False)
class LinearModel:
    """Deviations from a periodic motion: x[k + 1] = A x[k] + B u[k], y[k] = C x[k] + D u[k], k counts the periods.

    x are the deviations at the beginning of a period, u those of the commands during it, and y those of the means over
    it. All are in SI units and radians.
    """

    period: float
    """Flapping period [s]."""
    gaits: tuple[FinCommand, FinCommand]
    """The gaits of the left and the right fin."""
    equilibrium: State
    """The state at the beginning of a period, at x = y = 0 with heading 0."""
    means: FloatArray
    """(8,) means over a period, in the order of `outputs`."""
    heading_rate: float
    """Mean rate of the heading [rad/s], positive to the left."""
    climb_rate: float
    """Mean vertical velocity [m/s], positive upward."""
    states: tuple[str, ...]
    """Names of x: first the body, then the cycle angles `psi_left` and `psi_right`, then the smoothed gait."""
    inputs: tuple[str, ...]
    """Names of u, the values of the commands: of the left, then of the right fin."""
    outputs: tuple[str, ...]
    """Names of y: means of the twist, roll and pitch."""
    A: FloatArray
    """(x, x)."""
    B: FloatArray
    """(x, u)."""
    C: FloatArray
    """(y, x)."""
    D: FloatArray
    """(y, u)."""
    fin_memory: float
    """Largest error of `body_A` twice over against two simulated periods: what the fins keep from one to the next."""

    @property
    def size(self) -> int:
        """Number of states of the body."""
        return self.states.index('psi_left')

    @property
    def body_A(self) -> FloatArray:
        """(n, n) the block of A of the body."""
        return self.A[:self.size, :self.size]

    @property
    def body_B(self) -> FloatArray:
        """(n, u) the effect per period on the body of a gait that is in force, when its smoothing is over."""
        smoothed = self.A[:self.size, self.size + 2:]
        return self.B[:self.size] + smoothed if smoothed.size else self.B[:self.size]

    @property
    def eigenvalues(self) -> FloatArray:
        """(n,) complex eigenvalues of `body_A`, per period, the largest magnitude first."""
        return self._modes()[0]

    @property
    def time_constants(self) -> FloatArray:
        """(n,) time in which each mode decays to 1/e [s]; negative for one that grows."""
        with np.errstate(divide='ignore'):
            return np.asarray(-self.period / np.log(np.abs(self.eigenvalues)))

    @property
    def stable(self) -> bool:
        """Whether all modes of the body decay."""
        return bool(np.abs(self.eigenvalues).max() < 1.0)

    def _modes(self) -> tuple[Any, Any]:
        values, vectors = np.linalg.eig(self.body_A)
        order = np.argsort(-np.abs(values), kind='stable')
        return values[order], vectors[:, order]

    def continuous(self) -> tuple[FloatArray, FloatArray]:
        """Return A (n, n) and B (n, u) of dx/dt = A x + B u for the body: the same response at each beginning.

        An eigenvalue of a magnitude below FASTEST_DECAY is given that magnitude. B is for inputs that are held.

        Raises
        ------
        ValueError
            An eigenvalue of `body_A` is real and negative: a mode that changes its sign from period to period has no
            continuous equivalent.

        """
        values, vectors = self._modes()
        gone = np.abs(values) < FASTEST_DECAY
        negative = values[~gone & (values.imag == 0.0) & (values.real < 0.0)].real
        if negative.size:
            raise ValueError(
                f'there is no continuous equivalent: an eigenvalue is {negative[0]:.4g} per period, but must not be '
                'real and negative')
        slow = np.where(gone, FASTEST_DECAY, values)
        discrete = (vectors @ np.diag(slow) @ np.linalg.inv(vectors)).real
        n, inputs = self.body_B.shape
        held = np.block([[discrete, self.body_B], [np.zeros((inputs, n)), np.eye(inputs)]])
        rates = scipy.linalg.logm(held).real / self.period
        return rates[:n, :n], rates[:n, n:]

    def state_space(self) -> Any:
        """Return the whole model as a discrete `control.StateSpace`, with names; needs the package `control`."""
        import control

        return control.ss(
            self.A, self.B, self.C, self.D, self.period, states=self.states, inputs=self.inputs, outputs=self.outputs)

    def save(self, path: Path) -> None:
        """Write the model, its modes and its equilibrium to a file of NumPy (.npz), whole or not at all."""
        about = {name: getattr(self, name) for name in (
            'period', 'means', 'heading_rate', 'climb_rate', 'states', 'inputs', 'outputs', 'A', 'B', 'C', 'D',
            'fin_memory', 'body_A', 'body_B', 'eigenvalues', 'time_constants', 'stable')}
        try:
            about['continuous_A'], about['continuous_B'] = self.continuous()
        except ValueError:
            pass  # there is none
        state = {f'equilibrium_{field.name}': getattr(self.equilibrium, field.name)
                 for field in dataclasses.fields(self.equilibrium)}
        with whole(path) as part, part.open('wb') as file:
            np.savez(file, gaits=[gait.as_array() for gait in self.gaits], **about, **state)

    def __str__(self) -> str:
        """Return the model as text: equilibrium, modes of the body, and the matrices of the body."""
        values, vectors = self._modes()
        rate, roll, pitch = (math.degrees(angle) for angle in (self.heading_rate, *self.means[6:8]))
        return '\n'.join([
            f'equilibrium over a period of {self.period:g} s: {"straight" if abs(rate) < 0.01 else "a turn"}',
            f'  forward speed {_signed(self.means[0]):.4f} m/s, heading rate {_signed(rate):.2f} degrees/s, climb rate '
            f'{_signed(self.climb_rate):.4f} m/s, roll {_signed(roll):.2f} degrees, pitch {_signed(pitch):.2f} degrees',
            '',
            f'modes of the body: {"stable" if self.stable else "NOT stable"}',
            f'{"eigenvalue per period":>24}  {"time constant [s]":>17}  {"angle per period":>16}  largest parts',
            *(self._mode_line(value, constant, vector)
              for value, constant, vector in zip(values, self.time_constants, vectors.T, strict=True)
              if value.imag >= 0.0), '',
            'A of the body, per period',
            _table(self.body_A, self.states[:self.size], self.states[:self.size]), '',
            'B of the body, transposed, per period that a gait is in force [per rad, per Hz]',
            _table(self.body_B.T, self.inputs, self.states[:self.size]), '',
            f'what the fins keep from one period to the next is neglected: an error of {self.fin_memory:.2g} in the '
            'second period',
        ])

    def _mode_line(self, value: complex, constant: float, vector: FloatArray) -> str:
        sizes = np.abs(vector)
        parts = ' '.join(name for size, name in sorted(zip(sizes, self.states[:self.size], strict=True), reverse=True)
                         if size > 0.3 * sizes.max())
        number = f'{value.real:.4f}' + (f' +- {value.imag:.4f}i' if value.imag else '')
        return f'{number:>24}  {constant:17.3g}  {math.degrees(np.angle(value)):15.0f}°  {parts}'


def _table(matrix: FloatArray, rows: tuple[str, ...], columns: tuple[str, ...]) -> str:
    first = max(map(len, rows))
    return '\n'.join([
        ' ' * first + ''.join(f'{column:>9}' for column in columns),
        *(f'{row:>{first}}' + ''.join(f'{_signed(value):9.4f}' for value in values)
          for row, values in zip(rows, matrix, strict=True))])


def _signed(value: float) -> float:
    """Return a value without the sign of a zero, rounded as it is printed."""
    return round(value, 4) + 0.0
