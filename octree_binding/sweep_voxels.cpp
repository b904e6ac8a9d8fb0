#include "sweep_voxels.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <future>
#include <limits>
#include <utility>

namespace octree_binding {

// ---- sets of voxels

static std::uint64_t spread_by_three(std::uint64_t v) {  // 13 bits, two zeros between them
  std::uint64_t out = 0;
  for (int i = 0; i < 13; ++i) out |= (v >> i & 1) << (3 * i);
  return out;
}

std::uint64_t VoxelBlocks::position(const Voxel& v) {
  const auto block = [](int index) { return static_cast<std::uint64_t>(index + kKeyOffset) >> 3; };
  return block(v.x) | block(v.y) << 13 | block(v.z) << 26;
}

std::size_t VoxelBlocks::slot_of(std::uint64_t position) const {
  const std::size_t mask = slots_.size() - 1;
  std::size_t slot = (position * 0x9e3779b97f4a7c15u >> 20) & mask;
  while (slots_[slot] != kNone && positions_[slots_[slot]] != position) slot = (slot + 1) & mask;
  return slot;
}

void VoxelBlocks::grow() {
  slots_.assign(slots_.size() * 2, kNone);
  for (std::uint32_t i = 0; i < positions_.size(); ++i) slots_[slot_of(positions_[i])] = i;
}

VoxelBlock& VoxelBlocks::at(const Voxel& v) { return at(position(v)); }

VoxelBlock& VoxelBlocks::at(std::uint64_t wanted) {
  if (wanted == last_position_) return blocks_[last_];
  if (2 * blocks_.size() >= slots_.size()) grow();
  std::uint32_t& slot = slots_[slot_of(wanted)];
  if (slot == kNone) {
    slot = static_cast<std::uint32_t>(blocks_.size());
    positions_.push_back(wanted);
    blocks_.emplace_back();
    blocks_.back().order =
        spread_by_three(wanted & 0x1fff) | spread_by_three(wanted >> 13 & 0x1fff) << 1 | spread_by_three(wanted >> 26) << 2;
  }
  last_position_ = wanted;
  last_ = slot;
  return blocks_[slot];
}

const VoxelBlock* VoxelBlocks::find(const Voxel& v) const {
  const std::uint32_t found = slots_[slot_of(position(v))];
  return found == kNone ? nullptr : &blocks_[found];
}

bool VoxelBlocks::is_hit(const Voxel& v) const {
  const VoxelBlock* block = find(v);
  return block && test(block->hit, bit(v));
}

const VoxelBlock* VoxelBlocks::beside(std::uint64_t position, int axis, int way) const {
  const std::uint32_t found = slots_[slot_of(position + (std::uint64_t{1} << 13 * axis) * way)];
  return found == kNone ? nullptr : &blocks_[found];
}

void VoxelBlocks::add(const VoxelBlocks& other) {
  for (std::size_t i = 0; i < other.blocks_.size(); ++i) {
    VoxelBlock& block = at(other.positions_[i]);
    for (int word = 0; word < 8; ++word) {
      block.free[word] |= other.blocks_[i].free[word];
      block.hit[word] |= other.blocks_[i].hit[word];
    }
  }
}

// Within a word of 4^3 bits the step to the voxel beside depends on where along the axis a voxel lies: 0 to 1, 1 to 2 and 2 to 3;
// from 3 it leads to the word beside.
struct Steps {
  std::uint64_t even, at_1, at_2, odd, at_0, at_3;  // masks of the bits there
  int one, seven, nine;                             // distances of bits
  unsigned word;                                    // bit of the word's number
};

static Steps steps_along(int axis) {
  Steps s{0, 0, 0, 0, 0, 0, 1 << axis, 7 << axis, 9 << axis, 1u << axis};
  for (int bit = 0; bit < 64; ++bit) {
    const int at = (bit >> axis & 1) | (bit >> (axis + 3) & 1) << 1;
    const std::uint64_t mask = std::uint64_t{1} << bit;
    (at & 1 ? s.odd : s.even) |= mask;
    (at == 0 ? s.at_0 : at == 1 ? s.at_1 : at == 2 ? s.at_2 : s.at_3) |= mask;
  }
  return s;
}

static std::uint64_t seen(const VoxelBlock* block, unsigned word) { return block ? block->free[word] | block->hit[word] : 0; }

void VoxelBlocks::mark_through() {
  static const Steps kSteps[3] = {steps_along(0), steps_along(1), steps_along(2)};
  for (std::size_t i = 0; i < blocks_.size(); ++i) {
    VoxelBlock& block = blocks_[i];
    for (unsigned word = 0; word < 8; ++word) block.through[word] = block.free[word] & ~block.hit[word];
    for (int axis = 0; axis < 3; ++axis) {
      const Steps& s = kSteps[axis];
      const VoxelBlock* above = beside(positions_[i], axis, 1);
      const VoxelBlock* below = beside(positions_[i], axis, -1);
      for (unsigned word = 0; word < 8; ++word) {
        const bool is_upper = word & s.word;
        const std::uint64_t here = seen(&block, word), other = seen(&block, word ^ s.word);
        const std::uint64_t next = is_upper ? seen(above, word ^ s.word) : other, last = is_upper ? other : seen(below, word ^ s.word);
        block.through[word] &= (here >> s.one & s.even) | (here >> s.seven & s.at_1) | (next << s.nine & s.at_3);
        block.through[word] &= (here << s.one & s.odd) | (here << s.seven & s.at_2) | (last >> s.nine & s.at_0);
      }
    }
  }
}

std::vector<VoxelBlock> VoxelBlocks::take_sorted() {
  const auto holds = [](std::uint64_t word) { return word != 0; };
  std::vector<std::pair<std::uint64_t, std::size_t>> order;  // sorted instead of the blocks, which are large
  order.reserve(blocks_.size());
  for (std::size_t i = 0; i < blocks_.size(); ++i) {
    const VoxelBlock& block = blocks_[i];
    if (std::any_of(block.free.begin(), block.free.end(), holds) || std::any_of(block.hit.begin(), block.hit.end(), holds)) {
      order.emplace_back(block.order, i);
    }
  }
  std::sort(order.begin(), order.end());
  std::vector<VoxelBlock> taken;
  taken.reserve(order.size());
  for (const auto& [place, i] : order) taken.push_back(blocks_[i]);
  *this = VoxelBlocks();
  return taken;
}

// ---- rays

namespace {

struct Ray {  // in units of voxels
  double from[3], along[3];
  double length;      // metres, of `along`
  Voxel first, last;  // within the bounds
  bool hit;           // `last` holds the surface; else the ray leaves the bounds or its range ends there
  bool carve_last;    // the ray goes through `last` and on
};

Voxel voxel_at(const double* u) {
  return {static_cast<int>(std::floor(u[0])), static_cast<int>(std::floor(u[1])), static_cast<int>(std::floor(u[2]))};
}

bool in_tree(const double* u) {
  return std::all_of(u, u + 3, [](double c) { return c >= -kKeyOffset && c < kKeyOffset; });
}

// The part [begin, end] of the ray's parameter that lies within the bounds; false when none does.
bool clip(const Ray& ray, const VoxelBox& bounds, double& begin, double& end) {
  begin = 0, end = 1;
  for (int axis = 0; axis < 3; ++axis) {
    const double low = bounds.lo[axis] - ray.from[axis], high = bounds.hi[axis] + 1 - ray.from[axis];
    if (ray.along[axis] == 0) {
      if (low > 0 || high <= 0) return false;
      continue;
    }
    const double a = low / ray.along[axis], b = high / ray.along[axis];
    begin = std::max(begin, std::min(a, b));
    end = std::min(end, std::max(a, b));
  }
  return begin < end || (begin == 0 && end == 0);
}

Voxel voxel_on(const Ray& ray, double t, const VoxelBox& bounds) {
  double u[3];
  for (int axis = 0; axis < 3; ++axis) {
    // clamped before it is rounded: the clipped end lies on the border of the bounds
    u[axis] = std::clamp(ray.from[axis] + t * ray.along[axis], double(bounds.lo[axis]), bounds.hi[axis] + 0.5);
  }
  return voxel_at(u);
}

// The ray from an origin to a point, shortened to range and bounds; false when nothing of it is left.
bool make_ray(const float* origin, const float* point, bool met, const SweepRules& rules, Ray& ray) {
  double squared = 0, target[3];
  for (int axis = 0; axis < 3; ++axis) {
    ray.from[axis] = origin[axis] * (1 / rules.resolution);  // as octomap computes its keys
    target[axis] = point[axis] * (1 / rules.resolution);
    ray.along[axis] = target[axis] - ray.from[axis];
    squared += ray.along[axis] * ray.along[axis];
  }
  ray.length = std::sqrt(squared) * rules.resolution;
  const bool too_far = ray.length > rules.max_range;
  if (too_far) {
    const double scale = rules.max_range / ray.length;
    for (int axis = 0; axis < 3; ++axis) target[axis] = ray.from[axis] + (ray.along[axis] *= scale);
    ray.length = rules.max_range;
  }
  const bool ends_inside = in_tree(target) && rules.bounds.contains(voxel_at(target));
  ray.hit = met && ends_inside && !too_far;
  ray.carve_last = !ends_inside;
  double begin, end;
  if (!clip(ray, rules.bounds, begin, end)) {
    if (!ray.hit) return false;
    begin = 1;  // it touches the bounds in its end point only
  }
  ray.last = ends_inside ? voxel_at(target) : voxel_on(ray, end, rules.bounds);
  ray.first = begin < 1 ? voxel_on(ray, begin, rules.bounds) : ray.last;
  return true;
}

// Whether another hit lies beside `v` in its layer across the axis.
bool extends_in_layer(const Voxel& v, int axis, const VoxelBlocks& voxels) {
  const int a = (axis + 1) % 3, b = (axis + 2) % 3;
  for (int i = -1; i <= 1; ++i) {
    for (int j = -1; j <= 1; ++j) {
      Voxel beside = v;
      beside[a] += i, beside[b] += j;
      if ((i || j) && voxels.is_hit(beside)) return true;
    }
  }
  return false;
}

// Axes across which the surface at the end of the ray is a layer: it extends there, and does not rise towards where the ray
// came from. Then it may lie in the other voxels of that layer, too, that the ray crosses at a grazing angle.
std::array<bool, 3> surface_layers(const Ray& ray, const VoxelBlocks& voxels) {
  std::array<bool, 3> layers{};
  for (int axis = 0; axis < 3; ++axis) {
    Voxel below = ray.last, above = ray.last;
    --below[axis], ++above[axis];
    const double d = ray.along[axis];
    const bool is_top = (d >= 0 && !voxels.is_hit(below)) || (d <= 0 && !voxels.is_hit(above));
    layers[axis] = is_top && extends_in_layer(ray.last, axis, voxels);
  }
  return layers;
}

// Along a ray from voxel to voxel (Amanatides and Woo 1987).
class Walk {
 public:
  explicit Walk(const Ray& ray) : at_(ray.first) {
    for (int axis = 0; axis < 3; ++axis) {
      const int way = ray.last[axis] - at_[axis];
      step_[axis] = way > 0 ? 1 : -1;
      left_[axis] = std::abs(way);
      next_[axis] = way ? (at_[axis] + (way > 0) - ray.from[axis]) / ray.along[axis] : kNever;
      delta_[axis] = way ? step_[axis] / ray.along[axis] : kNever;
      bits_[axis] = VoxelBlocks::bit_along(at_, axis);
    }
  }

