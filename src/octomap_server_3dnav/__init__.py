"""From sweeps to a goal: octree, terrain classes, frontiers, navigation graph and path (thesis 5.5, 6.2.2)."""
