"""Small good files of every kind that the project reads, and the reader of each: what the fuzzer damages.

A reader is called as the command lines call it, so that whatever stands behind them is tested, too.
"""

from __future__ import annotations

import io
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
import trimesh.exchange.dae
import yaml
from PIL import Image

sys.path += [str(Path(__file__).parents[1] / "unit" / part) for part in ("mapping_tools", "pose_graph_mapping", "terrain_tools")]

from recordings import TRUTH, cloud_message, odometry_message, write_bag
from rosbags.rosbag1 import Writer
from terrain_maps import floor, octree_file

from explore_command.parameters import override_problems, read_profile
from mapping_tools import map_bag, register_clouds
from mapping_tools.cloud_files import read_cloud
from mapping_tools.configuration import configured
from mapping_tools.pose_files import read_poses
from pose_graph_mapping.graph.graph_files import g2o_text, read_graph_file
from pose_graph_mapping.graph.graph_measurements import Edge, EdgeKind
from rigid_geometry import read_origin, rpy_from_rotation
from robot_body import DEFAULT_ROBOT_FILE
from terrain_tools.criteria import Criteria, read_criteria
from terrain_tools.map_source import read_map
from world_files import ModelPaths, read_description, read_height_map, read_mesh, read_sdf

_MOST_BYTES = 3e8  # a map may take
_RNG = np.random.default_rng(1)
_POINTS = _RNG.uniform(-5.0, 5.0, (60, 3))
_GUESS = b'{"transform": [[1,0,0,1],[0,1,0,2],[0,0,1,3],[0,0,0,1]], "covariance": null}\n'


@dataclass(frozen=True)
class Kind:
    """A file by its name, its good bytes, what reads it, and whether an error of it names it."""

    name: str
    content: bytes
    read: Callable[[Path], object]
    names_file: bool = True


def kinds(folder: Path) -> list[Kind]:
    """All of them; `folder` is for files that only their writers can make."""
    found = [Kind(name, content, read_cloud) for name, content in _clouds().items()]
    found += [Kind(f"{name}.txt", text, read_poses) for name, text in _poses().items()]
    found += [
        Kind("map_origin.json", b'{"origin_m": [448260.0, 5412345.0, 412.0]}\n', read_origin),
        Kind("guess.json", _GUESS, _read_guess),
    ]
    found += [Kind(name, content, read_mesh) for name, content in _meshes().items()]
    found += [Kind(name, content, lambda path: read_height_map(path, (10.0, 10.0, 1.0))) for name, content in _pictures().items()]
    found.append(Kind("hall.world", _SDF, lambda path: read_sdf(path, ModelPaths())))
    found.append(Kind("hall.yaml", b"world: hall.world\nstart: [1, 2, 1.5]\narea: [20, 15]\nmodels: [m]\nground: 0\n", read_description))
    found += [Kind(name, content, read_graph_file) for name, content in _graphs().items()]
    found += [Kind(name, content, _read_octree) for name, content in _octrees(folder).items()]
    found.append(Kind("robot.yaml", Path(DEFAULT_ROBOT_FILE).read_bytes(), lambda path: read_criteria(robot_file=path)))
    found.append(Kind("profile.yaml", yaml.safe_dump(_PROFILE).encode(), lambda path: override_problems(read_profile(str(path)))))
    found += [Kind(name, content, _read_recording, names_file=False) for name, content in _bags(folder).items()]
    return found


_SDF = b"""<?xml version='1.0'?>
<sdf version='1.9'><world name='w'><include><uri>model://ground_plane</uri></include><plugin filename='p.so'/>
<frame name='f'><pose>1 2 0 0 0 0.5</pose></frame>
<model name='a'><pose relative_to='f' degrees='true'>1 2 3 0 0 90</pose><link name='l'><pose relative_to='b::k'>0 0 1 0 0 0</pose>
<collision name='c'><geometry><box><size>1 2 3</size></box></geometry></collision>
<visual name='v'><geometry><sphere><radius>0.5</radius></sphere></geometry></visual></link>
<model name='b' placement_frame='k'><link name='k'><collision name='c'><geometry><cylinder><radius>1</radius><length>2</length></cylinder>
</geometry></collision></link></model></model></world></sdf>
"""
_PROFILE = {"octomap_server_3dnav_node": {"resolution": 0.1, "frontier": {"min_voxels": 3}}, "robot": {"max_step_m": 0.08}}


def _read_octree(path: Path) -> object:
    return read_map(path, Criteria(), None, None, _MOST_BYTES, lambda text: None)


def _read_recording(path: Path) -> object:
    options = map_bag.parser().parse_args([str(path), "--out", "nowhere"])
    return list(map_bag.recorded(options, configured([]).sensors).sweeps())


def _read_guess(path: Path) -> object:
    return register_clouds.guess_of(register_clouds.parser().parse_args(["a.ply", "b.ply", "--guess-file", str(path)]))


