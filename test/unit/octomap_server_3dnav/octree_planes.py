"""Planes of hits in octrees of tests, as the blind spot under the robot is filled, and boxes that are cleared."""

from numpy.typing import ArrayLike

from octomap_server_3dnav.octree.octree import OctreeMap


def insert_plane(octree: OctreeMap, center_xyz: ArrayLike, half_size: float, up: ArrayLike = (0.0, 0.0, 1.0)) -> int:
    """Hits the unknown voxels of a plane, and says how many these were."""
    middles = octree.unknown_on_plane(center_xyz, half_size, up)
    return octree.insert_sweep(middles, middles).occupied


def clear_box(octree: OctreeMap, lo: ArrayLike, hi: ArrayLike) -> None:
    """Makes all known voxels of a box free."""
    for voxels in octree.trace_clearing(lo, hi):
        octree.insert(voxels)
