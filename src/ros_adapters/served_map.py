"""The map that octomap_server_3dnav_node serves: its octree, what is drawn of it on topics and in files, and its services."""

import math
import time
from functools import partial
from pathlib import Path

import numpy as np
import rospy
from explore_3dnav.msg import TerrainGrid
from explore_3dnav.srv import LoadMap, LoadMapRequest, LoadMapResponse
from numpy.typing import NDArray
from std_srvs.srv import Trigger, TriggerResponse

from finished_maps import load_map
from octomap_server_3dnav.exploration.decide import EXPLORING
from octomap_server_3dnav.navigation.headroom import with_seen_headroom
from octomap_server_3dnav.navigation.local_grid import project
from octomap_server_3dnav.navigation.passages import navigable_terrain
from octomap_server_3dnav.navigation.standing import with_standing
from octomap_server_3dnav.octree.map_builder import RUNS_MARGIN_M, MapBuilder
from octomap_server_3dnav.terrain.classify import Terrain
from rigid_geometry.transforms import Transform
from ros_adapters.deciding_memory import DecidingMemory
from ros_adapters.frames import frames
from ros_adapters.grid_messages import message_of_grid
from ros_adapters.map_files import MapFiles
from ros_adapters.map_topics import MapTopics
from ros_adapters.node import Node
from ros_adapters.octomap_messages import BoundingBoxQuery, GetOctomap, whole_octomap
from ros_adapters.plan_services import PlanServices
from ros_adapters.tf_lookup import TransformsWhenAsked


