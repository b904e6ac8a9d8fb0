// octomap's OcTree with bulk operations: applied voxel sets, boxes, column runs, checked reading.
#pragma once

#include <octomap/OcTree.h>

#include <cstdint>
#include <string>
#include <vector>

#include "sweep_voxels.h"

namespace octree_binding {

enum State : std::uint8_t { kUnknown = 0, kFree = 1, kOccupied = 2 };

// A cube of one state: its lowest voxel and the number of voxels on an edge, a power of two. Small: maps have millions.
class Leaf {
 public:
  Leaf(const Voxel& corner, int size, bool occupied)
      : x_(corner.x), y_(corner.y), z_(corner.z), levels_(__builtin_ctz(size)), occupied_(occupied) {}
  Voxel corner() const { return {x_, y_, z_}; }
  int size() const { return 1 << levels_; }
  bool occupied() const { return occupied_; }

 private:
  std::int16_t x_, y_, z_;
  std::uint8_t levels_;
  bool occupied_;
};

struct ColumnRuns {
  Voxel origin{0, 0, 0};
  int nx = 0, ny = 0;
  std::vector<std::int64_t> start{0};
  std::vector<std::int16_t> z_lo, z_hi;
  std::vector<std::uint8_t> occupied;
};

class OccupancyTree : public octomap::OcTree {
 public:
  using octomap::OcTree::OcTree;

  void apply(const std::vector<VoxelBlock>& sorted_blocks);     // one hit or miss for every voxel of the set
  std::size_t occupy_unknown(const VoxelBox& box);              // one hit for every unknown voxel; their number
  void free_known(const VoxelBox& box);                         // as octomap_server's clear_bbx
  State state(const Voxel& v) const;
  // What overlaps the box as the fewest cubes of one state, whatever their probabilities, in octree order: in every column
  // from below to above.
  std::vector<Leaf> leaves(const VoxelBox& box) const;
  ColumnRuns column_runs(const VoxelBox& box) const;            // the smallest block that holds what is known in the box

  // The maximum likelihood tree of what lies in the box, pruned, as octomap's writeBinaryData would write it.
  std::string to_binary(const VoxelBox& box) const;
  std::string to_full() const;                                  // octomap's writeData
  void read_binary(const std::string& data);                    // into an empty tree; std::invalid_argument
  void read_full(const std::string& data);

  static std::size_t binary_nodes(const std::string& data);     // nodes in the data; std::invalid_argument
  static std::size_t full_nodes(const std::string& data);

 private:
  using Node = octomap::OcTreeNode;
  using Blocks = const VoxelBlock*;

  void create_root();
  void apply_blocks(Node* node, bool fresh, unsigned level, Blocks begin, Blocks end);
  void apply_bits(Node* node, bool fresh, const VoxelBlock& block, unsigned first, unsigned bits);
  bool is_settled(const Node* node, bool any_free, bool any_hit) const;
  Node* child_for_update(Node* parent, unsigned i, bool& fresh);
  void finish(Node* node);
  void free_known(Node* node, const Voxel& corner, int size, const VoxelBox& box);
  State collect(const Node* node, const Voxel& corner, int size, const VoxelBox& box, std::vector<Leaf>& out) const;
  unsigned write_binary(const Node* node, const Voxel& corner, int size, const VoxelBox& box, std::string& out) const;
};

}  // namespace octree_binding
