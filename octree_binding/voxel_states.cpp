#include "voxel_states.h"

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

}  // namespace octree_binding
