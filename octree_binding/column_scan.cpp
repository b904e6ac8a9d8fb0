#include "column_scan.h"

#include <algorithm>
#include <stdexcept>
#include <string>

namespace octree_binding {

namespace {

using Word = StateRegion::Word;

int region_of(int index) { return (index + kKeyOffset) / kRegionEdge; }
int first_index(int region) { return region * kRegionEdge - kKeyOffset; }

VoxelBox common(const StateCube& cube, const VoxelBox& box) {
  VoxelBox part;
  for (int axis = 0; axis < 3; ++axis) {
    part.lo[axis] = std::max(cube.corner[axis], box.lo[axis]);
    part.hi[axis] = std::min(cube.corner[axis] + cube.size - 1, box.hi[axis]);
  }
  return part;
}

// ---- the smallest block of columns

struct Extent {
  int x_lo = kKeyOffset, x_hi = -kKeyOffset - 1, y_lo = kKeyOffset, y_hi = -kKeyOffset - 1;
  bool empty() const { return x_lo > x_hi; }
  bool contains(const VoxelBox& part) const { return part.lo.x >= x_lo && part.hi.x <= x_hi && part.lo.y >= y_lo && part.hi.y <= y_hi; }
  void add(int x, int y_first, int y_last) {
    x_lo = std::min(x_lo, x), x_hi = std::max(x_hi, x);
    y_lo = std::min(y_lo, y_first), y_hi = std::max(y_hi, y_last);
  }
};

// Takes in the columns of one region that have known voxels.
void add_region(Extent& extent, const StateRegion& region, const VoxelBox& part) {
  const Word layers = layers_in(part, first_index(region_of(part.lo.z)));
  for (int x = part.lo.x; x <= part.hi.x; ++x) {
    const Word* row = region.known.data() + StateRegion::word_of({x, 0, 0});
    int first = part.lo.y, last = part.hi.y;
    while (first <= last && !(row[first & (kRegionEdge - 1)] & layers)) ++first;
    while (first <= last && !(row[last & (kRegionEdge - 1)] & layers)) --last;
    if (first <= last) extent.add(x, first, last);
  }
}

Extent extent_of(const std::vector<StateCube>& cubes, const VoxelBox& box) {
  Extent extent;
  for (const StateCube& cube : cubes) {
    const VoxelBox part = common(cube, box);
    if (extent.contains(part)) continue;
    if (cube.size == kRegionEdge) {
      add_region(extent, *cube.region, part);
    } else {
      extent.add(part.lo.x, part.lo.y, part.hi.y);
      extent.add(part.hi.x, part.lo.y, part.hi.y);
    }
  }
  return extent;
}

// ---- the regions as a grid

class RegionGrid {
 public:
  RegionGrid(const std::vector<StateCube>& cubes, const VoxelBox& box) : lo_(region_box(box).lo) {
    const Voxel hi = region_box(box).hi;
    nx_ = hi.x - lo_.x + 1, ny_ = hi.y - lo_.y + 1, nz_ = hi.z - lo_.z + 1;
    cells_.assign(std::size_t(nx_) * ny_ * nz_, nullptr);
    for (const StateCube& cube : cubes) put(cube, box);
  }
  int layers() const { return nz_; }
  int z_of(int layer) const { return first_index(lo_.z + layer); }
  // The regions above one another at a column, from below; null where all is unknown.
  const StateRegion* const* stack(int x, int y) const { return &cells_[cell({region_of(x), region_of(y), lo_.z})]; }

 private:
  static VoxelBox region_box(const VoxelBox& box) {
    VoxelBox regions;
    for (int axis = 0; axis < 3; ++axis) regions.lo[axis] = region_of(box.lo[axis]), regions.hi[axis] = region_of(box.hi[axis]);
    return regions;
  }
  std::size_t cell(const Voxel& region) const {
    return (std::size_t(region.x - lo_.x) * ny_ + (region.y - lo_.y)) * nz_ + (region.z - lo_.z);
  }
  void put(const StateCube& cube, const VoxelBox& box) {
    const VoxelBox part = region_box(common(cube, box));
    for (int x = part.lo.x; x <= part.hi.x; ++x) {
      for (int y = part.lo.y; y <= part.hi.y; ++y) {
        for (int z = part.lo.z; z <= part.hi.z; ++z) cells_[cell({x, y, z})] = cube.region;
      }
    }
  }

