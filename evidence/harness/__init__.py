"""Real nodes, each in its own process, for tests and measurements."""
