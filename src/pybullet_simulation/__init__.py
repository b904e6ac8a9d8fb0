"""The simulated robot and its worlds; stands where a real Husky, its drivers and a physics server would.

`load_world` makes a world, `Simulation` puts a robot into it and advances both by ticks of 0.05 s. No ROS, no clock, no display.
"""

from pybullet_simulation.config import SimulationConfig
from pybullet_simulation.disturbances import DISTURBANCES_FILE, KINDS, disturbances_csv
from pybullet_simulation.lidar_config import SpinningLidarConfig
from pybullet_simulation.open_ground import crowd_in
from pybullet_simulation.realism import HARDWARE_OR_IDEAL, IDEAL, IDEAL_TIMING, realistic
from pybullet_simulation.records import Delivery, ImuSample, JointSample, Revolution, Scan, ScanGeometry, TickData, Truth, WheelOdometry
from pybullet_simulation.simulation import TICK_S, Simulation
from pybullet_simulation.timing_config import SENSOR_TOPICS, TimingConfig
from pybullet_simulation.world import World
from pybullet_simulation.worlds import WORLDS, load_world
from world_files import MeshFrame, WorldDescription

__all__ = [
    "DISTURBANCES_FILE",
    "HARDWARE_OR_IDEAL",
    "IDEAL",
    "IDEAL_TIMING",
    "KINDS",
    "SENSOR_TOPICS",
    "TICK_S",
    "WORLDS",
    "Delivery",
    "ImuSample",
    "JointSample",
    "Revolution",
    "Scan",
    "ScanGeometry",
    "Simulation",
    "SimulationConfig",
    "SpinningLidarConfig",
    "TickData",
    "TimingConfig",
    "Truth",
    "WheelOdometry",
    "World",
    "WorldDescription",
    "MeshFrame",
    "crowd_in",
    "disturbances_csv",
    "load_world",
    "realistic",
]
