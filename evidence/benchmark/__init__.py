"""The speed beside that of others: `python -m evidence.benchmark`."""
