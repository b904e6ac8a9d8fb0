#include "block_values.h"

#include <algorithm>

namespace octree_binding {

namespace {

std::uint64_t mask(unsigned bits) { return bits == 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << bits) - 1; }

}  // namespace

bool any(const BlockBits& block, unsigned first, unsigned bits) {
  if (bits == 512) return std::any_of(block.begin(), block.end(), [](std::uint64_t word) { return word != 0; });
  return (block[first >> 6] >> (first & 63) & mask(bits)) != 0;
}

bool all(const BlockBits& block, unsigned first, unsigned bits) {
  if (bits == 512) return std::all_of(block.begin(), block.end(), [](std::uint64_t word) { return ~word == 0; });
  return (block[first >> 6] >> (first & 63) & mask(bits)) == mask(bits);
}

void BlockValues::set(unsigned first, unsigned bits, float value) {
  if (bits == 512) {
    known.fill(mask(64));
  } else {
    known[first >> 6] |= mask(bits) << (first & 63);
  }
  std::fill_n(log_odds.begin() + first, bits, value);
}

void BlockValues::update(const VoxelBlock& seen, const UpdateRule& rule) {
  for (unsigned word = 0; word < 8; ++word) {
    const std::uint64_t touched = seen.free[word] | seen.hit[word];
    for (std::uint64_t rest = touched; rest; rest &= rest - 1) {
      const int bit = __builtin_ctzll(rest);
      float& value = log_odds[64 * word + bit];
      if (seen.hit[word] >> bit & 1) {
        value = std::min(value + rule.hit, rule.max);
      } else {  // what is freer already stays so
        const bool through = seen.through[word] >> bit & 1;
        const float least = through ? rule.min_through : rule.min;
        value = std::max(value + (through ? rule.through : rule.miss), std::min(value, least));
      }
    }
    known[word] |= touched;
  }
}

bool BlockValues::is_uniform(unsigned first, unsigned bits) const {
  const auto begin = log_odds.begin() + first;
  return all(known, first, bits) && std::all_of(begin, begin + bits, [=](float value) { return value == *begin; });
}

bool BlockValues::equals(const BlockValues& other, unsigned first, unsigned bits) const {
  const auto begin = log_odds.begin() + first;
  if (!std::equal(begin, begin + bits, other.log_odds.begin() + first)) return false;
  if (bits == 512) return known == other.known;
  return ((known[first >> 6] ^ other.known[first >> 6]) >> (first & 63) & mask(bits)) == 0;
}

}  // namespace octree_binding
