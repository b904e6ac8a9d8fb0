// From regions of voxel states to sorted vertical runs, column by column.
#pragma once

#include <cstdint>
#include <vector>

#include "voxel_states.h"

namespace octree_binding {

struct ColumnRuns {
  Voxel origin{0, 0, 0};
  int nx = 0, ny = 0;
  std::vector<std::int64_t> start{0};
  std::vector<std::int16_t> z_lo, z_hi;
  std::vector<std::uint8_t> occupied;
};

// A cube of known voxels: whole regions side by side, each the same.
struct StateCube {
  Voxel corner;
  int size;  // a multiple of kRegionEdge
  const StateRegion* region;
};

// The runs of what the cubes hold in the box, as the smallest block of columns; std::invalid_argument for more than 2^28 columns.
ColumnRuns scan_columns(const std::vector<StateCube>& cubes, const VoxelBox& box);

}  // namespace octree_binding
