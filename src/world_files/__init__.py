"""Worlds from files: meshes, height maps, SDF with its models, and the YAML file that says what of them a robot explores.

Files go in, triangles in metres with z up come out; nothing here knows a robot or the physics.
"""

from mesh_files import MESH_SUFFIXES, UPS, MeshFrame
from world_files.closed_solids import OPEN, closed_solids
from world_files.height_map import HeightMap, read_height_map, terrain_between
from world_files.mesh_file import cut_to, near_origin, read_mesh
from world_files.model_paths import ModelPaths
from world_files.sdf_world import SDF_SUFFIXES, SdfWorld, read_sdf
from world_files.surfaces import HeightField, Mesh, Surface, surface_from_heights
from world_files.world_yaml import DESCRIPTION_SUFFIXES, WorldDescription, described, read_description

__all__ = [
    "DESCRIPTION_SUFFIXES",
    "MESH_SUFFIXES",
    "OPEN",
    "SDF_SUFFIXES",
    "UPS",
    "HeightField",
    "HeightMap",
    "Mesh",
    "MeshFrame",
    "ModelPaths",
    "SdfWorld",
    "Surface",
    "WorldDescription",
    "closed_solids",
    "cut_to",
    "described",
    "near_origin",
    "read_description",
    "read_height_map",
    "read_mesh",
    "read_sdf",
    "surface_from_heights",
    "terrain_between",
]
