"""The themes of docs/verification.md and the sections of each, in the order of the page."""

from __future__ import annotations

from evidence.verification import (
    beam,
    body_in_water,
    chordwise_instability,
    coupling,
    fresh_water,
    laws,
    references,
    refinement,
    stability,
    thrown,
    turns,
    twist,
)
from evidence.verification.claims import Check

THEMES: dict[str, tuple[Check, ...]] = {
    'Laws': laws.CHECKS + thrown.CHECKS,
    'References': references.CHECKS + beam.CHECKS + twist.CHECKS + body_in_water.CHECKS,
    'Refinement': refinement.CHECKS + chordwise_instability.CHECKS + (fresh_water.how_many_chains,),
    'Coupling': coupling.CHECKS,
    'Largest stable step': stability.CHECKS,
    'Fresh water': (fresh_water.fresh_water,) + turns.CHECKS,
}
