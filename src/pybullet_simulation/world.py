"""The world: what the robot stands on and what its laser sees, as closed solids for the physics and triangles for the rays."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import open3d as o3d
from numpy.typing import NDArray

from pybullet_simulation.solids import Solid
from rigid_geometry import origin_bytes
from simulated_movers import MoverSpec
from whole_files import write_whole, written_whole
from world_files import HeightField, Surface

Array = NDArray[np.float64]

WORLD_ORIGIN = "world_origin.json"


@dataclass(frozen=True)
class World:
    """All of a world in world coordinates (m, z up): its parts, their joint mesh, and where the robot starts.

    `vertices` (V, 3) float64 and `triangles` (T, 3) int32 hold everything; the physics takes `solids` and `surfaces`.
    `extent` (2, 3) is the lowest and highest corner, walls included; `start_z` the height of the ground at the start; `origin` where the
    world's own lies in the coordinates of its file, 0 0 0 unless that is far away; `notes` what there is to say of its file. `movers` go
    about in it; they are in no mesh. `unit_hint`: what there is to say of the unit of its size.
    """

    name: str
    solids: tuple[Solid, ...]
    surfaces: tuple[Surface, ...]
    vertices: Array
    triangles: NDArray[np.int32]
    extent: Array
    start_xyyaw: tuple[float, float, float]
    start_z: float
    heightfield: HeightField | None = None
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    movers: tuple[MoverSpec, ...] = ()
    notes: tuple[str, ...] = ()
    unit_hint: str = ""

    def about(self) -> str:
        """Its size and where the robot starts, in the coordinates of its file, in a few words."""
        x, y, yaw = self.start_xyyaw
        size = " x ".join(f"{v:.1f}" for v in self.extent[1] - self.extent[0])
        ox, oy, oz = self.origin
        return f"{size} m{self.unit_hint}; the robot starts at x {x + ox:.2f} y {y + oy:.2f} z {self.start_z + oz:.2f} yaw {yaw:.2f}"

    def write_mesh(self, path: Path) -> None:
        """Writes the joint mesh (.ply, .obj, .stl), for the judge, and beside it the origin of a far world; OSError when it cannot be."""
        mesh = o3d.geometry.TriangleMesh(o3d.utility.Vector3dVector(self.vertices), o3d.utility.Vector3iVector(self.triangles))
        if any(self.origin):
            write_whole(path.with_name(WORLD_ORIGIN), origin_bytes(self.origin))
        with written_whole(path) as unfinished:
            if not o3d.io.write_triangle_mesh(unfinished, mesh):
                raise OSError(f"the world's mesh could not be written to {path}")


def joined(parts: Sequence[Solid | Surface]) -> tuple[Array, NDArray[np.int32]]:
    """All parts as one mesh: vertices (V, 3) float64, triangles (T, 3) int32."""
    offsets = np.cumsum([0, *(len(part.vertices) for part in parts)])[:-1]
    triangles = [part.triangles + offset for part, offset in zip(parts, offsets, strict=True)]
    return np.vstack([part.vertices for part in parts]), np.vstack(triangles).astype(np.int32)


def raycasting_scene(vertices: Array, triangles: NDArray[np.int32]) -> o3d.t.geometry.RaycastingScene:
    """A scene for rays against triangles, hit from both sides; one thread, for a tick's rays are too few to share."""
    scene = o3d.t.geometry.RaycastingScene(nthreads=1)
    to_tensor = o3d.core.Tensor.from_numpy
    scene.add_triangles(to_tensor(np.array(vertices, np.float32, order="C")), to_tensor(np.array(triangles, np.uint32, order="C")))
    return scene


def nearest_hits(scene: o3d.t.geometry.RaycastingScene, rays: NDArray[np.float32]) -> NDArray[np.float32]:
    """(N,) distance along each of (N, 6) rays (origin, unit direction) to the first hit; inf where there is none."""
    return hits_and_incidence(scene, rays)[0]


def hits_and_incidence(scene: o3d.t.geometry.RaycastingScene, rays: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """The same, and (N,) the cosine between ray and the hit triangle's normal, 0 to 1; any where there is no hit."""
    found = scene.cast_rays(o3d.core.Tensor.from_numpy(rays), nthreads=1)
    hits: NDArray[np.float32] = found["t_hit"].numpy()
    cosines: NDArray[np.float32] = np.abs(np.einsum("ij,ij->i", found["primitive_normals"].numpy(), rays[:, 3:]))
    return hits, cosines


def nearest_normal(scene: o3d.t.geometry.RaycastingScene, point: tuple[float, float, float]) -> NDArray[np.float32]:
    """(3,) unit normal of the triangle nearest to a point; its sign is the triangle's."""
    query = o3d.core.Tensor.from_numpy(np.array([point], np.float32))
    normal: NDArray[np.float32] = scene.compute_closest_points(query, nthreads=1)["primitive_normals"].numpy()[0]
    return normal / max(float(np.linalg.norm(normal)), 1e-12)
