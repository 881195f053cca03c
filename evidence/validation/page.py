"""The page docs/validation.md."""

from __future__ import annotations

import itertools
from collections.abc import Mapping

from evidence.report import picture, prose, table
from evidence.validation.facts import BODY_LENGTH, FACTS, OXYGEN, TOLERANCE, Fact
from evidence.validation.figures import FRESHWATER, written
from evidence.validation.measurements import AMPLITUDES, CONFIGURATIONS, FREQUENCY, RESULTS, VARIED, Measured
from evidence.validation.sensitivity import (
    CHAINS,
    DAMPING,
    DENSITY,
    DRAG,
    FACTORS,
    FIN_DRAG,
    NEARLY,
    Sensitivity,
    Variant,
)
from manta_sim_ros.figures.figure_8 import PHASE_OF_AMPLITUDES

MANTA = CONFIGURATIONS[0]
HEAD = """# Validation: the simulator beside published facts

[Verification](verification.md) asks whether the equations are solved correctly. This page asks whether their results
resemble mantas and their robots. No measured motion of the robot of Qu et al. is published with numbers, so there is
nothing to fit, and no value was fitted to the facts below. `make validate` measured all numbers on this page and wrote
it.
"""
PLOTS = ('facts', 'exponents')
CAPTION = (
    'Left and center: cruise speed and Strouhal number against amplitude. Right: yaw rate against turning radius; the '
    'blue lines are the same turns with the quadratic damping of yaw between half and twice its value. Published '
    'values are green.')


def text(measured: Mapping[str, Measured], sensitivity: Sensitivity) -> str:
    """Return the page."""
    return '\n\n'.join([
        HEAD.strip(),
        '## What is compared',
        prose(f"""
Two configurations are measured: `config/{MANTA}`, the robot of the paper, and `config/{FRESHWATER}`, the robot in fresh
water with twist stiffness of the fins and a body in water. Straight gaits have a frequency of {FREQUENCY:g} Hz and a
phase of 40°. The cruise is that with an amplitude of 40°, and the greatest speed is the largest one with amplitudes of
{AMPLITUDES[0]:g} to {AMPLITUDES[-1]:g}°. The greatest thrust is that with the body held, an amplitude of
{AMPLITUDES[-1]:g}° and a phase of {PHASE_OF_AMPLITUDES:g}°, as in Figure 8 of the paper. The turns are those of Figure
10, at 0.8 Hz: set 1 has different phases (40/0°), and set 2 has different amplitudes (40/20°).

The Strouhal number is f A / U. A is the distance between the highest and the lowest position of a fin tip in the world
frame, the mean over all chains. The power is the mean power of the motors into the fins, without losses of motors and
gears. The cost of transport is this power divided by the weight of the body in air, m g, and by the speed.

A result, as it is printed, agrees with a published range if it is in the range, and with a single published number if
it differs by at most {100.0 * TOLERANCE:.0f} %. The model has no length of the body. Where a fact is given in body
lengths, the length is {BODY_LENGTH:g} m, which is an assumption: that of the ellipsoid whose added mass
`config/{FRESHWATER}` has. Rates are magnitudes: all turns go to the right, except where a sign is given.
"""),
        '## The facts', fact_table(measured, sensitivity),
        prose(f"""
The last column names the parameter that decides the result in each configuration, with its exponent: see "Which
parameter decides". It names several where their exponents are within {100.0 * (1.0 - NEARLY):.0f} % of the largest, and
one more where the largest is that of the number of chains, which is no property of a robot. For the
cost of fish, 1 mg of oxygen was taken as {OXYGEN:g} J. No cost of transport of a robotic manta was found: according to
Designs 2021, 5, 69, only 3 of 139 robots were published with one. The sources marked "abstract" or "introduction" were
read there only."""),
        picture('validation/facts.png', CAPTION),
        '## What does not agree', disagreements(measured),
        '## Which parameter decides',
        prose("""
Each value was halved and doubled, with all other values unchanged. The tables and the picture give the exponent p of
result ~ value^p between these two. An exponent of 0 means that the value has no influence, and an exponent of 1 means
that the result doubles when the value doubles; "0" is an exponent that rounds to 0.00. "?" is written where there is no
exponent, because one of the two robots turns to the other side or its simulation diverges. A value that is 0 in a
configuration is not in its table. Where a value makes the fins stiffer or heavier, the time step is reduced so that it
stays stable."""),
        picture('validation/exponents.png', 'Exponents of the results: red, the result grows with the value; blue, it '
                'decreases.'),
        *(part for name in CONFIGURATIONS for part in (f'### {name}', exponent_table(sensitivity, name))),
        conclusions(measured, sensitivity),
        '## Which configuration for what', recommendation(measured),
    ]) + '\n'