class ServedMap:
    """Topics, files and services of one map; whoever calls holds the node's lock, the services take it.

    builder: the map itself; its owner adds sweeps and clouds to it. around: where the robot was in the map that was drawn last (4, 4), None
    where that is not known. is_loaded: whether it is a finished map.
    """

    def __init__(self, node: Node, builder: MapBuilder, memory: DecidingMemory, transforms: TransformsWhenAsked, topics: MapTopics) -> None:
        """memory: whose explorer's configurations classify and plan, and whose times take what classification takes."""
        self.builder, self.is_loaded = builder, False
        self.around: Transform | None = None
        self.stamp_s = math.nan
        self._node, self._transforms, self._topics = node, transforms, topics
        self._explorer, self._timing = memory.explorer, memory.timing
        self._files = MapFiles(node.run_folder(), partial(node.diagnostics.on_terminal, "the map is not on disk"))
        self._plans = PlanServices(node, self._explorer, transforms)
        self._local = node.publisher("local_terrain", TerrainGrid, large=True, latch=True)
        node.serve("octomap_binary", GetOctomap, partial(self._on_get_octomap, binary=True))
        node.serve("octomap_full", GetOctomap, partial(self._on_get_octomap, binary=False))
        node.serve("~clear_bbx", BoundingBoxQuery, self._on_clear_bbx)
        node.serve("~load", LoadMap, self._on_load)
        rospy.on_shutdown(self._files.close)

    def serve_saving(self) -> None:
        """Serves ~save, once the map is that of the process before: who asks for its files meanwhile asks again."""
        self._node.serve("~save", Trigger, self._on_save)

    def terrain_within(self, T_map_base: Transform, radius_m: float | None) -> Terrain:
        """The terrain around the robot, or all of it. The time that it takes is counted as classification, but for drawing sweeps anew that
        the pose graph has moved: that is mapping."""
        reach_m = radius_m if radius_m is None else radius_m + RUNS_MARGIN_M
        self.builder.draw_moved(T_map_base, reach_m)
        with self._timing.of("global" if radius_m is None else "local"):
            runs = self.builder.runs_around(T_map_base, reach_m)
            return navigable_terrain(runs, T_map_base, self._explorer.terrain_settings, radius_m, self.builder.heights)

    def draw(self, stamp_s: float, T_map_base: Transform | None) -> None:
        """A map about which nothing is decided, around the robot, of which None says that nobody knows where it stands."""
        self.around = T_map_base
        if T_map_base is None:
            why = f"tf does not tell {frames().base!r} in {frames().map!r}: set base_frame_id"
            self._plans.forget(f"the map has no terrain: {why}")
            self._node.diagnostics.holds("no terrain", why)
            self._show(stamp_s, None, None)
        else:
            self.publish_local(stamp_s, self.terrain_within(T_map_base, self._explorer.config.local_radius_m))
            self.show_and_save(stamp_s, T_map_base, None, None)
        self._node.diagnostics.report(stamp_s)

    def standing(self) -> NDArray[np.float64] | None:
        """(3,) where the robot stood on the ground in the map that was drawn last; None without one."""
        T = self.around
        return None if T is None else T[:3, 3] - self.builder.robot.base_height_m * T[:3, 2]

    def draw_again(self) -> None:
        """What was drawn last, by what holds now; nothing while no map is drawn around a robot."""
        if self.around is not None:
            self.draw(self.stamp_s, self.around)

    def publish_local(self, stamp_s: float, terrain: Terrain) -> None:
        """The robot's storey around it, for the costmap (6.2.1)."""
        grid = project(terrain, terrain.robot_xyz[:2], 2 * self._explorer.config.local_radius_m)
        grid = with_standing(grid, terrain, self.builder.robot)
        self._local.publish(message_of_grid(stamp_s, frames().map, grid))

    def show_and_save(self, stamp_s: float, T_map_base: Transform, whole: Terrain | None, path: NDArray[np.float64] | None) -> None:
        """The whole map's classes, for whoever looks and for the files; where the decision did not need them, it did not wait for them.

        Nor for what older sweeps have moved elsewhere: `tree` draws that now.
        """
        self.around, tree = T_map_base, self.builder.tree
        if whole is None:
            whole = navigable_terrain(tree.column_runs(), T_map_base, self._explorer.terrain_settings, None, self.builder.heights)
        terrain = self._explorer.with_way_out(whole)
        if self.is_loaded or not self._explorer.explores or self._explorer.state not in EXPLORING:
            terrain = with_seen_headroom(terrain, self._explorer.terrain_settings)
        self._plans.know(stamp_s, terrain)
        self._node.diagnostics.holds("no terrain", "")
        self._node.diagnostics.values["ground m2"] = f"{terrain.ground_area_m2:.1f}"
        self._show(stamp_s, terrain, path)

    def load(self, path: Path) -> str:
        """Takes a finished map for an empty one, and says in words what it is of; ValueError names what is wrong."""
        with self._node.lock:
            if self.builder.content:
                raise ValueError(f"the map is of {self.builder.content}: call ~reset before another one is loaded")
            found = load_map(path, self.builder)
            self.builder, self.is_loaded = found.builder, True
            T_map_base = self._transforms.newest(frames().base)
            self.draw(time.time(), found.T_map_base if T_map_base is None else T_map_base)
        return found.described

    def forget(self) -> None:
        """The map is empty; what is on disk stays there until it is written again."""
        was = self.builder
        self.builder = MapBuilder(was.config, was.tree.sensor_model, was.robot, was.shelf.another())
        self._plans.forget("no sweep is in the map yet")
        self._files.forget()
        if not math.isnan(self.stamp_s):
            self._topics.publish(self.stamp_s, self.builder.tree, None, None)
        self.around, self.stamp_s, self.is_loaded = None, math.nan, False

    def _show(self, stamp_s: float, terrain: Terrain | None, path: NDArray[np.float64] | None) -> None:
        self.stamp_s, tree = stamp_s, self.builder.tree
        self._node.diagnostics.values["voxels"] = tree.leaf_count
        self._topics.publish(stamp_s, tree, terrain, path)
        self._files.save(tree, terrain, path)

    def _on_get_octomap(self, _request: object, binary: bool) -> object:
        with self._node.lock:
            if math.isnan(self.stamp_s):
                raise rospy.ServiceException("no sweep is in the map yet")
            return GetOctomap._response_class(whole_octomap(self.stamp_s, self.builder.tree, binary=binary))

    def _on_clear_bbx(self, request: object) -> object:
        """What is known in the box is free from now on, for decisions, topics and files."""
        low, high = ((p.x, p.y, p.z) for p in (request.min, request.max))  # type: ignore[attr-defined]
        with self._node.lock:
            self.builder.clear_box(low, high)
            self.draw_again()
        return BoundingBoxQuery._response_class()

    def _on_save(self, _request: object) -> TriggerResponse:
        with self._node.lock:  # a sweep's files are asked for when its map is drawn, after the decision
            pass
        return TriggerResponse(*self._files.wait())

    def _on_load(self, request: LoadMapRequest) -> LoadMapResponse:
        try:
            return LoadMapResponse(True, self.load(Path(request.path).expanduser()))
        except ValueError as error:
            self._node.diagnostics.dropped("map not loaded", str(error))
            return LoadMapResponse(False, str(error))
