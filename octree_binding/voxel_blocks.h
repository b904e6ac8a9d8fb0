// Sets of voxels as blocks of 8 x 8 x 8 bits: what a sweep saw, before it is applied to the tree in one go.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace octree_binding {

// A voxel by its signed index: index i spans [i * resolution, (i + 1) * resolution). Octomap's key is the index + 32768.
struct Voxel {
  int x, y, z;
  int operator[](int axis) const { return axis == 0 ? x : axis == 1 ? y : z; }
  int& operator[](int axis) { return axis == 0 ? x : axis == 1 ? y : z; }
  bool operator==(const Voxel& other) const { return x == other.x && y == other.y && z == other.z; }
};

constexpr int kKeyOffset = 32768;  // octomap's trees are 16 levels deep: indices -32768 .. 32767

// All voxels with lo <= index <= hi on each axis.
struct VoxelBox {
  Voxel lo{-kKeyOffset, -kKeyOffset, -kKeyOffset};
  Voxel hi{kKeyOffset - 1, kKeyOffset - 1, kKeyOffset - 1};
  bool contains(const Voxel& v) const {
    return v.x >= lo.x && v.x <= hi.x && v.y >= lo.y && v.y <= hi.y && v.z >= lo.z && v.z <= hi.z;
  }
};

// 512 bits in octree order, so that every octant is a contiguous range of bits: 8 words of 4^3 voxels, bytes of 2^3.
using BlockBits = std::array<std::uint64_t, 8>;

inline std::size_t count(const BlockBits& bits) {
  std::size_t sum = 0;
  for (std::uint64_t word : bits) sum += __builtin_popcountll(word);
  return sum;
}

struct VoxelBlock {
  std::uint64_t order = 0;  // position of the block along the octree's own (Morton) order
  BlockBits free{};
  BlockBits hit{};
  BlockBits through{};  // those of `free` amid what was seen, too: all six voxels beside are free or hit
};

// The blocks that were touched, found by a hash of their position.
class VoxelBlocks {
 public:
  VoxelBlocks() : slots_(1024, kNone) {}

  VoxelBlock& at(const Voxel& v);
  const VoxelBlock* find(const Voxel& v) const;
  bool is_hit(const Voxel& v) const;

  // The bit of a voxel within its block.
  static unsigned bit(const Voxel& v) { return bit_along(v, 0) | bit_along(v, 1) | bit_along(v, 2); }
  static unsigned bit_along(const Voxel& v, int axis) {  // the part of it that an axis tells
    constexpr std::uint16_t kSpread[8] = {0, 1, 8, 9, 64, 65, 72, 73};
    return kSpread[v[axis] & 7] << axis;
  }
  static bool test(const BlockBits& bits, unsigned bit) { return bits[bit >> 6] >> (bit & 63) & 1; }
  static void set(BlockBits& bits, unsigned bit) { bits[bit >> 6] |= std::uint64_t{1} << (bit & 63); }

  void add(const VoxelBlocks& other);  // what is `free` or `hit` there is so here, too
  void mark_through();                 // sets `through` of all blocks
  // The blocks that hold something, in the octree's order; nothing is left.
  std::vector<VoxelBlock> take_sorted();

 private:
  static constexpr std::uint32_t kNone = 0xffffffff;
  static std::uint64_t position(const Voxel& v);
  VoxelBlock& at(std::uint64_t wanted);
  const VoxelBlock* beside(std::uint64_t position, int axis, int way) const;
  std::size_t slot_of(std::uint64_t position) const;
  void grow();

  std::vector<VoxelBlock> blocks_;
  std::vector<std::uint64_t> positions_;  // of blocks_, in the same order
  std::vector<std::uint32_t> slots_;      // open addressing: indices into blocks_
  std::uint64_t last_position_ = ~std::uint64_t{0};
  std::uint32_t last_ = kNone;
};

}  // namespace octree_binding