def fact_table(measured: Mapping[str, Measured], sensitivity: Sensitivity) -> str:
    """Return the facts with the results of each configuration beside them."""
    head = ('quantity', 'published', 'source', *CONFIGURATIONS, 'decided by')
    return table(head, (
        (fact.quantity, fact.text, fact.source, *(judged(fact, measured[name].results) for name in CONFIGURATIONS),
         '; '.join(f'{name}: {decided(fact, sensitivity, name)}' for name in CONFIGURATIONS))
        for fact in FACTS))


def judged(fact: Fact, results: Mapping[str, float]) -> str:
    """Return the results that stand beside a fact, each with the answer to whether it agrees."""
    answers = {True: '**agrees**', False: '**does not agree**', None: 'cannot be judged'}
    return '; '.join(f'{_of_set(key)}{shown(key, results)}, {answers[verdict(fact, key, results)]}'
                     for key in fact.results)


def verdict(fact: Fact, key: str, results: Mapping[str, float]) -> bool | None:
    """Return whether one of the results beside a fact agrees with it; None if it cannot be judged."""
    return fact.agrees(RESULTS[key].rounded(results[key]))


def decided(fact: Fact, sensitivity: Sensitivity, name: str) -> str:
    """Return the values that decide the results beside a fact, with their exponents."""
    parts = []
    for key in fact.results:
        values = sensitivity.deciding(name, 'speed' if key == 'fastest' else key)
        parts.append(_of_set(key) + ' and '.join(f'{value} ({written(number)})' for value, number in values.items()))
    return ', '.join(parts)


def exponent_table(sensitivity: Sensitivity, name: str) -> str:
    """Return the exponents of a configuration."""
    return table(('value', *(RESULTS[key].name for key in VARIED)), (
        (str(value), *(written(of_results[key]) for key in VARIED))
        for value, of_results in sensitivity.exponents(name).items()))


def disagreements(measured: Mapping[str, Measured]) -> str:
    """Return a line for each fact with which a result does not agree, and what follows for the turns."""
    lines = []
    for name, one in measured.items():
        for fact in FACTS:
            wrong = [f'{_of_set(key)}{shown(key, one.results)}' for key in fact.results
                     if verdict(fact, key, one.results) is False]
            if wrong:
                lines.append('- ' + prose(f'{name}, {fact.quantity}: {", ".join(wrong)}. {fact.text}'))
    return '\n'.join(lines) + '\n\n' + prose(f"""
A turn is a rate and a radius together. {turns_that_agree(measured)} The mantas of Fish et al. turn on much wider
circles than this robot in fresh water. Their size in these turns is not given in the abstract, so the radius cannot be
scaled with it. The radius of set 1 in fresh water is smaller than that of any published turn above: the robot almost
turns on the spot. The Strouhal number depends on its definition. The sources do not say in their abstracts which part
of the fin was measured.""")


