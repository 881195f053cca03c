"""Real nodes in processes of their own, for tests and measurements."""
