#include "occupancy_tree.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <sstream>
#include <stdexcept>

namespace octree_binding {

namespace {

constexpr int kTreeSize = 2 * kKeyOffset;
constexpr Voxel kTreeCorner{-kKeyOffset, -kKeyOffset, -kKeyOffset};
constexpr unsigned kBlockLevel = 13;   // a node of this depth is a block of 8^3 voxels
constexpr unsigned kRegionLevel = 10;  // and one of this depth a region of states
static_assert(kTreeSize >> kRegionLevel == kRegionEdge);

Voxel child_corner(const Voxel& corner, int half, unsigned i) {
  return {corner.x + (i & 1 ? half : 0), corner.y + (i & 2 ? half : 0), corner.z + (i & 4 ? half : 0)};
}

bool disjoint(const Voxel& corner, int size, const VoxelBox& box) {
  for (int axis = 0; axis < 3; ++axis) {
    if (corner[axis] > box.hi[axis] || corner[axis] + size - 1 < box.lo[axis]) return true;
  }
  return false;
}

bool inside(const Voxel& corner, int size, const VoxelBox& box) {
  return box.contains(corner) && box.contains({corner.x + size - 1, corner.y + size - 1, corner.z + size - 1});
}

int edge_of(unsigned bits) { return bits == 512 ? 8 : bits == 64 ? 4 : bits == 8 ? 2 : 1; }

}  // namespace

// ---- changing the tree

void OccupancyTree::clear() {
  OcTree::clear();
  states_.clear();
}

void OccupancyTree::create_root() {
  if (root) return;
  root = new Node();
  ++tree_size;
}

void OccupancyTree::apply(const Blocks& blocks) {
  std::vector<Order> orders;
  for (const VoxelBlock& block : blocks) orders.push_back(block.order);
  auto next = blocks.begin();
  change(orders, [&, rule = rule()](Order, BlockValues& values) { values.update(*next++, rule); });
}

void OccupancyTree::redraw(const std::vector<const Blocks*>& changed, const std::vector<const Blocks*>& all) {
  std::vector<Order> orders;
  for (const Blocks* blocks : changed) {
    for (const VoxelBlock& block : *blocks) orders.push_back(block.order);
  }
  std::sort(orders.begin(), orders.end());
  orders.erase(std::unique(orders.begin(), orders.end()), orders.end());
  std::vector<std::size_t> next(all.size(), 0);
  change(orders, [&, rule = rule()](Order order, BlockValues& values) {
    values = BlockValues();
    for (std::size_t i = 0; i < all.size(); ++i) {
      const Blocks& blocks = *all[i];
      while (next[i] < blocks.size() && blocks[next[i]].order < order) ++next[i];
      if (next[i] < blocks.size() && blocks[next[i]].order == order) values.update(blocks[next[i]], rule);
    }
  });
}

// Puts what f makes of them in place of the blocks.
void OccupancyTree::change(const std::vector<Order>& sorted, const Change& f) {
  if (sorted.empty()) return;
  const bool fresh = root == nullptr;
  create_root();
  if (!change(root, fresh, kTreeCorner, 0, sorted.data(), sorted.data() + sorted.size(), f)) clear();
  size_changed = true;
}

// The blocks below a node; false when nothing is left below it, which is then for the caller to remove. `fresh`: the node was
// just made and has no value yet.
bool OccupancyTree::change(Node* node, bool fresh, const Voxel& corner, unsigned level, const Order* begin, const Order* end, const Change& f) {
  if (level == kBlockLevel) return change_block(node, fresh, corner, *begin, f);
  if (level == kRegionLevel) region_ = region_of(node, corner, fresh);
  if (!fresh && !nodeHasChildren(node)) expandNode(node);
  const unsigned shift = 3 * (kBlockLevel - 1 - level);
  bool emptied[8] = {};
  while (begin != end) {
    const unsigned i = *begin >> shift & 7;
    const Order* next = std::find_if(begin, end, [=](Order order) { return (order >> shift & 7) != i; });
    bool child_fresh;
    Node* child = child_of(node, i, child_fresh);
    emptied[i] = !change(child, child_fresh, child_corner(corner, kTreeSize >> (level + 1), i), level + 1, begin, next, f);
    begin = next;
  }
  bool any_left = false;
  for (unsigned i = 0; i < 8; ++i) any_left |= !emptied[i] && nodeChildExists(node, i);
  if (!any_left && level == kRegionLevel) states_.erase(corner);
  if (!any_left) return false;
  for (unsigned i = 0; i < 8; ++i) {
    if (emptied[i]) remove_child(node, i);
  }
  finish(node);
  return true;
}

bool OccupancyTree::change_block(Node* node, bool fresh, const Voxel& corner, Order order, const Change& f) {
  BlockValues before;
  if (!fresh) read(node, 0, 512, before);
  BlockValues after = before;
  f(order, after);
  const bool any_left = any(after.known, 0, 512);
  if (any_left) {
    draw(node, fresh, corner, before, after, 0, 512);
  } else {
    region_->fill(corner, edge_of(512), kUnknown);
  }
  return any_left;
}

void OccupancyTree::read(const Node* node, unsigned first, unsigned bits, BlockValues& out) const {
  if (!nodeHasChildren(node)) return out.set(first, bits, node->getLogOdds());
  for (unsigned i = 0; i < 8; ++i) {
    if (nodeChildExists(node, i)) read(getNodeChild(node, i), first + i * bits / 8, bits / 8, out);
  }
}

// Makes of a node that is as `before` says one that is as `after` says, of whose voxels some are known.
void OccupancyTree::draw(Node* node, bool fresh, const Voxel& corner, const BlockValues& before, const BlockValues& after, unsigned first, unsigned bits) {
  if (!fresh && after.equals(before, first, bits)) return;
  const int size = edge_of(bits);
  if (after.is_uniform(first, bits)) {
    collapse(node);
    node->setLogOdds(after.log_odds[first]);
    return region_->fill(corner, size, state_of(node));
  }
  if (!fresh && !nodeHasChildren(node)) expandNode(node);
  for (unsigned i = 0; i < 8; ++i) {
    const unsigned part = first + i * bits / 8;
    const Voxel part_corner = child_corner(corner, size / 2, i);
    if (any(after.known, part, bits / 8)) {
      bool child_fresh;
      Node* child = child_of(node, i, child_fresh);
      draw(child, child_fresh, part_corner, before, after, part, bits / 8);
    } else if (nodeChildExists(node, i)) {
      remove_child(node, i);
      region_->fill(part_corner, size / 2, kUnknown);
    }
  }
  node->updateOccupancyChildren();
}

OccupancyTree::Node* OccupancyTree::child_of(Node* parent, unsigned i, bool& fresh) {
  fresh = !nodeChildExists(parent, i);
  return fresh ? createNodeChild(parent, i) : getNodeChild(parent, i);
}

void OccupancyTree::remove_child(Node* parent, unsigned i) {
  collapse(getNodeChild(parent, i));
  deleteNodeChild(parent, i);
}

// Makes a node a leaf of whatever value: octomap takes away children only where all eight are alike.
void OccupancyTree::collapse(Node* node) {
  if (!nodeHasChildren(node)) return;
  for (unsigned i = 0; i < 8; ++i) {
    bool fresh;
    Node* child = child_of(node, i, fresh);
    collapse(child);
    child->setLogOdds(0);
  }
  pruneNode(node);
}

void OccupancyTree::finish(Node* node) {
  if (!pruneNode(node)) node->updateOccupancyChildren();
}

// The states of a node of kRegionEdge voxels; made from those of the node, which is new or a leaf, where there are none.
StateRegion* OccupancyTree::region_of(const Node* node, const Voxel& corner, bool fresh) {
  return &states_.make(corner, fresh ? kUnknown : state_of(node));
}

OccupancyTree::Blocks OccupancyTree::known(const VoxelBox& box) const {
  VoxelBlocks found;
  for (const Leaf& leaf : leaves(box)) {
    const Voxel corner = leaf.corner();
    const int edge = leaf.size();
    for (int x = std::max(corner.x, box.lo.x); x <= std::min(corner.x + edge - 1, box.hi.x); ++x) {
      for (int y = std::max(corner.y, box.lo.y); y <= std::min(corner.y + edge - 1, box.hi.y); ++y) {
        for (int z = std::max(corner.z, box.lo.z); z <= std::min(corner.z + edge - 1, box.hi.z); ++z) {
          const Voxel v{x, y, z};
          VoxelBlocks::set(found.at(v).free, VoxelBlocks::bit(v));
        }
      }
    }
  }
  return found.take_sorted();
}

// ---- reading the tree

State OccupancyTree::state(const Voxel& v) const {
  const auto key = [](int index) { return static_cast<octomap::key_type>(index + kKeyOffset); };
  const Node* node = search(octomap::OcTreeKey(key(v.x), key(v.y), key(v.z)));
  if (!node) return kUnknown;
  return state_of(node);
}

std::vector<Leaf> OccupancyTree::leaves(const VoxelBox& box) const {
  std::vector<Leaf> out;
  if (root) collect(root, kTreeCorner, kTreeSize, box, out);
  return out;
}

// Appends the leaves below a node; where they fill it and agree, takes them back for one. Gives the state of the whole node,
// unknown unless it has a single one.
State OccupancyTree::collect(const Node* node, const Voxel& corner, int size, const VoxelBox& box, std::vector<Leaf>& out) const {
  if (disjoint(corner, size, box)) return kUnknown;
  if (!nodeHasChildren(node)) {
    out.emplace_back(corner, size, isNodeOccupied(node));
    return out.back().occupied() ? kOccupied : kFree;
  }
  const std::size_t begin = out.size();
  State states[8];
  for (unsigned i = 0; i < 8; ++i) {
    states[i] = nodeChildExists(node, i) ? collect(getNodeChild(node, i), child_corner(corner, size / 2, i), size / 2, box, out) : kUnknown;
  }
  const bool alike = std::all_of(states, states + 8, [&](State state) { return state == states[0]; });
  if (!alike || states[0] == kUnknown) return kUnknown;
  out.erase(out.begin() + static_cast<std::ptrdiff_t>(begin), out.end());
  out.emplace_back(corner, size, states[0] == kOccupied);
  return states[0];
}

ColumnRuns OccupancyTree::column_runs(const VoxelBox& box) const {
  std::vector<StateCube> cubes;
  if (root) add_cubes(root, kTreeCorner, kTreeSize, box, cubes);
  return scan_columns(cubes, box);
}

// Appends what is known below a node: its regions, and larger leaves as if they were made of regions.
void OccupancyTree::add_cubes(const Node* node, const Voxel& corner, int size, const VoxelBox& box, std::vector<StateCube>& out) const {
  if (disjoint(corner, size, box)) return;
  const bool is_leaf = !nodeHasChildren(node);
  if (is_leaf) return out.push_back({corner, size, &StateRegion::uniform(state_of(node))});
  if (size == kRegionEdge) return out.push_back({corner, size, states_.find(corner)});
  for (unsigned i = 0; i < 8; ++i) {
    if (nodeChildExists(node, i)) add_cubes(getNodeChild(node, i), child_corner(corner, size / 2, i), size / 2, box, out);
  }
}

// ---- bytes

namespace {

enum Code : unsigned { kNothing = 0, kFreeLeaf = 1, kOccupiedLeaf = 2, kInner = 3 };  // as octomap's two bits a child

unsigned code_at(const std::string& data, std::size_t record, unsigned child) {
  return static_cast<unsigned char>(data[record + child / 4]) >> 2 * (child % 4) & 3;
}

[[noreturn]] void truncated(std::size_t bytes) { throw std::invalid_argument("octree data ends early, after " + std::to_string(bytes) + " bytes"); }

// Walks one record and those below; `at` moves on. Gives the number of nodes.
std::size_t check_binary(const std::string& data, std::size_t& at, unsigned depth) {
  const std::size_t record = at;
  if (data.size() < record + 2) truncated(data.size());
  at += 2;
  std::size_t nodes = 1;
  for (unsigned i = 0; i < 8; ++i) {
    const unsigned code = code_at(data, record, i);
    if (code == kInner && depth == 15) throw std::invalid_argument("octree data is deeper than 16 levels at byte " + std::to_string(record));
    if (code == kInner) nodes += check_binary(data, at, depth + 1);
    if (code == kFreeLeaf || code == kOccupiedLeaf) ++nodes;
  }
  if (nodes == 1 && depth > 0) throw std::invalid_argument("octree data has an inner node without children at byte " + std::to_string(record));
  return nodes;
}

std::size_t check_full(const std::string& data, std::size_t& at, unsigned depth) {
  const std::size_t record = at;
  if (data.size() < record + 5) truncated(data.size());
  float value;
  std::memcpy(&value, data.data() + record, 4);
  const unsigned children = static_cast<unsigned char>(data[record + 4]);
  if (!std::isfinite(value)) throw std::invalid_argument("octree data has a value that is not finite at byte " + std::to_string(record));
  if (children && depth == 16) throw std::invalid_argument("octree data is deeper than 16 levels at byte " + std::to_string(record));
  at += 5;
  std::size_t nodes = 1;
  for (unsigned i = 0; i < 8; ++i) {
    if (children >> i & 1) nodes += check_full(data, at, depth + 1);
  }
  return nodes;
}

template <typename Check>
std::size_t count_nodes(const std::string& data, Check check) {
  if (data.empty()) return 0;
  std::size_t at = 0;
  const std::size_t nodes = check(data, at, 0);
  if (at != data.size()) throw std::invalid_argument("octree data goes on after its end, at byte " + std::to_string(at) + " of " + std::to_string(data.size()));
  return nodes;
}

}  // namespace

std::size_t OccupancyTree::binary_nodes(const std::string& data) { return count_nodes(data, check_binary); }
std::size_t OccupancyTree::full_nodes(const std::string& data) { return count_nodes(data, check_full); }

std::string OccupancyTree::to_binary(const VoxelBox& box) const {
  std::string out;
  if (root) write_binary(root, kTreeCorner, kTreeSize, box, out);
  return out;
}

// Appends the record of an inner node and those below it; takes them back where all eight children turn out alike.
unsigned OccupancyTree::write_binary(const Node* node, const Voxel& corner, int size, const VoxelBox& box, std::string& out) const {
  if (disjoint(corner, size, box)) return kNothing;
  const bool is_root = size == kTreeSize, is_leaf = !nodeHasChildren(node);
  if (is_leaf && !is_root && inside(corner, size, box)) return isNodeOccupied(node) ? kOccupiedLeaf : kFreeLeaf;
  const std::size_t record = out.size();
  out.append(2, '\0');
  unsigned codes[8];
  for (unsigned i = 0; i < 8; ++i) {
    const bool has_child = is_leaf ? !is_root : nodeChildExists(node, i);
    const Node* child = is_leaf ? node : has_child ? getNodeChild(node, i) : nullptr;  // a leaf that the box cuts is written as if expanded
    codes[i] = has_child ? write_binary(child, child_corner(corner, size / 2, i), size / 2, box, out) : unsigned{kNothing};
    out[record + i / 4] = static_cast<char>(out[record + i / 4] | codes[i] << 2 * (i % 4));
  }
  const bool alike = std::all_of(codes, codes + 8, [&](unsigned code) { return code == codes[0]; });
  if (!alike || is_root || codes[0] == kInner) return kInner;
  out.resize(record);
  return codes[0];
}

std::string OccupancyTree::to_full() const {
  std::ostringstream out;
  writeData(out);
  return out.str();
}

void OccupancyTree::read_binary(const std::string& data) {
  if (binary_nodes(data) < 2) return;  // an empty map may have a root without children
  std::istringstream in(data);
  readBinaryData(in);
  copy_states(root, kTreeCorner, kTreeSize, nullptr);
}

void OccupancyTree::read_full(const std::string& data) {
  if (full_nodes(data) == 0) return;
  std::istringstream in(data);
  readData(in);
  copy_states(root, kTreeCorner, kTreeSize, nullptr);
}

// Into the region, or where there is none yet into new ones for the nodes of their size that have children.
void OccupancyTree::copy_states(const Node* node, const Voxel& corner, int size, StateRegion* region) {
  const bool is_leaf = !nodeHasChildren(node);
  if (is_leaf && region) region->fill(corner, size, state_of(node));
  if (is_leaf) return;
  if (size == kRegionEdge) region = region_of(node, corner, true);
  for (unsigned i = 0; i < 8; ++i) {
    if (nodeChildExists(node, i)) copy_states(getNodeChild(node, i), child_corner(corner, size / 2, i), size / 2, region);
  }
}

}  // namespace octree_binding
