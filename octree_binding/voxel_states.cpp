#include "voxel_states.h"

#include <algorithm>

namespace octree_binding {

static_assert(kKeyOffset % kRegionEdge == 0, "regions are nodes of the octree");

const StateRegion& StateRegion::uniform(State state) {
  static const std::array<StateRegion, 3> regions = [] {
    std::array<StateRegion, 3> made;
    made[kFree].known.fill(~Word{0});
    made[kOccupied].known.fill(~Word{0});
    made[kOccupied].occupied.fill(~Word{0});
    return made;
  }();
  return regions[state];
}

std::uint32_t VoxelStates::position(const Voxel& v) {
  const auto region = [](int index) { return static_cast<std::uint32_t>(index + kKeyOffset) / kRegionEdge; };
  return region(v.x) << 20 | region(v.y) << 10 | region(v.z);
}

Voxel VoxelStates::corner(std::uint32_t position) {
  const auto index = [](std::uint32_t region) { return static_cast<int>(region & 1023) * kRegionEdge - kKeyOffset; };
  return {index(position >> 20), index(position >> 10), index(position)};
}

StateRegion* VoxelStates::find(const Voxel& v) {
  const auto found = regions_.find(position(v));
  return found == regions_.end() ? nullptr : &found->second;
}

const StateRegion* VoxelStates::find(const Voxel& v) const { return const_cast<VoxelStates*>(this)->find(v); }

StateRegion& VoxelStates::make(const Voxel& v, State state) {
  const auto [place, is_new] = regions_.try_emplace(position(v));
  if (is_new && state != kUnknown) place->second = StateRegion::uniform(state);
  return place->second;
}

void VoxelStates::free_known(const VoxelBox& box) {
  for (auto& [position, region] : regions_) {
    const Voxel low = corner(position);
    const int x_end = std::min(box.hi.x, low.x + kRegionEdge - 1), y_end = std::min(box.hi.y, low.y + kRegionEdge - 1);
    const StateRegion::Word layers = layers_in(box, low.z);
    for (int x = std::max(box.lo.x, low.x); layers && x <= x_end; ++x) {
      for (int y = std::max(box.lo.y, low.y); y <= y_end; ++y) region.occupied[StateRegion::word_of({x, y, 0})] &= ~layers;
    }
  }
}

}  // namespace octree_binding
