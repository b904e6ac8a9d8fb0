"""The physics: a robot on its wheels in a world, by pybullet; forces and contacts in, poses and velocities out.

The settings are the ones that were measured to make a skid steer behave: velocity motors, cylinders as such instead of hulls,
less friction sideways, no cone friction (with it the turn rate depends on the heading in the world).
"""

import contextlib
import os
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pybullet_simulation.config import SimulationConfig
from pybullet_simulation.disturbances import Guided
from pybullet_simulation.records import Contact
from pybullet_simulation.robot_model import RobotModel
from pybullet_simulation.simulated_urdf import write_simulated_urdf
from pybullet_simulation.world import World, nearest_hits, nearest_normal, raycasting_scene
from rigid_geometry import quat_xyzw_from_transform
from robot_body import RobotBody
from simulated_movers import Part
from world_files import Surface

Array = NDArray[np.float64]

MESH_FLAGS = 1 | 2  # concave, with internal edges: wheels do not catch on the edges between coplanar triangles
TRIANGLES_AT_ONCE = 20_000
_WHEEL_CONTACT_MARGIN_RAD = 0.005  # a wheel on a surface so much steeper than its highest step makes it touches an obstacle, not ground
_CONTACT_FORCE_MIN_N = 1.0  # [N] weaker touches are not reported


@contextlib.contextmanager
def _silent_stderr() -> Iterator[None]:
    """pybullet announces its build on the C level when it is loaded; nobody who runs us wants to read that."""
    saved, null = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(null, 2)
        yield
    finally:
        os.dup2(saved, 2)
        os.close(saved)
        os.close(null)


with _silent_stderr():
    import pybullet


@dataclass(frozen=True)
class BodyState:
    """Pose of base_link in the world and velocities in world axes: `linear` (3,) of the centre of mass, `angular` (3,)."""

    R_world_base: Array
    position: Array
    centre_of_mass: Array
    linear: Array
    angular: Array


