"""Algorithm 3, lines 22-35: where to go next."""
