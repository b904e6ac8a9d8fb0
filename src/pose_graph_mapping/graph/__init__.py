"""Algorithms 1 and 2: vertices, edges, loop closures, optimisation."""