  const Voxel& at() const { return at_; }
  int left() const { return left_[0] + left_[1] + left_[2]; }
  double entered() const { return entered_; }  // the ray's parameter where it came into the voxel
  unsigned bit() const { return bits_[0] | bits_[1] | bits_[2]; }

  // To the next voxel; whether that is in another block.
  bool go_on() {
    int axis = next_[1] < next_[0];
    axis = next_[2] < next_[axis] ? 2 : axis;
    entered_ = next_[axis];
    at_[axis] += step_[axis];
    next_[axis] = --left_[axis] ? entered_ + delta_[axis] : kNever;
    bits_[axis] = VoxelBlocks::bit_along(at_, axis);
    return (at_[axis] & 7) == (step_[axis] > 0 ? 0 : 7);
  }

 private:
  static constexpr double kNever = std::numeric_limits<double>::infinity();

  Voxel at_;
  int step_[3], left_[3];
  double next_[3], delta_[3], entered_ = 0;
  unsigned bits_[3];
};

// Marks the voxels that the ray goes through, without the last one, as free; `hits` are those of all rays.
void carve(const Ray& ray, const SweepRules& rules, const VoxelBlocks& hits, VoxelBlocks& voxels) {
  std::array<bool, 3> layers{};
  if (ray.hit && rules.grazing > 0) layers = surface_layers(ray, hits);
  const auto is_in_layer = [&](const Voxel& v) {  // and so it stays up to the end
    return (layers[0] && v.x == ray.last.x) || (layers[1] && v.y == ray.last.y) || (layers[2] && v.z == ray.last.z);
  };
  const double guarded_from = 1 - rules.grazing / ray.length;
  Walk walk(ray);
  BlockBits* free = &voxels.at(walk.at()).free;
  for (int left = walk.left(); left; --left) {
    if (walk.entered() >= guarded_from && is_in_layer(walk.at())) return;
    VoxelBlocks::set(*free, walk.bit());
    if (walk.go_on()) free = &voxels.at(walk.at()).free;
  }
  if (ray.carve_last) VoxelBlocks::set(*free, walk.bit());
}

// The first ray to every end voxel, of some points in their order.
struct Rays {
  std::vector<Ray> rays;
  VoxelBlocks hits, carved_to;  // where they end, with and without a hit
  std::size_t dropped = 0;