def turns_that_agree(measured: Mapping[str, Measured]) -> str:
    """Return which turns agree with a published turn in both their rate and their radius, in a sentence."""
    turns = [(rate, radius) for rate, radius in itertools.pairwise(FACTS)
             if rate.quantity == 'yaw rate' and radius.quantity == 'turning radius']
    found = [f'set {number} of {name} with that of {rate.source.split(", abstract")[0].split(", introduction")[0]}'
             for name, one in measured.items() for number in '12' for rate, radius in turns
             if verdict(rate, f'rate {number}', one.results) and verdict(radius, f'radius {number}', one.results)]
    return f'In both, only these agree: {"; ".join(found)}.' if found else 'No turn agrees in both.'


def conclusions(measured: Mapping[str, Measured], sensitivity: Sensitivity) -> str:
    """Return what the exponents say, in words."""
    water, paper = sensitivity.exponents(FRESHWATER), sensitivity.exponents(MANTA)
    halved, doubled = (sensitivity.results[Variant(MANTA, CHAINS, factor)] for factor in FACTORS)
    return prose(f"""
In {FRESHWATER} the yaw rate varies with the quadratic damping of yaw to the power of
{written(water[DAMPING]['rate 1'])} in set 1 and {written(water[DAMPING]['rate 2'])} in set 2. The number of chains has
the exponents {written(water[CHAINS]['rate 1'])} and {written(water[CHAINS]['rate 2'])}: the turns do not depend on the
grid. Therefore the yaw damping is the first value to identify on a robot. In {MANTA} the turns are those of the grid.
With half the number of chains the yaw rates are {halved['rate 1']:.1f} and {halved['rate 2']:.1f}°/s, and with twice
the number they are {doubled['rate 1']:.1f} and {doubled['rate 2']:.1f}°/s (a negative rate turns to the right).
Whether they agree with a fact means nothing.

The cruise speed varies with the drag coefficient of the body along x to the power of {written(water[DRAG]['speed'])} in
{FRESHWATER} and {written(paper[DRAG]['speed'])} in {MANTA}. The thrust varies with the drag coefficient of the fins to
the power of {written(water[FIN_DRAG]['thrust'])} and {written(paper[FIN_DRAG]['thrust'])}, and with the density of the
water in the drag to the power of {written(water[DENSITY]['thrust'])} and {written(paper[DENSITY]['thrust'])}. The
density in {MANTA} is ten times that of water. {FRESHWATER} has the true density instead, and larger drag coefficients
of the fins and of the body. Thrust, Strouhal number and power are nearly the same in both, and both cruise speeds are
in the published range, so these facts do not determine the values of the model. The turns tell the two configurations
apart.""")


def recommendation(measured: Mapping[str, Measured]) -> str:
    """Return which configuration is for what."""
    paper, water = measured[MANTA].results, measured[FRESHWATER].results
    return prose(f"""
Use `config/{MANTA}` to reproduce the paper and its figures, and for straight swims up to an amplitude of 40°. Do not
use it for turns: its yaw rates of {shown('rate 1', paper)} and {shown('rate 2', paper)} are determined by the number of
chains. Above 40° the fins with 30 chains are unstable along their chords, which slows the robot down.

Use `config/{FRESHWATER}` for turns, for controllers, and as the first guess of an identification. It turns at
{shown('rate 1', water)} on {shown('radius 1', water)} and at {shown('rate 2', water)} on {shown('radius 2', water)},
and the number of chains does not change this. Its hydrodynamic values are those of plates and of an ellipsoid, and none
of them was measured on a robot. First identify the quadratic damping of yaw from steady turns, and the drag coefficient
of the body along x from the cruise.""")


def shown(key: str, results: Mapping[str, float]) -> str:
    """Return the magnitude of a result with its unit."""
    result = RESULTS[key]
    return f'{result.rounded(results[key]):.{result.digits}f} {result.unit}'.rstrip().replace(' °', '°')


def _of_set(key: str) -> str:
    return f'set {key[-1]}: ' if key[-1].isdigit() else ''
