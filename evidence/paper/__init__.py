"""The paper's results beside the simulator's: `python -m evidence.paper` writes docs/paper.md."""
