"""Files of meshes, which robots and worlds are made of."""

from mesh_files.ros_packages import package_folders, package_roots
from mesh_files.triangles import MESH_SUFFIXES, UPS, MeshFrame, has_area, read_triangles

__all__ = ["MESH_SUFFIXES", "UPS", "MeshFrame", "has_area", "package_folders", "package_roots", "read_triangles"]
