// The voxels of one block by value: what sweeps add up to in it, outside the tree.
#pragma once

#include <array>
#include <cstdint>

#include "voxel_blocks.h"

namespace octree_binding {

// `bits` (1, 8, 64 or 512) bits from `first` on: an octant of a block, of an octant, ...: is there one, are there all?
bool any(const BlockBits& block, unsigned first, unsigned bits);
bool all(const BlockBits& block, unsigned first, unsigned bits);

struct UpdateRule {  // log-odds
  float hit, miss, through, min, min_through, max;  // `through`: a miss of a voxel amid what was seen, down to `min_through`
};

struct BlockValues {
  BlockBits known{};
  std::array<float, 512> log_odds{};  // in octree order; 0 where unknown

  void set(unsigned first, unsigned bits, float value);
  void update(const VoxelBlock& seen, const UpdateRule& rule);  // as octomap's updateNodeLogOdds, voxel by voxel
  bool is_uniform(unsigned first, unsigned bits) const;         // all known, all of one value
  bool equals(const BlockValues& other, unsigned first, unsigned bits) const;
};

}  // namespace octree_binding
