"""Published facts, each with its source, and whether a result agrees with it."""

from __future__ import annotations

import dataclasses

TOLERANCE = 0.2
"""Relative difference up to which a result agrees with a single published number.

It is the change of a value in docs/paper.md, "Assumed values": what is assumed there is not known better.
"""
BODY_LENGTH = 0.8
"""Length of the body of the robot [m]: that of the ellipsoid whose added mass config/freshwater.yaml has."""
OXYGEN = 14.0
"""Energy that an animal gains from oxygen [J/mg], rounded."""
GRAVITY = 9.81
"""[m/s^2]"""


@dataclasses.dataclass(frozen=True)
class Fact:
    """A published fact about a quantity, in the unit of the results that stand beside it."""

    quantity: str
    text: str
    source: str
    results: tuple[str, ...]
    """Keys of `measurements.RESULTS`."""
    low: float | None = None
    """Smallest value that agrees; None if it is another quantity, so that the comparison judges nothing."""
    high: float | None = None

    def agrees(self, value: float) -> bool | None:
        """Return whether the magnitude of a result, as it is printed, agrees, or None if it cannot be judged."""
        if self.low is None or self.high is None:
            return None
        return self.low <= abs(value) <= self.high


def about(value: float) -> dict[str, float]:
    """Return the bounds of a single published number."""
    return {'low': (1.0 - TOLERANCE) * value, 'high': (1.0 + TOLERANCE) * value}


PROTOTYPE = ('*Asymmetrical Oscillating Morphology Hydrodynamic Performance of a Novel Bionic Pectoral Fin*, '
             'J. Mar. Sci. Eng. 2022, 10, 289, abstract')
COURSE = ('*Course Control of a Manta Robot Based on Amplitude and Phase Differences*, J. Mar. Sci. Eng. 2022, 10, '
          '285, introduction')
FISH = 'Fish et al., J. Exp. Biol. 2018, 221, jeb166041, abstract'
RATES, RADII = ('rate 1', 'rate 2'), ('radius 1', 'radius 2')
THRUST, CRUISE_RANGE, STINGRAYS, FOILS = 20.0, (0.25, 0.47), (0.27, 0.34), (0.25, 0.35)
"""[N], [m/s], Strouhal numbers."""
MANTA_RATE, MANTA_RADIUS = 67.0, 0.38 * BODY_LENGTH
"""[degrees/s], [m]"""
FISH_RATE, FISH_RADIUS = (42.65, 16.66), (2.05, 1.26)
"""Mean and standard deviation of the highest fifth of turning rates [degrees/s] and of the smallest of radii [m]."""
AQUARAY_SPEED = 1.8 / 3.6
"""[m/s]"""
FISH_COST = 110.0e-3 * OXYGEN / GRAVITY
"""Cost of transport of a fish of 30 cm, from 110 mg of oxygen per kilogram and kilometer."""

FACTS = (
    Fact('thrust', f'A prototype of the same family, which flaps at 0.1 to 0.6 Hz, produces at most {THRUST:g} N.',
         PROTOTYPE, ('thrust',), **about(THRUST)),
    Fact('cruise speed', f'Mantas forage at {CRUISE_RANGE[0]:g} to {CRUISE_RANGE[1]:g} m/s.',
         'Qu et al., J. Mar. Sci. Eng. 2024, 12, 292, Section 1.1; the same range in J. Mar. Sci. Eng. 2023, 11, 2173, '
         'introduction', ('speed',), *CRUISE_RANGE),
    Fact('greatest speed', 'AquaRay, a robotic manta of 0.96 m width and about 10 kg, swims at most at '
         f'{3.6 * AQUARAY_SPEED:g} km/h = {AQUARAY_SPEED:g} m/s.', 'Festo, AquaRay, technical data, 2007',
         ('fastest',), **about(AQUARAY_SPEED)),
    Fact('Strouhal number', f'Simulated stingrays swim with {STINGRAYS[0]:g} (fast) and {STINGRAYS[1]:g} (slow).',
         'Bottom et al., J. Fluid Mech. 2016 (online, 5 January), *Hydrodynamics of swimming in stingrays*, abstract',
         ('strouhal',), *STINGRAYS),
    Fact('Strouhal number', f'Flapping foils are most efficient between {FOILS[0]:g} and {FOILS[1]:g}.',
         'Eloy, *Optimal Strouhal number for swimming animals*, arXiv:1102.0223, abstract', ('strouhal',), *FOILS),
    Fact('yaw rate', f'Mantas turn at {MANTA_RATE:g}°/s.', COURSE, RATES, **about(MANTA_RATE)),
    Fact('turning radius', f'In this turn the radius is 0.38 body lengths, here {MANTA_RADIUS:.2f} m.', COURSE, RADII,
         **about(MANTA_RADIUS)),
    Fact('yaw rate', 'Mantas in slow, steady turns reach {:g} ± {:g}°/s (highest fifth).'.format(*FISH_RATE), FISH,
         RATES, FISH_RATE[0] - FISH_RATE[1], FISH_RATE[0] + FISH_RATE[1]),
    Fact('turning radius', 'The radii of these turns are {:g} ± {:g} m (smallest fifth).'.format(*FISH_RADIUS), FISH,
         RADII, FISH_RADIUS[0] - FISH_RADIUS[1], FISH_RADIUS[0] + FISH_RADIUS[1]),
    Fact('cost of transport', 'A fish of 30 cm needs at least 110 mg of oxygen per kilogram and kilometer, which is '
         f'about {FISH_COST:.2f}. This is metabolic energy, and the fish is much smaller.',
         'Wakeman and Wohlschlag, Fish. Res. 1982, 1, 117-127, abstract', ('cost',)),
    Fact('power', 'Tunabot, a robotic tuna of 0.255 m, swims 9.1 km at 0.4 m/s with 10 W h, which is 1.6 W. This is '
         'electric power, and the robot is much smaller.', 'Zhu et al., Sci. Robot. 2019, 4, eaax4615, abstract',
         ('power',)),
)
