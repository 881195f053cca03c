"""What is verified: the themes of docs/verification.md and the sections of each, in the page's order."""

from __future__ import annotations

from evidence.verification import (
    beam,
    coupling,
    fresh_water,
    laws,
    references,
    refinement,
    short_waves,
    stability,
    thrown,
)
from evidence.verification.claims import Check

THEMES: dict[str, tuple[Check, ...]] = {
    'Laws': laws.CHECKS + thrown.CHECKS,
    'References': references.CHECKS + beam.CHECKS,
    'Refinement': refinement.CHECKS + short_waves.CHECKS + (fresh_water.how_many_chains,),
    'Coupling': coupling.CHECKS,
    'Largest stable step': stability.CHECKS,
    'Fresh water': (fresh_water.fresh_water,),
}
