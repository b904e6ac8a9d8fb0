// octomap's OcTree with bulk operations: applied and replaced voxel sets, boxes, column runs, checked reading.
// Change it by what is declared here only: the states of all voxels are kept beside the nodes.
#pragma once

#include <octomap/OcTree.h>

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "block_values.h"
#include "column_scan.h"
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

  using Blocks = std::vector<VoxelBlock>;                       // in the octree's order

  void set_prob_through(double probability, double least) {
    through_log_ = octomap::logodds(probability);
    min_through_ = octomap::logodds(least);
  }

  void apply(const Blocks& blocks);                             // one hit or miss for every voxel of the set
  // Leaves in all blocks that `changed` hold what applying `all`, one after the other, to an empty tree leaves there.
  void redraw(const std::vector<const Blocks*>& changed, const std::vector<const Blocks*>& all);
  Blocks known(const VoxelBox& box) const;                      // one miss for every known voxel
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
  using Order = std::uint64_t;  // of a block
  using Change = std::function<void(Order, BlockValues&)>;

  UpdateRule rule() const { return {prob_hit_log, prob_miss_log, through_log_, clamping_thres_min, min_through_, clamping_thres_max}; }
  State state_of(const Node* leaf) const { return isNodeOccupied(leaf) ? kOccupied : kFree; }
  void create_root();
  void change(const std::vector<Order>& sorted, const Change& f);
  bool change(Node* node, bool fresh, const Voxel& corner, unsigned level, const Order* begin, const Order* end, const Change& f);
  bool change_block(Node* node, bool fresh, const Voxel& corner, Order order, const Change& f);
  void read(const Node* node, unsigned first, unsigned bits, BlockValues& out) const;
  void draw(Node* node, bool fresh, const Voxel& corner, const BlockValues& before, const BlockValues& after, unsigned first, unsigned bits);
  Node* child_of(Node* parent, unsigned i, bool& fresh);
  void remove_child(Node* parent, unsigned i);
  void collapse(Node* node);
  void finish(Node* node);
  StateRegion* region_of(const Node* node, const Voxel& corner, bool fresh);
  void copy_states(const Node* node, const Voxel& corner, int size, StateRegion* region);
  void add_cubes(const Node* node, const Voxel& corner, int size, const VoxelBox& box, std::vector<StateCube>& out) const;
  State collect(const Node* node, const Voxel& corner, int size, const VoxelBox& box, std::vector<Leaf>& out) const;
  unsigned write_binary(const Node* node, const Voxel& corner, int size, const VoxelBox& box, std::string& out) const;

  // A node of kRegionEdge voxels with children has a region; whatever has none is unknown or part of a larger leaf.
  VoxelStates states_;
  float through_log_ = prob_miss_log, min_through_ = clamping_thres_min;
  StateRegion* region_ = nullptr;  // that of the node which change() is in
};

}  // namespace octree_binding
