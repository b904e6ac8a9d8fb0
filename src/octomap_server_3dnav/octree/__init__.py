"""The tree: insertion of sweeps, column runs, and the moments of the hits by voxel."""
