"""Algorithm 3, lines 2-21: from column runs to classes and a navigation graph."""
