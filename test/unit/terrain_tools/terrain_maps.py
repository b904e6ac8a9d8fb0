"""Small maps for the tests of ./classify_map: literal storeys as text, octrees of dense grids, and files of both."""

import numpy as np

from octomap_server_3dnav.octree.column_runs import VoxelState
from octomap_server_3dnav.octree.octree import OctreeMap

RESOLUTION = 0.1
AIR = 14  # layers of free space above a floor: more than the robot is high
UNKNOWN, FREE, OCCUPIED = (np.uint8(s) for s in VoxelState)


def octree_of(states, origin=(0, 0, 0), resolution=RESOLUTION):
    """The octree of an (nx, ny, nz) grid of VoxelState values whose element [0, 0, 0] is the voxel of index `origin`."""
    octree = OctreeMap(resolution)
    occupied = _centers(states, OCCUPIED, origin, resolution)
    octree.insert_sweep(occupied, occupied)  # beams of no length
    # Beams from every free voxel to its pair, each the only one that ends there, free the voxels that they start in.
    free = _centers(states, FREE, origin, resolution)
    away = np.where(np.floor(free[:, 2] / resolution) % 2 == 1, -100, 100)
    octree.insert_sweep(free + np.float32([0, 0, 1]) * away[:, None].astype(np.float32), free, resolution)
    return octree


def _centers(states, state, origin, resolution):
    return ((np.argwhere(states == state) + origin + 0.5) * resolution).astype(np.float32)


def floor(size=40, walls=()):
    """A level floor in layer 0 with air above and walls all around; `walls` are (x slice, y slice) of more of them."""
    states = np.full((size, size, AIR + 1), FREE)
    states[:, :, 0] = OCCUPIED
    for wall in (np.s_[0], np.s_[-1], np.s_[:, 0], np.s_[:, -1], *walls):
        states[wall] = OCCUPIED
    return states


def two_storeys():
    """Floors at 0 and 2 m over 10 x 7 m; a ramp of 20 degrees joins them along the side y < 3 m, up to a landing of 2.5 m."""
    states = np.full((100, 70, 20 + AIR), FREE)
    states[:, :, 0] = OCCUPIED
    states[:, 30:, 20] = OCCUPIED
    states[75:, :30, 20] = OCCUPIED
    for ix in range(20, 75):
        level = round((ix - 20) * 20 / 55)
        states[ix, :30, :level], states[ix, :30, level] = UNKNOWN, OCCUPIED
    for wall in (np.s_[0], np.s_[-1], np.s_[:, 0], np.s_[:, -1]):
        states[wall] = OCCUPIED
    return states


def octree_file(path, states, origin=(0, 0, 0), resolution=RESOLUTION):
    """A .bt or .ot file of a grid; its path as text."""
    octree = octree_of(states, origin, resolution)
    (octree.write_bt if path.suffix == ".bt" else octree.write_ot)(path)
    return str(path)


def cloud_file(path, points, **fields):
    """A .ply file of points (N, 3), little-endian floats, with more fields (N,) of given names; its path as text."""
    columns = np.column_stack([points, *fields.values()]).astype("<f4")
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(columns)}"]
    header += [f"property float {name}" for name in ("x", "y", "z", *fields)] + ["end_header\n"]
    path.write_bytes("\n".join(header).encode("ascii") + columns.tobytes())
    return str(path)
