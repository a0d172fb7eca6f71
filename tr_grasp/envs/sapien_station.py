"""An arm, its gripper and a camera in SAPIEN, as the hardware protocols want them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import sapien

from tr_grasp.envs.robot_bodies import link_bodies
from tr_grasp.envs.sapien_arm import SapienArm
from tr_grasp.envs.sapien_gripper import SapienGripper
from tr_grasp.envs.sapien_world import PHYSICS_HZ, SapienWorld
from tr_grasp.envs.things import Thing
from tr_grasp.hardware import RGBDImage, Station, intrinsics_of
from tr_grasp.motion.arguments import Array
from tr_grasp.robots.agents import CartesianControllerConfig, agent_class
from tr_grasp.robots.spec import robot_spec
from tr_grasp.sensing import Body, PinholeCamera, RaycastCamera, RaycastScene


class SapienCamera:
    """Ray-casts the present instant; needs no graphics driver.

    Attributes:
        camera: Pose and intrinsics.
        frame: Of its readings.
        scene: What can be seen, for pictures from elsewhere.
    """

    def __init__(self, camera: PinholeCamera, world: SapienWorld, seen: Sequence[tuple[sapien.Entity, Body]]) -> None:
        self.camera, self.frame = camera, "camera_optical_frame"
        self._world, self._entities = world, [entity for entity, _ in seen]
        self.scene = RaycastScene([body for _, body in seen])
        self._raycast = RaycastCamera(self.scene, camera)

    def poses(self) -> Array:
        """(moving, 4, 4) ``T_base_body`` of all bodies of ``scene``, now."""
        return np.stack([entity.pose.to_transformation_matrix() for entity in self._entities])

    def capture(self) -> RGBDImage:
        """What it sees now."""
        image = self._raycast.capture(self.poses())
        depth = np.where(np.isfinite(image.depth), image.depth, np.nan).astype(np.float32)
        rgb = np.round(255 * np.clip(image.colour, 0.0, 1.0)).astype(np.uint8)
        return RGBDImage(self._world.now_s, self.frame, rgb, depth, intrinsics_of(self.camera))


@dataclass(frozen=True)
class SapienStation(Station):
    """A simulated station; made by :meth:`of`."""

    arm: SapienArm
    gripper: SapienGripper
    world: SapienWorld
    camera: SapienCamera | None = None

    @classmethod
    def of(
        cls,
        robot: str,
        *,
        things: Sequence[Thing] = (),
        camera: PinholeCamera | None = None,
        physics_hz: int = PHYSICS_HZ,
    ) -> SapienStation:
        """A robot at home, with open fingers, its base at the origin.

        Args:
            robot: Its name, or the YAML file of your own.
            things: What is around it; nothing else is, not even a table.
            camera: If there is one.
            physics_hz: Steps per second.

        Raises:
            ConfigError: No such robot.
            MotionError: Two things of one name.
        """
        spec, world = robot_spec(robot), SapienWorld(things, physics_hz)
        # The agent is Task I's, for its links and gains; its own controller stays unused.
        controller = CartesianControllerConfig(joint_names=[], timestep_s=world.timestep_s)
        agent = agent_class(robot)(world.scene, 1, "cartesian", initial_pose=sapien.Pose(), controller=controller)
        articulation = agent.robot._objs[0]
        names = [joint.name for joint in articulation.active_joints]
        arm_joints, finger_joints = (
            np.array([next(i for i, name in enumerate(names) if name.endswith(wanted)) for wanted in group])
            for group in (spec.joint_names, spec.gripper.joint_names)
        )
        parts = articulation, lambda: world.now_s, world.timestep_s
        arm = SapienArm(spec, parts[0], arm_joints, *parts[1:])
        gripper = SapienGripper(spec.gripper, parts[0], finger_joints, *parts[1:])
        articulation.set_qpos(agent.controller.qpos(np.array(spec.home_q_rad)))
        arm.place(spec.home_q_rad)
        links = {name: link._objs[0] for name, link in agent.robot.links_map.items()}
        world.watch({link.entity: name for name, link in links.items() if name != spec.base_link})
        world.before_step(arm.before_step)
        world.before_step(gripper.before_step)
        if camera is None:
            return cls(arm, gripper, world)
        seen = [(links[name].entity, body) for name, body in link_bodies(agent, links).items()]
        seen += [(world.entities[thing.name], thing.visual()) for thing in things]
        return cls(arm, gripper, world, SapienCamera(camera, world, seen))
