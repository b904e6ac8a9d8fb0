// From the points of a sweep to the voxels that it saw free and occupied.
#pragma once

#include <cstddef>

#include "voxel_blocks.h"

namespace octree_binding {

struct SweepRules {
  double resolution;
  std::size_t met;   // so many points, the first ones, are hits; the others are where beams that met nothing end: they only carve
  double max_range;  // metres; points beyond it only carve, up to it
  double grazing;    // metres before a hit in which the layer of the surface itself is not carved; 0 turns that off
  VoxelBox bounds;   // nothing outside is touched
};

struct SweepVoxels {
  std::vector<VoxelBlock> blocks;  // `free` and `hit` are disjoint; none is empty; in octree order
  std::size_t free = 0;            // voxels
  std::size_t occupied = 0;        // voxels
  std::size_t dropped = 0;         // points or origins that are not finite
};

// points, origins: n triples of metres. One ray is cast for every end voxel, that of its first point; occupied wins over free.
SweepVoxels trace_sweep(const float* points, const float* origins, std::size_t n, const SweepRules& rules);

}  // namespace octree_binding