def _clouds() -> dict[str, bytes]:
    rows, text = _POINTS.astype("<f4"), "\n".join(" ".join(f"{v:.4f}" for v in row) for row in _POINTS).encode() + b"\n"
    pcd = "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z _\nSIZE 4 4 4 1\nTYPE F F F U\nCOUNT 1 1 1 4\nWIDTH 60\nHEIGHT 1\n"
    pcd += "VIEWPOINT 0 0 0 1 0 0 0\nPOINTS 60\nDATA "
    padded = np.hstack([rows.view("u1"), np.zeros((60, 4), "u1")]).tobytes()
    columns = np.ascontiguousarray(rows.T).tobytes()
    packed = b"".join(bytes([len(part) - 1]) + part for part in (columns[k : k + 32] for k in range(0, len(columns), 32)))
    ply = "ply\nformat {} 1.0\nelement vertex 60\nproperty float x\nproperty float y\nproperty float z\nend_header\n"
    vtk = "# vtk DataFile Version 3.0\nby hand\n{}\nDATASET POLYDATA\nPOINTS 60 float\n"
    sweep = io.BytesIO()
    np.savez(sweep, points=_POINTS, origins=0.0 * _POINTS, stamp_s=1.0)
    return {
        "text.pcd": pcd.replace(" _", "").replace(" 1\nTYPE F F F U\nCOUNT 1 1 1 4", "\nTYPE F F F\nCOUNT 1 1 1").encode()
        + b"ascii\n"
        + text,
        "plain.pcd": pcd.encode() + b"binary\n" + padded,
        "packed.pcd": pcd.encode() + b"binary_compressed\n" + np.array([len(packed), len(columns)], "<u4").tobytes() + packed,
        "text.ply": ply.format("ascii").encode() + text,
        "little.ply": ply.format("binary_little_endian").encode() + rows.tobytes(),
        "big.ply": ply.format("binary_big_endian").encode() + rows.astype(">f4").tobytes(),
        "text.vtk": vtk.format("ASCII").encode() + text + b"VERTICES 1 2\n1 0\n",
        "big.vtk": vtk.format("BINARY").encode() + rows.astype(">f4").tobytes(),
        "text.xyz": text,
        "sweep.npz": sweep.getvalue(),
    }


def _poses() -> dict[str, bytes]:
    tum = "# stamp x y z qx qy qz qw\n" + "".join(f"{k}.5 {k} 2.0 0 0 0 0 1\n" for k in range(8))
    return {"tum": tum.encode(), "kitti": b"".join(b"1 0 0 %d 0 1 0 2 0 0 1 0\n" % k for k in range(8))}


def _meshes() -> dict[str, bytes]:
    box = trimesh.creation.box((4.0, 4.0, 0.5))
    text = {name: box.export(file_type=kind) for name, kind in (("box.obj", "obj"), ("text.stl", "stl_ascii"))}
    binary = {name: box.export(file_type=kind) for name, kind in (("box.stl", "stl"), ("mesh.ply", "ply"))}
    return {name: value.encode() if isinstance(value, str) else value for name, value in (text | binary).items()} | {
        "box.dae": trimesh.exchange.dae.export_collada(box)
    }


def _pictures() -> dict[str, bytes]:
    found = {}
    for name, kind in (("grey.png", np.uint8), ("deep.png", np.uint16)):
        file = io.BytesIO()
        Image.fromarray(_RNG.integers(0, 255, (9, 9)).astype(kind)).save(file, "PNG")
        found[name] = file.getvalue()
    return found


def _graphs() -> dict[str, bytes]:
    poses = dict(enumerate(TRUTH))
    edges = [Edge(k, k + 1, np.linalg.inv(TRUTH[k]) @ TRUTH[k + 1], 0.01 * np.eye(6), EdgeKind.ODOMETRY) for k in range(4)]
    numbers = [" ".join(map(str, (*T[:3, 3], *rpy_from_rotation(T[:3, :3])))) for T in TRUTH]
    upper = " ".join(map(str, np.eye(6)[np.triu_indices(6)]))
    toro = "".join(f"VERTEX3 {k} {text}\n" for k, text in enumerate(numbers)) + f"EDGE3 0 1 1 0 0 0 0 0 {upper}\n"
    return {"graph.g2o": g2o_text(poses, edges, [0]).encode(), "toro.graph": toro.encode()}


def _octrees(folder: Path) -> dict[str, bytes]:
    return {name: Path(octree_file(folder / name, floor(8))).read_bytes() for name in ("map.bt", "map.ot")}


def _bags(folder: Path) -> dict[str, bytes]:
    cloud = (_POINTS.astype(np.float32), np.zeros((60, 3), np.float32))
    messages = [m for k in range(3) for m in (("/odom", odometry_message(k, TRUTH[0])), ("/sweep_cloud", cloud_message(k, *cloud)))]
    forms = {"plain.bag": None, "bz2.bag": Writer.CompressionFormat.BZ2, "lz4.bag": Writer.CompressionFormat.LZ4}
    return {name: write_bag(folder / name, messages, form).read_bytes() for name, form in forms.items()}
