"""A robot, a table and a box in ManiSkill, without a task."""

from __future__ import annotations

import mani_skill.envs  # noqa: F401 -- registers what the scene needs
import numpy as np
import sapien
from mani_skill.envs.scene import ManiSkillScene
from mani_skill.envs.utils.system.backend import parse_sim_and_render_backend
from sapien import physx

from tr_grasp.robots.agents import CartesianControllerConfig, agent_class
from tr_grasp.robots.cartesian import ToolLimits

PHYSICS_HZ, CONTROL_HZ = 100, 4
LIMITS = ToolLimits(np.array([0.38, -0.12, 0.012]), np.array([0.62, 0.12, 0.26]))


class BareScene:
    """Steps a robot by actions (5,)."""

    def __init__(self, robot: str, box_m=(0.04, 0.04, 0.05), box_at=(0.5, 0.0), box_yaw_rad: float = 0.0) -> None:
        physx.set_scene_config(enable_tgs=True)
        physx.set_body_config(solver_position_iterations=15, solver_velocity_iterations=1)
        physx.set_shape_config(contact_offset=0.005)
        physx.set_default_material(1.0, 1.0, 0.0)
        system = physx.PhysxCpuSystem()
        system.timestep = 1 / PHYSICS_HZ
        self.scene = ManiSkillScene([sapien.Scene([system])], backend=parse_sim_and_render_backend("physx_cpu", "none"))
        controller = CartesianControllerConfig(
            joint_names=[], substeps_n=PHYSICS_HZ // CONTROL_HZ, timestep_s=1 / PHYSICS_HZ, limits=LIMITS
        )
        self.agent = agent_class(robot)(
            self.scene, CONTROL_HZ, "cartesian", initial_pose=sapien.Pose(), controller=controller
        )
        ground = self.scene.create_actor_builder()
        ground.add_plane_collision(sapien.Pose(q=[0.7071068, 0, -0.7071068, 0]))
        ground.initial_pose = sapien.Pose()
        ground.build_static("ground")
        half = np.array(box_m) / 2
        box = self.scene.create_actor_builder()
        box.add_box_collision(half_size=half, density=0.15 / float(np.prod(box_m)))
        box.initial_pose = sapien.Pose([*box_at, half[2]], [np.cos(box_yaw_rad / 2), 0, 0, np.sin(box_yaw_rad / 2)])
        self.box = box.build("box")
        self.system = system
        self.robot = self.agent.robot._objs[0]
        q = self.agent.controller.qpos(self.agent.home_arm_q)
        self.robot.set_qpos(q)
        self.robot.set_qvel(np.zeros_like(q))
        self.agent.controller.reset()

    @property
    def controller(self):
        return self.agent.controller

    def step(self, action) -> None:
        self.controller.set_action(np.asarray(action, float))
        for _ in range(PHYSICS_HZ // CONTROL_HZ):
            self.controller.before_simulation_step()
            self.system.step()

    def go_to(self, position, yaw_rad: float = 0.0, gripper: float = 1.0, steps: int = 20) -> None:
        """Steps towards a tcp position (3,) and a turn from home."""
        for _ in range(steps):
            target = self.controller.target
            move = np.clip((np.asarray(position) - target.position) / 0.05, -1, 1)
            self.step([*move, np.clip((yaw_rad - target.yaw_rad) / 0.4, -1, 1), gripper])

    def box_position(self) -> np.ndarray:
        return self.box.pose.p[0].numpy().astype(float)
