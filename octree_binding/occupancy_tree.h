// octomap's OcTree with bulk operations: applied voxel sets, boxes, column runs, checked reading.
// Change it by what is declared here only: the states of all voxels are kept beside the nodes.
#pragma once

#include <octomap/OcTree.h>

#include <cstdint>
#include <string>
#include <vector>

#include "column_scan.h"
#include "sweep_voxels.h"
#include "voxel_states.h"

namespace octree_binding {

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

class OccupancyTree : public octomap::OcTree {
 public:
  using octomap::OcTree::OcTree;

  void apply(const std::vector<VoxelBlock>& sorted_blocks);     // one hit or miss for every voxel of the set
  std::size_t occupy_unknown(const VoxelBox& box);              // one hit for every unknown voxel; their number
  void free_known(const VoxelBox& box);                         // as octomap_server's clear_bbx
  void clear() override;
  State state(const Voxel& v) const;
  // What overlaps the box as the fewest cubes of one state, whatever their probabilities, in octree order: in every column
  // from below to above.
  std::vector<Leaf> leaves(const VoxelBox& box) const;
  ColumnRuns column_runs(const VoxelBox& box) const;            // the smallest block that holds what is known in the box
  std::size_t states_bytes() const { return states_.memory_bytes(); }

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
  void apply_blocks(Node* node, bool fresh, const Voxel& corner, unsigned level, Blocks begin, Blocks end);
  void apply_bits(Node* node, bool fresh, const Voxel& corner, const VoxelBlock& block, unsigned first, unsigned bits);
  void update_leaf(Node* leaf, bool fresh, const Voxel& corner, int size, float log_odds);
  bool is_settled(const Node* node, bool any_free, bool any_hit) const;
  Node* child_for_update(Node* parent, unsigned i, bool& fresh);
  void finish(Node* node);
  void free_known(Node* node, const Voxel& corner, int size, const VoxelBox& box);
  StateRegion* region_of(const Node* node, const Voxel& corner, bool fresh);
  void copy_states(const Node* node, const Voxel& corner, int size, StateRegion* region);
  void add_cubes(const Node* node, const Voxel& corner, int size, const VoxelBox& box, std::vector<StateCube>& out) const;
  State collect(const Node* node, const Voxel& corner, int size, const VoxelBox& box, std::vector<Leaf>& out) const;
  unsigned write_binary(const Node* node, const Voxel& corner, int size, const VoxelBox& box, std::string& out) const;

  // A node of kRegionEdge voxels with children has a region; whatever has none is unknown or part of a larger leaf.
  VoxelStates states_;
  StateRegion* region_ = nullptr;  // that of the node which apply() is in
};

}  // namespace octree_binding