  Voxel lo_;
  int nx_, ny_, nz_;
  std::vector<const StateRegion*> cells_;
};

// ---- the runs

class Scanner {
 public:
  Scanner(const RegionGrid& grid, const VoxelBox& box, ColumnRuns& out) : grid_(grid), box_(box), out_(out), words_(grid.layers()) {
    for (int i = 0; i < grid.layers(); ++i) words_[i].z = grid.z_of(i), words_[i].layers = layers_in(box, grid.z_of(i));
  }

  void run() {
    std::size_t column = 0;
    for (int x = box_.lo.x; x <= box_.hi.x; ++x) {
      for (int y = box_.lo.y; y <= box_.hi.y; ++y) {
        if (y == box_.lo.y || (y & (kRegionEdge - 1)) == 0) enter(x, y);
        scan(y & (kRegionEdge - 1));
        out_.start[++column] = static_cast<std::int64_t>(size_);
      }
    }
    resize(size_);
  }

 private:
  struct WordRow {  // the words of one x in one region
    const Word *known, *occupied;
    Word layers;
    int z;
  };

  void enter(int x, int y) {
    const StateRegion* const* stack = grid_.stack(x, y);
    for (int i = 0; i < grid_.layers(); ++i) {
      const StateRegion& region = stack[i] ? *stack[i] : StateRegion::uniform(kUnknown);
      const int row = StateRegion::word_of({x, 0, 0});
      words_[i].known = region.known.data() + row, words_[i].occupied = region.occupied.data() + row;
    }
  }

  // One column: wherever a voxel differs from the one below, a run ends, or begins, or both.
  void scan(int y) {
    const std::size_t most = size_ + words_.size() * kRegionEdge + 1;
    if (most > out_.z_lo.size()) resize(std::max(most, 2 * size_));
    std::int16_t *z_lo = out_.z_lo.data(), *z_hi = out_.z_hi.data();
    std::uint8_t* occupied_out = out_.occupied.data();
    std::size_t n = size_;
    Word known_below = 0, occupied_below = 0;
    for (const WordRow& row : words_) {
      const Word known = row.known[y] & row.layers, occupied = row.occupied[y] & row.layers;
      const Word known_before = known << 1 | known_below;
      Word changes = (known ^ known_before) | (occupied ^ (occupied << 1 | occupied_below));
      known_below = known >> (kRegionEdge - 1), occupied_below = occupied >> (kRegionEdge - 1);
      for (; changes; changes &= changes - 1) {
        const int bit = __builtin_ctzll(changes);
        z_hi[n - (known_before >> bit & 1)] = static_cast<std::int16_t>(row.z + bit - 1);  // overwritten if nothing ends here
        z_lo[n] = static_cast<std::int16_t>(row.z + bit);
        occupied_out[n] = occupied >> bit & 1;
        n += known >> bit & 1;
      }
    }
    if (known_below) z_hi[n - 1] = static_cast<std::int16_t>(words_.back().z + kRegionEdge - 1);
    size_ = n;
  }

  void resize(std::size_t size) { out_.z_lo.resize(size), out_.z_hi.resize(size), out_.occupied.resize(size); }

  const RegionGrid& grid_;
  const VoxelBox& box_;
  ColumnRuns& out_;
  std::vector<WordRow> words_;
  std::size_t size_ = 0;
};

}  // namespace

ColumnRuns scan_columns(const std::vector<StateCube>& cubes, const VoxelBox& box) {
  ColumnRuns out;
  const Extent extent = extent_of(cubes, box);
  if (extent.empty()) return out;
  out.nx = extent.x_hi - extent.x_lo + 1;
  out.ny = extent.y_hi - extent.y_lo + 1;
  out.origin = {extent.x_lo, extent.y_lo, 0};
  const std::size_t columns = std::size_t(out.nx) * out.ny;
  if (columns > std::size_t{1} << 28) {
    throw std::invalid_argument("the known voxels span " + std::to_string(out.nx) + " x " + std::to_string(out.ny) +
                                " columns, more than 2^28: ask for a smaller box");
  }
  VoxelBox block{{extent.x_lo, extent.y_lo, kKeyOffset - 1}, {extent.x_hi, extent.y_hi, -kKeyOffset}};
  for (const StateCube& cube : cubes) {
    const VoxelBox part = common(cube, box);
    block.lo.z = std::min(block.lo.z, part.lo.z), block.hi.z = std::max(block.hi.z, part.hi.z);
  }
  out.start.assign(columns + 1, 0);
  Scanner(RegionGrid(cubes, block), block, out).run();
  return out;
}

}  // namespace octree_binding
