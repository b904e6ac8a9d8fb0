"""Ways over a classified terrain: path search, planner, passages."""
