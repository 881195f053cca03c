"""Verification of the physics, claim by claim: `python -m evidence.verification` writes docs/verification.md."""
