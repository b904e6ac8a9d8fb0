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
constexpr unsigned kBlockLevel = 13;  // a node of this depth is a block of 8^3 voxels

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

// `bits` (1, 8, 64 or 512) bits from `first` on: is there one, are there all?
bool any(const BlockBits& block, unsigned first, unsigned bits) {
  if (bits == 512) return std::any_of(block.begin(), block.end(), [](std::uint64_t word) { return word != 0; });
  const std::uint64_t mask = bits == 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << bits) - 1;
  return (block[first >> 6] >> (first & 63) & mask) != 0;
}

bool all(const BlockBits& block, unsigned first, unsigned bits) {
  if (bits == 512) return std::all_of(block.begin(), block.end(), [](std::uint64_t word) { return ~word == 0; });
  const std::uint64_t mask = bits == 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << bits) - 1;
  return (block[first >> 6] >> (first & 63) & mask) == mask;
}

}  // namespace

// ---- changing the tree

void OccupancyTree::create_root() {
  if (root) return;
  root = new Node();
  ++tree_size;
}

void OccupancyTree::apply(const std::vector<VoxelBlock>& blocks) {
  if (blocks.empty()) return;
  const bool fresh = root == nullptr;
  create_root();
  apply_blocks(root, fresh, 0, blocks.data(), blocks.data() + blocks.size());
  size_changed = true;
}

// Whether updates of these kinds would change nothing in a leaf, because its value is clamped.
bool OccupancyTree::is_settled(const Node* leaf, bool any_free, bool any_hit) const {
  return (!any_free || leaf->getLogOdds() <= clamping_thres_min) && (!any_hit || leaf->getLogOdds() >= clamping_thres_max);
}

OccupancyTree::Node* OccupancyTree::child_for_update(Node* parent, unsigned i, bool& fresh) {
  fresh = !nodeChildExists(parent, i);
  return fresh ? createNodeChild(parent, i) : getNodeChild(parent, i);
}

void OccupancyTree::finish(Node* node) {
  if (!pruneNode(node)) node->updateOccupancyChildren();
}

// Applies the sorted blocks below an inner node. `fresh`: the node was just made and has no value yet.
void OccupancyTree::apply_blocks(Node* node, bool fresh, unsigned level, Blocks begin, Blocks end) {
  if (level == kBlockLevel) return apply_bits(node, fresh, *begin, 0, 512);
  if (!fresh && !nodeHasChildren(node)) expandNode(node);
  const unsigned shift = 3 * (kBlockLevel - 1 - level);
  while (begin != end) {
    const unsigned i = begin->order >> shift & 7;
    const Blocks next = std::find_if(begin, end, [=](const VoxelBlock& block) { return (block.order >> shift & 7) != i; });
    bool child_fresh;
    Node* child = child_for_update(node, i, child_fresh);
    apply_blocks(child, child_fresh, level + 1, begin, next);
    begin = next;
  }
  finish(node);
}

// Applies one block, or an octant of it, to the node that covers just this.
void OccupancyTree::apply_bits(Node* node, bool fresh, const VoxelBlock& block, unsigned first, unsigned bits) {
  const bool any_free = any(block.free, first, bits), any_hit = any(block.hit, first, bits);
  const bool is_leaf = !nodeHasChildren(node);
  if (!any_free && !any_hit) return;
  if (is_leaf && !fresh && is_settled(node, any_free, any_hit)) return;
  if (is_leaf && (all(block.free, first, bits) || all(block.hit, first, bits))) {
    return updateNodeLogOdds(node, any_hit ? prob_hit_log : prob_miss_log);  // the whole cube at once
  }
  if (is_leaf && !fresh) expandNode(node);
  for (unsigned i = 0; i < 8; ++i) {
    const unsigned part = first + i * bits / 8;
    if (!any(block.free, part, bits / 8) && !any(block.hit, part, bits / 8)) continue;
    bool child_fresh;
    Node* child = child_for_update(node, i, child_fresh);
    apply_bits(child, child_fresh, block, part, bits / 8);
  }
  finish(node);
}

std::size_t OccupancyTree::occupy_unknown(const VoxelBox& box) {
  VoxelBlocks unknown;
  std::size_t count = 0;
  for (int x = box.lo.x; x <= box.hi.x; ++x) {
    for (int y = box.lo.y; y <= box.hi.y; ++y) {
      for (int z = box.lo.z; z <= box.hi.z; ++z) {
        const Voxel v{x, y, z};
        if (state(v) != kUnknown) continue;
        VoxelBlocks::set(unknown.at(v).hit, VoxelBlocks::bit(v));
        ++count;
      }
    }
  }
  unknown.sort();
  apply(unknown.blocks());
  return count;
}

void OccupancyTree::free_known(const VoxelBox& box) {
  if (root) free_known(root, kTreeCorner, kTreeSize, box);
}

