"""How long and under what the simulator lives: measured facts, and the page docs/reliability.md."""
