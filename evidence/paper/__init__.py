"""Comparison of the paper's results with the simulator's: `python -m evidence.paper` writes docs/paper.md."""
