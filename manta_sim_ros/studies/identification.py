"""Identification: parameters of the model from measured runs, by weighted nonlinear least squares. Free of ROS."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import t as student

from manta_sim_ros.dynamics import DivergenceError, FloatArray, Parameters
from manta_sim_ros.studies.measured import Run
from manta_sim_ros.studies.replay import Values, error, interval_of, plan_of, simulate_runs, value_of, with_whole_starts
from manta_sim_ros.studies.study import with_parameters

CONFIDENCE = 0.95
"""Probability that an interval has the true value."""

FIRST_DEVIATION, LEAST_DEVIATION = 1e-2, 1e-4
"""Standard deviation of noise that is not known, before the first fit, and the least one: shares of the range."""

NOISE_TOLERANCE, MOST_FITS = 0.05, 10
"""The fit is repeated until no estimated standard deviation changes by more than this share, at most so often."""

MOST_EVALUATIONS = 100
"""Largest number of simulations of all runs in one fit."""

TOLERANCE = 0.01
"""How near the fit comes to the least squares, in standard errors of the estimates."""

STEP = 1e-5
"""Step of the difference quotients: of a parameter as a share of its scale, of a start in m, rad, m/s, rad/s."""

DECADES = 10.0 ** np.arange(-6, 7)
"""Scales of a parameter whose value is 0, of which the largest is taken that the data hardly show."""

NO_EFFECT = 1e-6
"""Root mean square of what a change by the scale of a parameter does to all samples, in standard deviations, from
which the parameter has an effect."""

SINGULAR = 1e-4
"""Singular value of the Jacobian with columns of unit norm from which it is not singular: the difference quotients are
not more exact."""

SHARE = 0.1
"""Share of a parameter in the weakest direction from which it is named."""

ILL_CONDITIONED = 20.0
"""Condition number of the Jacobian with columns of unit norm above which the weakest direction is named."""


class NotIdentifiableError(ValueError):
    """The data cannot say what the values of the free parameters are."""


@dataclasses.dataclass(frozen=True)
class Fit:
    """How well runs are simulated: errors are measured less simulated values, with the best starts of the segments."""

    rms: dict[str, FloatArray]
    """Root mean square of the errors of each component, by channel [SI units, rad]."""
    weighted: dict[str, FloatArray]
    """The same in standard deviations of the noise, as far as that is known; NaN where it is not."""
    values: list[Values]
    """The simulated values of each run."""


@dataclasses.dataclass(frozen=True)
class Identification:
    """The result of an identification of p parameters."""

    names: tuple[str, ...]
    before: FloatArray
    """(p,) values at the start."""
    estimates: FloatArray
    """(p,)."""
    errors: FloatArray
    """(p,) standard errors; greater by the root of `chi_square` if that is above 1."""
    intervals: FloatArray
    """(p, 2) bounds of the values with the probability CONFIDENCE, cut at the bounds of the parameters."""
    correlations: FloatArray
    """(p, p) of the errors of the estimates."""
    condition: float
    """Condition number of the Jacobian with columns of unit norm, after what the starts of the segments explain."""
    mixed: str
    """Names of parameters that are hard to tell apart, if `condition` is above ILL_CONDITIONED."""
    chi_square: float
    """Mean square of the weighted errors for each degree of freedom; 1 if model and noise are right."""
    parameters: Parameters
    """All values of the model, with the estimates."""
    fit: Fit
    """How well the runs are simulated with them."""


class Problem:
    """Measured runs and their simulations as a function of the unknowns x.

    x has the free parameters over their scales, then the changes of the free coordinates of the starts of all segments
    (`replay.simulate_runs`).

    Parameters
    ----------
    runs
        The measured runs.
    free
        Names of numbers of the model, such as `fin.drag_coefficient` or `body.inertia[0]`.
    parameters
        All values of the model.
    segment
        Duration of the segments [s]; by default each run is one.

    Raises
    ------
    ValueError
        There are no runs; a name is not that of a number of the model, or is given twice; a segment is too short, or
        has no sample of a channel that says where it starts.
    DivergenceError
        The motion diverges with these values.

    """

    def __init__(
        self, runs: Sequence[Run], free: Sequence[str], parameters: Parameters, segment: float | None = None,
    ) -> None:
        if not runs:
            raise ValueError('there are no runs, but must be at least one')
        for name in free:
            if list(free).count(name) > 1:
                raise ValueError(f'{name} is free twice, but must be once')
        self.runs, self.names, self.parameters = runs, tuple(free), parameters
        values = np.array([value_of(parameters, name) for name in free])
        about = [Parameters.quantities()[name.partition('[')[0]] for name in free]
        self.every = interval_of(runs, parameters.solver.time_step)
        self.plans = with_whole_starts(
            [plan_of(run, parameters, self.every, segment) for run in runs], parameters, self.every)
        counts = [len(plan.starts) for plan in self.plans]
        self._first = np.cumsum([0, *counts])  # segment of each run
        starts = [(first + number, coordinate) for first, plan in zip(self._first, self.plans, strict=False)
                  for number in range(len(plan.starts)) for coordinate in plan.starts[number].free]
        self._of_segment, self._coordinate = np.array(starts, dtype=int).reshape(-1, 2).T
        self._coordinates = np.unique(self._coordinate)
        self._set_rows()
        self.weights = 1.0 / self._deviations(self._least(FIRST_DEVIATION))
        self.scales = np.abs(values)
        self.scales[values == 0.0] = 1.0
        self.start = np.concatenate([values / self.scales, np.zeros(len(starts))])
        self._high = np.array([each.high for each in about])
        base, = self.errors([self.start])
        if isinstance(base, DivergenceError):
            raise base
        for index in np.flatnonzero(values == 0.0):
            self.scales[index] = self._scale(index, base)
        self.bounds = (
            np.concatenate([np.array([each.low for each in about]) / self.scales, np.full(len(starts), -np.inf)]),
            np.concatenate([self._high / self.scales, np.full(len(starts), np.inf)]))
        if any(len(plan.starts) > 1 for plan in self.plans):
            self._hold_starts_without_effect()

    def _set_rows(self) -> None:
        """Set segment, component and known standard deviation (N,) of each of the N errors, and the components."""
        self.channels = list(dict.fromkeys(name for run in self.runs for name in run.channels))
        width = {name: series.deviations.shape[1] for run in self.runs for name, series in run.channels.items()}
        first = dict(zip(self.channels, np.cumsum([0, *(width[name] for name in self.channels)]), strict=False))
        self.components = {name: slice(first[name], first[name] + width[name]) for name in self.channels}
        every = [(run.channels[name], plan.segments[name] + segment, np.arange(width[name]) + first[name])
                 for run, plan, segment in zip(self.runs, self.plans, self._first, strict=False)
                 for name in run.channels]
        self.segments = np.concatenate([np.repeat(segments, len(own)) for _, segments, own in every])
        self.component = np.concatenate([np.tile(own, len(series.time)) for series, _, own in every])
        self.known = np.concatenate([series.deviations.ravel() for series, _, _ in every])

    def _least(self, share: float) -> FloatArray:
        """Return a share of the largest range of the components of each channel, for each component."""
        least = []
        for name, own in self.components.items():
            values = np.concatenate([run.channels[name].values for run in self.runs if name in run.channels])
            least += [share * (float(np.ptp(values, axis=0).max()) or 1.0)] * (own.stop - own.start)
        return np.array(least)

    def _deviations(self, unknown: FloatArray) -> FloatArray:
        """Return the standard deviations (N,) of all errors; of a component that is not known, that of `unknown`."""
        return np.where(np.isnan(self.known), unknown[self.component], self.known)

    def _scale(self, index: Any, base: FloatArray) -> float:
        """Return the largest change of a parameter from 0 that the data hardly show."""
        tried = DECADES[DECADES <= self._high[index]]
        changed = self.errors([self.start + decade * np.eye(len(self.start))[index] for decade in tried])
        small = [decade for decade, each in zip(tried, changed, strict=True)
                 if not isinstance(each, DivergenceError) and np.mean(((each - base) * self.weights) ** 2) < 1.0]
        return float(max(small, default=tried[0]))

    def _hold_starts_without_effect(self) -> None:
        """Keep the coordinates of starts, such as where the robot is, as they are if no sample depends on them."""
        of_coordinates = self.quotients(self.start)[1][:, np.searchsorted(self._coordinates, self._coordinate)]
        own = self.segments[:, None] == self._of_segment
        squares = np.sum(np.where(own, of_coordinates, 0.0) ** 2, axis=0)
        free = squares > NO_EFFECT ** 2 * np.sum(own, axis=0)
        self._of_segment, self._coordinate = self._of_segment[free], self._coordinate[free]
        self._coordinates = np.unique(self._coordinate)
        kept = np.concatenate([np.ones(len(self.names), dtype=bool), free])
        self.start, self.bounds = self.start[kept], (self.bounds[0][kept], self.bounds[1][kept])

    def noise(self) -> dict[str, FloatArray]:
        """Return the median standard deviation of each component by channel, as far as it is known by now."""
        return {name: np.array([np.median(1.0 / self.weights[self.component == component])
                                for component in range(own.start, own.stop)])
                for name, own in self.components.items()}

    def parameters_at(self, x: FloatArray) -> Parameters:
        """Return all values of the model for the unknowns."""
        values = x[:len(self.names)] * self.scales
        return with_parameters(self.parameters, dict(zip(self.names, values.tolist(), strict=True)))

    def simulated(self, unknowns: Sequence[FloatArray]) -> list[list[Values] | DivergenceError]:
        """Return the simulated values of all runs for each set of unknowns; all robots are simulated at once."""
        cases = []
        for x in unknowns:
            parameters, changes = self.parameters_at(x), np.zeros((self._first[-1], 12))
            changes[self._of_segment, self._coordinate] = x[len(self.names):]
            cases += [(parameters, plan, changes[first:first + len(plan.starts)])
                      for plan, first in zip(self.plans, self._first, strict=False)]
        found = simulate_runs(cases, self.every)
        sets = [found[first:first + len(self.plans)] for first in range(0, len(found), len(self.plans))]
        return [next((each for each in one if isinstance(each, DivergenceError)), one) for one in sets]  # type: ignore[misc]

    def errors(self, unknowns: Sequence[FloatArray]) -> list[FloatArray | DivergenceError]:
        """Return the errors (N,) of all samples of all runs for each set of unknowns."""
        return [each if isinstance(each, DivergenceError) else self._errors_of(each)
                for each in self.simulated(unknowns)]

    def _errors_of(self, simulated: Sequence[Values]) -> FloatArray:
        return np.concatenate([
            error(name, series.values, values[name]).ravel() for run, values in zip(self.runs, simulated, strict=True)
            for name, series in run.channels.items()])

    def residuals(self, x: FloatArray) -> FloatArray:
        """Return the errors (N,) in standard deviations; infinite for values with which there is no motion."""
        try:
            errors, = self.errors([x])
            return np.full(len(self.known), np.inf) if isinstance(errors, DivergenceError) else errors * self.weights
        except ValueError:  # values that do not go together
            return np.full(len(self.known), np.inf)

    def quotients(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return derivatives of `residuals` as difference quotients, all robots simulated at once.

        Those by the parameters (N, p), and those by each free coordinate (N, c) of the start of the own segment: the
        same coordinate of all starts is changed at once, as the fins have forgotten the segment before.

        Raises
        ------
        DivergenceError
            A motion diverges.

        """
        p = len(self.names)
        steps = np.where(x[:p] + STEP > self.bounds[1][:p], -STEP, STEP)
        changes = [*np.pad(np.diag(steps), ((0, 0), (0, len(x) - p))),
                   *(np.pad(STEP * (self._coordinate == each), (p, 0)) for each in self._coordinates)]
        errors = []
        for found in self.errors([x, *(x + change for change in changes)]):
            if isinstance(found, DivergenceError):
                raise found
            errors.append(found * self.weights)
        differences = (np.array(errors[1:]).reshape(-1, len(errors[0])) - errors[0]).T
        return differences[:, :p] / steps, differences[:, p:] / STEP

    def jacobian(self, x: FloatArray) -> FloatArray:
        """Return the derivatives (N, len(x)) of `residuals`."""
        of_parameters, of_coordinates = self.quotients(x)
        of_starts = of_coordinates[:, np.searchsorted(self._coordinates, self._coordinate)]
        return np.hstack([of_parameters, np.where(self.segments[:, None] == self._of_segment, of_starts, 0.0)])

    def sensitivities(self, x: FloatArray) -> list[FloatArray]:
        """Return the derivatives by the parameters (n, p) for each segment, without what its start can explain."""
        parts = []
        of_parameters, of_coordinates = self.quotients(x)
        for segment in range(self._first[-1]):
            rows = self.segments == segment
            own = of_coordinates[rows][:, np.isin(self._coordinates, self._coordinate[self._of_segment == segment])]
            explained = own @ np.linalg.lstsq(own, of_parameters[rows], rcond=None)[0]
            parts.append(of_parameters[rows] - explained)
        return parts

    def fit_at(self, x: FloatArray) -> Fit:
        """Return how well the runs are simulated with the unknowns."""
        values, = self.simulated([x])
        if isinstance(values, DivergenceError):
            raise values
        errors = self._errors_of(values)

        def rms(scaled: FloatArray) -> dict[str, FloatArray]:
            squares = np.bincount(self.component, scaled ** 2) / np.bincount(self.component)
            return {name: np.sqrt(squares[own]) for name, own in self.components.items()}

        return Fit(rms(errors), rms(errors / self.known), values)

    def fit(self, done: Callable[[float], object] = lambda cost: None, most_fits: int = MOST_FITS) -> FloatArray:
        """Return the unknowns with the least squares; noise that is not known is estimated from the errors.

        With `most_fits` 1 it is FIRST_DEVIATION of the range instead. `done` is called with the mean square of the
        residuals after each simulation of all runs.

        Raises
        ------
        NotIdentifiableError
            The search does not end.

        """
        def residuals(x: FloatArray) -> FloatArray:
            found = self.residuals(x)
            done(float(np.mean(found ** 2)))
            return found

        x = self.start
        for _ in range(most_fits if len(x) else 0):
            x = np.clip(x, *self.bounds)
            for method in ('dogbox', 'trf'):  # dogbox also leaves a bound, trf also ends where directions differ much
                found = least_squares(
                    residuals, x, self.jacobian, self.bounds, method=method, x_scale='jac',
                    ftol=TOLERANCE ** 2 / len(self.known), max_nfev=MOST_EVALUATIONS // 2)
                x = found.x
                if found.status > 0:
                    break
            else:
                raise NotIdentifiableError(
                    f'the search has not ended after {MOST_EVALUATIONS} simulations: free fewer parameters, take '
                    'longer segments, or give other values to start from')
            if self._estimate_noise(found.fun / self.weights) < NOISE_TOLERANCE:
                break
        return np.asarray(x)

    def _estimate_noise(self, errors: FloatArray) -> float:
        """Weight errors of noise that is not known by their size; return the largest change of a weight, as a share."""
        before, unknown = self.weights, np.isnan(self.known)
        squares = np.bincount(self.component[unknown], errors[unknown] ** 2, len(self._least(1.0)))
        counts = np.bincount(self.component[unknown], minlength=len(squares))
        rms = np.sqrt(squares / np.maximum(counts, 1))
        self.weights = 1.0 / self._deviations(np.maximum(rms, self._least(LEAST_DEVIATION)))
        return float(np.abs(self.weights / before - 1.0).max())


class Directions(NamedTuple):
    """The singular value decomposition of sensitivities with columns of unit norm."""

    effects: FloatArray
    """(p,) norms of the columns: 1 over the standard errors, if only one parameter is free."""
    singular: FloatArray
    """(p,) singular values, the smallest one last."""
    rows: FloatArray
    """(p, p) directions in the space of the parameters."""

    def mixed(self, names: Sequence[str]) -> str:
        """Return the names of the parameters of the weakest direction."""
        return ', '.join(name for name, part in zip(names, self.rows[-1], strict=True) if abs(part) > SHARE)


def check_free(free: Sequence[str]) -> None:
    """Raise a ValueError if no parameter is free."""
    if not free:
        raise ValueError('no parameter is free, but at least one must be')


def directions_of(names: Sequence[str], sensitivities: FloatArray) -> Directions:
    """Decompose sensitivities (N, p).

    Raises
    ------
    NotIdentifiableError
        A parameter has no effect, or some cannot be told apart; names them.

    """
    effects = np.linalg.norm(sensitivities, axis=0)
    without = [name for name, effect in zip(names, effects, strict=True)
               if not effect > NO_EFFECT * np.sqrt(len(sensitivities))]
    if without:
        raise NotIdentifiableError(f'the data say nothing about {", ".join(without)}: no sample depends on it')
    *_, singular, rows = np.linalg.svd(sensitivities / effects, full_matrices=False)
    directions = Directions(effects, singular, rows)
    if singular[-1] < SINGULAR:
        raise NotIdentifiableError(
            f'the data cannot tell {directions.mixed(names)} apart: a change of one has the effect of a change of the '
            'others')
    return directions


def identify(
    runs: Sequence[Run], free: Sequence[str], parameters: Parameters, *, segment: float | None = None,
    done: Callable[[float], object] = lambda cost: None,
) -> Identification:
    """Fit numbers of the model to measured runs, together with the starts of the runs or of segments of them.

    The sum of the squares of all errors in standard deviations of the noise is minimized, within the bounds of the
    parameters. Noise that the data do not know is estimated for each component of each channel from the errors.

    A segment starts with a body of its own, while the fins go on: they are hardly ever measured, and forget their start
    within a stroke or two. Pose and twist at its start are free; the search begins with what is measured, and with a
    simulation of the run for the rest. A run starts at the origin and at rest where its start is not measured. The
    starts are not tied to the ends of the segments before, so that an error of the model, or an unstable motion, does
    not add up over a long run.

    Parameters
    ----------
    runs
        The measured runs.
    free
        Names of the parameters to fit, such as `fin.drag_coefficient` or `body.inertia[0]`.
    parameters
        All values of the model, from which the search starts.
    segment
        Duration of the segments [s]; by default each run is one.
    done
        Is called with the mean square of the weighted errors after each simulation of all runs.

    Raises
    ------
    ValueError
        No parameter is free, a name is not that of a number of the model, or as `Problem`.
    NotIdentifiableError
        The data cannot say what the values are; names the parameters. This is a ValueError.
    DivergenceError
        The motion diverges. This is a ValueError.

    """
    check_free(free)
    problem = Problem(runs, free, parameters, segment)
    directions_of(free, np.concatenate(problem.sensitivities(problem.start)))
    x = problem.fit(done)
    residuals, p = problem.residuals(x), len(free)
    effects, singular, rows = found = directions_of(free, np.concatenate(problem.sensitivities(x)))
    condition = float(singular[0] / singular[-1])
    inverse = (rows.T / singular) / effects[:, None] * problem.scales[:, None]
    degrees = max(1, len(residuals) - len(x))
    chi_square = float(residuals @ residuals) / degrees
    covariance = inverse @ inverse.T * max(1.0, chi_square)
    deviations = np.sqrt(np.diag(covariance))
    estimates, half = x[:p] * problem.scales, deviations * student.ppf(0.5 + 0.5 * CONFIDENCE, degrees)
    low, high = (bound[:p] * problem.scales for bound in problem.bounds)
    return Identification(
        problem.names, problem.start[:p] * problem.scales, estimates, deviations,
        np.clip(np.stack([estimates - half, estimates + half], axis=1), low[:, None], high[:, None]),
        covariance / np.outer(deviations, deviations), condition,
        found.mixed(free) if condition > ILL_CONDITIONED else '', chi_square, problem.parameters_at(x),
        problem.fit_at(x))


def evaluate(runs: Sequence[Run], parameters: Parameters, *, segment: float | None = None) -> Fit:
    """Return how well runs are simulated with given parameters: only the starts are fitted. Errors as `identify`."""
    problem = Problem(runs, (), parameters, segment)
    return problem.fit_at(problem.fit(most_fits=1))