  void add(const float* points, const float* origins, std::size_t begin, std::size_t end, const SweepRules& rules) {
    const auto finite = [](const float* p) { return std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2]); };
    rays.reserve(end - begin);
    Ray ray;
    for (std::size_t i = begin; i < end; ++i) {
      const float *point = points + 3 * i, *origin = origins + 3 * i;
      if (!finite(point) || !finite(origin)) {
        ++dropped;
      } else if (make_ray(origin, point, i < rules.met, rules, ray)) {
        add(ray);
      }
    }
  }

  void add(const Rays& later) {
    dropped += later.dropped;
    for (const Ray& ray : later.rays) add(ray);
  }

 private:
  void add(const Ray& ray) {
    BlockBits& ends = (ray.hit ? hits : carved_to).at(ray.last).hit;
    const unsigned bit = VoxelBlocks::bit(ray.last);
    if (VoxelBlocks::test(ends, bit)) return;
    VoxelBlocks::set(ends, bit);
    rays.push_back(ray);
  }
};

// Calls f(0) and f(1) in two threads.
template <typename F>
void in_two(const F& f) {
  auto other = std::async(std::launch::async, f, 1);
  f(0);
  other.get();
}

// In two threads, each with half of the points: the same rays as in one.
Rays rays_of(const float* points, const float* origins, std::size_t n, const SweepRules& rules) {
  Rays halves[2];
  in_two([&](std::size_t half) {
    halves[half].add(points, origins, half ? n / 2 : 0, half ? n : n / 2, rules);
  });
  halves[0].add(halves[1]);
  return std::move(halves[0]);
}

// Carves all rays, every other one in a second thread: each writes blocks of its own, and in the end it is the same who wrote what.
VoxelBlocks carved(const Rays& traced, const SweepRules& rules) {
  VoxelBlocks halves[2];
  in_two([&](std::size_t half) {
    for (std::size_t i = half; i < traced.rays.size(); i += 2) carve(traced.rays[i], rules, traced.hits, halves[half]);
  });
  halves[0].add(halves[1]);
  halves[0].add(traced.hits);
  return std::move(halves[0]);
}

}  // namespace

SweepVoxels trace_sweep(const float* points, const float* origins, std::size_t n, const SweepRules& rules) {
  SweepVoxels out;
  const Rays traced = rays_of(points, origins, n, rules);
  VoxelBlocks voxels = carved(traced, rules);
  voxels.mark_through();
  out.dropped = traced.dropped;
  out.blocks = voxels.take_sorted();
  for (VoxelBlock& block : out.blocks) {
    for (int word = 0; word < 8; ++word) block.free[word] &= ~block.hit[word];
    out.free += count(block.free);
    out.occupied += count(block.hit);
  }
  return out;
}

}  // namespace octree_binding