void OccupancyTree::free_known(Node* node, const Voxel& corner, int size, const VoxelBox& box) {
  if (disjoint(corner, size, box)) return;
  if (!nodeHasChildren(node)) {
    if (inside(corner, size, box)) return node->setLogOdds(clamping_thres_min);
    expandNode(node);
  }
  for (unsigned i = 0; i < 8; ++i) {
    if (nodeChildExists(node, i)) free_known(getNodeChild(node, i), child_corner(corner, size / 2, i), size / 2, box);
  }
  finish(node);
}

// ---- reading the tree

State OccupancyTree::state(const Voxel& v) const {
  const auto key = [](int index) { return static_cast<octomap::key_type>(index + kKeyOffset); };
  const Node* node = search(octomap::OcTreeKey(key(v.x), key(v.y), key(v.z)));
  if (!node) return kUnknown;
  return isNodeOccupied(node) ? kOccupied : kFree;
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

namespace {

// The part of a leaf that lies in a box.
VoxelBox part_in(const Leaf& leaf, const VoxelBox& box) {
  const Voxel corner = leaf.corner();
  VoxelBox part;
  for (int axis = 0; axis < 3; ++axis) {
    part.lo[axis] = std::max(corner[axis], box.lo[axis]);
    part.hi[axis] = std::min(corner[axis] + leaf.size() - 1, box.hi[axis]);
  }
  return part;
}

VoxelBox extent_of(const std::vector<Leaf>& leaves, const VoxelBox& box) {
  VoxelBox extent = part_in(leaves.front(), box);
  for (const Leaf& leaf : leaves) {
    const VoxelBox part = part_in(leaf, box);
    for (int axis = 0; axis < 3; ++axis) {
      extent.lo[axis] = std::min(extent.lo[axis], part.lo[axis]);
      extent.hi[axis] = std::max(extent.hi[axis], part.hi[axis]);
    }
  }
  return extent;
}

struct Run {
  std::uint32_t column;
  std::int16_t z_lo, z_hi;
  bool occupied;
};

// The runs of all columns in the order of the leaves, so that those of one column ascend.
std::vector<Run> runs_of(const std::vector<Leaf>& leaves, const VoxelBox& extent, std::size_t columns) {
  const int ny = extent.hi.y - extent.lo.y + 1;
  std::vector<std::int32_t> top(columns, -1);  // the last run of each column so far
  std::vector<Run> runs;
  for (const Leaf& leaf : leaves) {
    const VoxelBox part = part_in(leaf, extent);
    for (int x = part.lo.x; x <= part.hi.x; ++x) {
      for (int y = part.lo.y; y <= part.hi.y; ++y) {
        const std::uint32_t column = std::uint32_t(x - extent.lo.x) * ny + (y - extent.lo.y);
        Run* last = top[column] < 0 ? nullptr : &runs[top[column]];
        if (last && last->z_hi + 1 == part.lo.z && last->occupied == leaf.occupied()) {
          last->z_hi = static_cast<std::int16_t>(part.hi.z);
          continue;
        }
        top[column] = static_cast<std::int32_t>(runs.size());
        runs.push_back({column, static_cast<std::int16_t>(part.lo.z), static_cast<std::int16_t>(part.hi.z), leaf.occupied()});
      }
    }
  }
  return runs;
}

}  // namespace

ColumnRuns OccupancyTree::column_runs(const VoxelBox& box) const {
  ColumnRuns out;
  const std::vector<Leaf> found = leaves(box);
  if (found.empty()) return out;
  const VoxelBox extent = extent_of(found, box);
  out.origin = extent.lo;
  out.nx = extent.hi.x - extent.lo.x + 1;
  out.ny = extent.hi.y - extent.lo.y + 1;
  const std::size_t columns = std::size_t(out.nx) * out.ny;
  if (columns > std::size_t{1} << 28) {
    throw std::invalid_argument("the known voxels span " + std::to_string(out.nx) + " x " + std::to_string(out.ny) +
                                " columns, more than 2^28: ask for a smaller box");
  }
  const std::vector<Run> runs = runs_of(found, extent, columns);
  out.start.assign(columns + 1, 0);
  for (const Run& run : runs) ++out.start[run.column + 1];
  for (std::size_t c = 0; c < columns; ++c) out.start[c + 1] += out.start[c];
  out.z_lo.resize(runs.size()), out.z_hi.resize(runs.size()), out.occupied.resize(runs.size());
  std::vector<std::int64_t> next(out.start.begin(), out.start.end() - 1);
  for (const Run& run : runs) {
    const std::size_t i = next[run.column]++;
    out.z_lo[i] = run.z_lo, out.z_hi[i] = run.z_hi, out.occupied[i] = run.occupied;
  }
  return out;
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
}

void OccupancyTree::read_full(const std::string& data) {
  if (full_nodes(data) == 0) return;
  std::istringstream in(data);
  readData(in);
}

}  // namespace octree_binding
