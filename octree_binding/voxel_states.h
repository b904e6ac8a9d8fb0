// Two bits for every voxel beside the octree: known, occupied. Words run along z, so that columns are read without the tree.
#pragma once

#include <array>
#include <cstdint>
#include <unordered_map>

#include "voxel_blocks.h"

namespace octree_binding {

enum State : std::uint8_t { kUnknown = 0, kFree = 1, kOccupied = 2 };

constexpr int kRegionEdge = 64;  // one bit of a word for every layer

// The states of 64^3 voxels: column (x, y) is word x * 64 + y, layer z its bit z; `occupied` has no bit that `known` has not.
struct StateRegion {
  using Word = std::uint64_t;
  using Words = std::array<Word, kRegionEdge * kRegionEdge>;

  static int word_of(const Voxel& v) { return (v.x & (kRegionEdge - 1)) * kRegionEdge + (v.y & (kRegionEdge - 1)); }
  static const StateRegion& uniform(State state);  // 64^3 voxels of one state

  // The cube of `edge` voxels whose lowest is `corner`, all of it in the region, is of one state.
  void fill(const Voxel& corner, int edge, State state) {
    const Word layers = (edge == kRegionEdge ? ~Word{0} : (Word{1} << edge) - 1) << (corner.z & (kRegionEdge - 1));
    for (int x = 0; x < edge; ++x) {
      for (int word = word_of(corner) + x * kRegionEdge, end = word + edge; word < end; ++word) {
        known[word] = state == kUnknown ? known[word] & ~layers : known[word] | layers;
        occupied[word] = state == kOccupied ? occupied[word] | layers : occupied[word] & ~layers;
      }
    }
  }

  Words known{}, occupied{};
};

// The layers of a box in the region that begins at layer z.
inline StateRegion::Word layers_in(const VoxelBox& box, int z) {
  const int lo = box.lo.z <= z ? 0 : box.lo.z - z, hi = box.hi.z >= z + kRegionEdge - 1 ? kRegionEdge - 1 : box.hi.z - z;
  if (lo > hi) return 0;
  return ~StateRegion::Word{0} >> (kRegionEdge - 1 - (hi - lo)) << lo;
}

// The regions of a map, found by the position of any of their voxels.
class VoxelStates {
 public:
  StateRegion* find(const Voxel& v);
  const StateRegion* find(const Voxel& v) const;
  StateRegion& make(const Voxel& v, State state);  // the region of v, of one state if it is new
  void erase(const Voxel& v) { regions_.erase(position(v)); }
  void clear() { regions_.clear(); }
  std::size_t memory_bytes() const { return regions_.size() * sizeof(StateRegion); }

 private:
  static std::uint32_t position(const Voxel& v);

  std::unordered_map<std::uint32_t, StateRegion> regions_;
};

}  // namespace octree_binding