class Physics:
    """The robot in its world; every instance has a pybullet of its own."""

    def __init__(self, config: SimulationConfig, body: RobotBody, robot: RobotModel, world: World) -> None:
        """The robot stands just above its start. ValueError when pybullet cannot load the robot."""
        self._config, self._model = config, robot
        self._client = pybullet.connect(pybullet.DIRECT)
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=1.0 / config.physics_rate_hz, enableConeFriction=0, deterministicOverlappingPairs=1, physicsClientId=self._client
        )
        pybullet.setGravity(0.0, 0.0, -9.81, physicsClientId=self._client)
        self._add_world(world)
        self._surface = raycasting_scene(world.vertices, world.triangles)
        self._robot = self._add_robot(robot, world, body.base_height_m)
        self._names, self._movers = self._link_names(), dict[int, str]()
        self._joints = {self._joint(i): i for i in range(pybullet.getNumJoints(self._robot, physicsClientId=self._client))}
        self._wheels = [self._joints[wheel.joint] for wheel in robot.wheels]
        self._tilt = None if robot.tilt_joint is None else self._joints[robot.tilt_joint]
        self._radii = self._rolling()
        self._steep_z = self._steepest(body)
        self._let_casters_roll()
        self._com = np.array(pybullet.getDynamicsInfo(self._robot, -1, physicsClientId=self._client)[3])
        self.set_grip(config.lateral_friction_ratio)

    def close(self) -> None:
        """Ends this instance's pybullet."""
        if self._client >= 0:
            pybullet.disconnect(physicsClientId=self._client)
            self._client = -1

    def _rolling(self) -> dict[int, float]:
        """Radius of every wheel and caster, m."""
        links = {name: index for index, name in self._names.items()}
        radii = {w.link: w.radius_m for w in self._model.wheels} | {c.link: c.radius_m for c in self._model.casters}
        return {links[link]: radius_m for link, radius_m in radii.items()}

    def _steepest(self, body: RobotBody) -> dict[int, float]:
        """By wheel and caster, how little the normal of a surface may point up that it stands on: one steeper is an obstacle."""
        margin = _WHEEL_CONTACT_MARGIN_RAD
        return {link: float(np.cos(body.climbing_rad(radius_m) + margin)) for link, radius_m in self._radii.items()}

    def _let_casters_roll(self) -> None:
        """Joints that nothing drives turn freely, against the engine's habit of braking them; a ball slides as if it rolled."""
        driven, links = {*self._wheels, self._tilt}, {name: index for index, name in self._names.items()}
        for index in set(self._joints.values()) - driven:
            if pybullet.getJointInfo(self._robot, index, physicsClientId=self._client)[2] == pybullet.JOINT_REVOLUTE:
                pybullet.setJointMotorControl2(self._robot, index, pybullet.VELOCITY_CONTROL, force=0.0, physicsClientId=self._client)
        for caster in self._model.casters:
            grip = 1.0 if caster.rolls else self._config.caster_friction
            pybullet.changeDynamics(
                self._robot, links[caster.link], lateralFriction=grip, rollingFriction=0.0, physicsClientId=self._client
            )

    def _joint(self, index: int) -> str:
        return str(pybullet.getJointInfo(self._robot, index, physicsClientId=self._client)[1].decode())

    def _link_names(self) -> dict[int, str]:
        info = [
            pybullet.getJointInfo(self._robot, i, physicsClientId=self._client)
            for i in range(pybullet.getNumJoints(self._robot, physicsClientId=self._client))
        ]
        return {-1: "base_link"} | {i: str(one[12].decode()) for i, one in enumerate(info)}

    def _add_world(self, world: World) -> None:
        for solid in world.solids:
            if solid.box is not None:
                shape = {"shapeType": pybullet.GEOM_BOX, "halfExtents": solid.box.half_extents.tolist()}
                self._add_static(shape, solid.box.T_world_box)
            else:
                self._add_static({"shapeType": pybullet.GEOM_MESH, "vertices": solid.vertices.tolist()}, np.eye(4))
        for surface in world.surfaces:
            self._add_surface(surface)

    def _add_surface(self, surface: Surface) -> None:
        """In pieces, for pybullet takes only so many triangles at once."""
        for first in range(0, len(surface.triangles), TRIANGLES_AT_ONCE):
            used, local = np.unique(surface.triangles[first : first + TRIANGLES_AT_ONCE], return_inverse=True)
            mesh = {"vertices": surface.vertices[used].tolist(), "indices": local.ravel().tolist()}
            self._add_static({"shapeType": pybullet.GEOM_MESH, "flags": MESH_FLAGS, **mesh}, np.eye(4))

    def _add_static(self, shape: dict[str, object], T_world_shape: Array) -> int:
        collision = pybullet.createCollisionShape(physicsClientId=self._client, **shape)
        position, quat = T_world_shape[:3, 3].tolist(), quat_xyzw_from_transform(T_world_shape).tolist()
        body = pybullet.createMultiBody(0, collision, basePosition=position, baseOrientation=quat, physicsClientId=self._client)
        pybullet.changeDynamics(body, -1, lateralFriction=self._config.friction, rollingFriction=0.0, physicsClientId=self._client)
        return int(body)

    def _add_robot(self, robot: RobotModel, world: World, base_height_m: float) -> int:
        x, y, yaw = world.start_xyyaw
        flags = pybullet.URDF_USE_IMPLICIT_CYLINDER | pybullet.URDF_USE_INERTIA_FROM_FILE
        with tempfile.TemporaryDirectory() as folder:
            try:
                return int(
                    pybullet.loadURDF(
                        str(write_simulated_urdf(robot.urdf_path, Path(folder), robot.tilt_joint)),
                        basePosition=[x, y, world.start_z + base_height_m + 0.02],
                        baseOrientation=pybullet.getQuaternionFromEuler([0.0, 0.0, yaw]),
                        flags=flags,
                        physicsClientId=self._client,
                    )
                )
            except pybullet.error as error:
                raise ValueError(f"pybullet cannot load the robot {robot.urdf_path}: {error}") from error

    def set_grip(self, sideways_ratio: float, share: float = 1.0) -> None:
        """Friction across the tyres as a share of the one along them, and both as a share of what they are, from the next step on."""
        for wheel in self._wheels:
            pybullet.changeDynamics(
                self._robot,
                wheel,
                lateralFriction=share,
                rollingFriction=0.0,
                anisotropicFriction=[1.0, sideways_ratio, 1.0],
                physicsClientId=self._client,
            )

    def set_wheel_speeds(self, speeds_rps: Array) -> None:
        """Target speeds (W,) of the wheels in the order of the model's."""
        pybullet.setJointMotorControlArray(
            self._robot,
            self._wheels,
            pybullet.VELOCITY_CONTROL,
            targetVelocities=(speeds_rps * self._model.forward_of_wheel).tolist(),
            forces=[self._config.wheel_torque_nm] * len(self._wheels),
            physicsClientId=self._client,
        )

    def set_tilt(self, tilt_rad: float) -> None:
        """Put the laser at a tilt: its drive is stiff, and its weight too small to move the robot. One that is fixed stays."""
        if self._tilt is None:
            return
        pybullet.resetJointState(self._robot, self._tilt, tilt_rad, 0.0, physicsClientId=self._client)

    def step(self) -> BodyState:
        """One step of the physics, and the state after it."""
        pybullet.stepSimulation(physicsClientId=self._client)
        return self.state()

    def state(self) -> BodyState:
        """The state now; pybullet gives the centre of mass, from which base_link follows."""
        com, quat = pybullet.getBasePositionAndOrientation(self._robot, physicsClientId=self._client)
        linear, angular = pybullet.getBaseVelocity(self._robot, physicsClientId=self._client)
        R = np.array(pybullet.getMatrixFromQuaternion(quat)).reshape(3, 3)
        return BodyState(R, np.array(com) - R @ self._com, np.array(com), np.array(linear), np.array(angular))

    def put(self, guided: Guided) -> BodyState:
        """Puts the robot where hands have it, and the state then; wheels and mount turn on."""
        R = guided.T_world_base[:3, :3]
        com = guided.T_world_base[:3, 3] + R @ self._com
        quat = quat_xyzw_from_transform(guided.T_world_base).tolist()
        velocity = guided.linear + np.cross(guided.angular, com - guided.T_world_base[:3, 3])
        pybullet.resetBasePositionAndOrientation(self._robot, com.tolist(), quat, physicsClientId=self._client)
        pybullet.resetBaseVelocity(self._robot, velocity.tolist(), guided.angular.tolist(), physicsClientId=self._client)
        return self.state()

    def wheel_angles(self) -> Array:
        """(W,) angles of the wheels in rad, in the order of the model's."""
        states = pybullet.getJointStates(self._robot, self._wheels, physicsClientId=self._client)
        return np.array([state[0] for state in states]) * self._model.forward_of_wheel

    def add_movers(self, parts: Sequence[tuple[str, Part]]) -> None:
        """Bodies for all parts of movers, each with its mover's name; they push and are not pushed."""
        self._movers = {self._add_part(part): name for name, part in parts}

    def _add_part(self, part: Part) -> int:
        if part.is_box:
            return self._add_static({"shapeType": pybullet.GEOM_BOX, "halfExtents": part.half}, np.eye(4))
        post = {"shapeType": pybullet.GEOM_CYLINDER, "radius": part.half[0], "height": 2.0 * part.half[2]}
        return self._add_static(post, np.eye(4))

    def place_movers(self, poses: Array) -> None:
        """Put all parts at (P, 5) x, y, z, yaw and pitch of their middles."""
        for body, (x, y, z, yaw, pitch) in zip(self._movers, poses.tolist(), strict=True):
            turned = pybullet.getQuaternionFromEuler([0.0, pitch, yaw])
            pybullet.resetBasePositionAndOrientation(body, [x, y, z], turned, physicsClientId=self._client)

    def contacts(self, before: BodyState) -> list[Contact]:
        """What of the body touches anything, and what of wheels and casters touches something too steep to be ground.

        Its speed is the one that the robot had there `before`.
        """
        found = []
        for point in pybullet.getContactPoints(bodyA=self._robot, physicsClientId=self._client):
            other, link, normal, force = point[2], point[3], point[7], point[9]
            steep_z = None if other in self._movers else self._steep_z.get(link)
            is_ground = steep_z is not None and (
                normal[2] > steep_z or self._is_level(point[6], steep_z) or self._is_climbed(link, point[6], normal)
            )
            if other != self._robot and not is_ground and force >= _CONTACT_FORCE_MIN_N:
                speed = float(np.linalg.norm(before.linear + np.cross(before.angular, np.array(point[5]) - before.centre_of_mass)))
                found.append(Contact(self._names[link], speed, float(force), self._movers.get(other, "")))
        return found

    def _is_level(self, position: tuple[float, float, float], steep_z: float) -> bool:
        """Whether the world's surface nearest to a contact is ground: at the edges between triangles the engine invents steep normals."""
        return bool(abs(nearest_normal(self._surface, position)[2]) > steep_z)

    def _is_climbed(self, link: int, position: tuple[float, float, float], normal: tuple[float, float, float]) -> bool:
        """Whether a wheel or caster only meets the upright face of a step that it climbs: at the height of its highest step nothing stands
        there, as far behind the contact as the steepest ground comes up to it."""
        radius_m, steep_z = self._radii[link], self._steep_z[link]
        centre = pybullet.getLinkState(self._robot, link, physicsClientId=self._client)[0]
        step_m = radius_m * (1.0 - steep_z)
        height, level_m = centre[2] - radius_m + step_m, float(np.hypot(normal[0], normal[1]))
        if position[2] > height or level_m == 0.0:
            return False
        back = np.array([normal[0], normal[1], 0.0]) / level_m
        behind_m = step_m * steep_z / float(np.sqrt(1.0 - steep_z**2))
        ray = np.concatenate([np.array([position[0], position[1], height]) + radius_m * back, -back])
        return bool(nearest_hits(self._surface, ray[None].astype(np.float32))[0] > radius_m + behind_m)
