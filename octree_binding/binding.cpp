// The module _octree_binding: OccupancyTree for Python. Private: octree.py checks arguments and gives them names.
// Every call releases the GIL and holds the tree's own mutex, so that threads may share a tree.

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <memory>
#include <mutex>

#include "occupancy_tree.h"
#include "sweep_voxels.h"

namespace py = pybind11;
using namespace octree_binding;

namespace {

using Array = py::array_t<float, py::array::c_style>;
using Corner = std::array<int, 3>;

struct Tree {
  explicit Tree(double resolution) : tree(resolution) {}
  OccupancyTree tree;
  std::mutex mutex;
};

// f(tree) without the GIL and under the tree's mutex.
template <typename F>
auto locked(Tree& self, F f) {
  const py::gil_scoped_release release;
  const std::lock_guard<std::mutex> lock(self.mutex);
  return f(self.tree);
}

VoxelBox box_of(const Corner& lo, const Corner& hi) { return {{lo[0], lo[1], lo[2]}, {hi[0], hi[1], hi[2]}}; }

// A numpy array that takes over the vector.
template <typename T>
py::array_t<T> to_numpy(std::vector<T>&& values) {
  auto owned = std::make_unique<std::vector<T>>(std::move(values));
  const auto size = static_cast<py::ssize_t>(owned->size());
  T* data = owned->data();
  const py::capsule owner(owned.release(), [](void* p) { delete static_cast<std::vector<T>*>(p); });
  return py::array_t<T>(size, data, owner);
}

std::unique_ptr<Tree> make_tree(double resolution, double hit, double miss, double through, double min, double min_through, double max) {
  auto made = std::make_unique<Tree>(resolution);
  made->tree.setProbHit(hit);
  made->tree.setProbMiss(miss);
  made->tree.set_prob_through(through, min_through);
  made->tree.setClampingThresMin(min);
  made->tree.setClampingThresMax(max);
  return made;
}

using Sweeps = std::vector<const SweepVoxels*>;

SweepVoxels trace(const Array& points, const Array& origins, std::size_t met, double resolution, double max_range, double grazing, const Corner& lo, const Corner& hi) {
  const float* p = points.data();
  const float* o = origins.data();
  const auto n = static_cast<std::size_t>(points.shape(0));
  const py::gil_scoped_release release;
  return trace_sweep(p, o, n, {resolution, met, max_range, grazing, box_of(lo, hi)});
}

SweepVoxels known_free(Tree& self, const Corner& lo, const Corner& hi) {
  SweepVoxels out;
  out.blocks = locked(self, [&](const OccupancyTree& tree) { return tree.known(box_of(lo, hi)); });
  for (const VoxelBlock& block : out.blocks) out.free += count(block.free);
  return out;
}

void redraw(Tree& self, const Sweeps& changed, const Sweeps& all) {
  const auto blocks_of = [](const Sweeps& sweeps) {
    std::vector<const OccupancyTree::Blocks*> out;
    for (const SweepVoxels* sweep : sweeps) out.push_back(&sweep->blocks);
    return out;
  };
  locked(self, [&](OccupancyTree& tree) { tree.redraw(blocks_of(changed), blocks_of(all)); });
}

py::tuple column_runs(Tree& self, const Corner& lo, const Corner& hi) {
  ColumnRuns runs = locked(self, [&](const OccupancyTree& tree) { return tree.column_runs(box_of(lo, hi)); });
  return py::make_tuple(py::make_tuple(runs.origin.x, runs.origin.y), runs.nx, runs.ny, to_numpy(std::move(runs.start)),
                        to_numpy(std::move(runs.z_lo)), to_numpy(std::move(runs.z_hi)), to_numpy(std::move(runs.occupied)));
}

// Flat: lowest voxel x, y, z and edge length, in voxels, of every occupied cube, or of every free one.
py::array_t<int> leaves(Tree& self, bool occupied) {
  std::vector<int> flat;
  locked(self, [&](const OccupancyTree& tree) {
    for (const Leaf& leaf : tree.leaves(VoxelBox{})) {
      const Voxel corner = leaf.corner();
      if (leaf.occupied() == occupied) flat.insert(flat.end(), {corner.x, corner.y, corner.z, leaf.size()});
    }
  });
  return to_numpy(std::move(flat));
}

py::array_t<std::uint8_t> states(Tree& self, const py::array_t<int, py::array::c_style>& indices) {
  const int* index = indices.data();
  std::vector<std::uint8_t> out(indices.shape(0));
  locked(self, [&](const OccupancyTree& tree) {
    for (std::uint8_t& state : out) {
      state = tree.state({index[0], index[1], index[2]});
      index += 3;
    }
  });
  return to_numpy(std::move(out));
}

}  // namespace

PYBIND11_MODULE(_octree_binding, m) {
  py::class_<SweepVoxels>(m, "SweepVoxels")
      .def_readonly("free", &SweepVoxels::free)
      .def_readonly("occupied", &SweepVoxels::occupied)
      .def_readonly("dropped", &SweepVoxels::dropped)
      .def("memory_bytes", [](const SweepVoxels& self) { return self.blocks.size() * sizeof(VoxelBlock); });
  m.def("trace_sweep", &trace);
  py::class_<Tree>(m, "Tree")
      .def(py::init(&make_tree), py::arg("resolution"), py::arg("hit"), py::arg("miss"), py::arg("through"), py::arg("min"), py::arg("min_through"),
           py::arg("max"))
      .def("apply", [](Tree& self, const SweepVoxels& sweep) { locked(self, [&](OccupancyTree& tree) { tree.apply(sweep.blocks); }); })
      .def("redraw", &redraw)
      .def("column_runs", &column_runs)
      .def("leaves", &leaves)
      .def("states", &states)
      .def("known_free", &known_free)
      .def("node_count", [](Tree& self) { return locked(self, [](const OccupancyTree& tree) { return tree.size(); }); })
      .def("leaf_count", [](Tree& self) { return locked(self, [](const OccupancyTree& tree) { return tree.getNumLeafNodes(); }); })
      .def("memory_bytes", [](Tree& self) { return locked(self, [](const OccupancyTree& tree) { return tree.memoryUsage() + tree.states_bytes(); }); })
      .def("to_binary",
           [](Tree& self, const Corner& lo, const Corner& hi) {
             return py::bytes(locked(self, [&](const OccupancyTree& tree) { return tree.to_binary(box_of(lo, hi)); }));
           })
      .def("to_full", [](Tree& self) { return py::bytes(locked(self, [](const OccupancyTree& tree) { return tree.to_full(); })); })
      .def("read_binary",
           [](Tree& self, const std::string& data) { locked(self, [&](OccupancyTree& tree) { tree.read_binary(data); }); })
      .def("read_full", [](Tree& self, const std::string& data) { locked(self, [&](OccupancyTree& tree) { tree.read_full(data); }); });
  m.def("binary_nodes", &OccupancyTree::binary_nodes, "Nodes in data as of to_binary; ValueError where it is no octree.");
  m.def("full_nodes", &OccupancyTree::full_nodes, "Nodes in data as of to_full; ValueError where it is no octree.");
}
