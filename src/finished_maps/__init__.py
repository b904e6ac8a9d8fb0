"""Finished maps on disk, for whoever goes on with one: the terrain node, and tools without ROS."""

from finished_maps.loading import SWEEPS, LoadedMap, load_map

__all__ = ["SWEEPS", "LoadedMap", "load_map"]
