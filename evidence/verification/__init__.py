"""The physics, verified claim by claim: `python -m evidence.verification` writes docs/verification.md."""
