"""Arms as ManiSkill agents, with a Cartesian controller and without any need for a renderer."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
import sapien
from gymnasium import spaces
from mani_skill.agents.controllers.base_controller import BaseController, ControllerConfig
from mani_skill.agents.robots.panda import Panda
from mani_skill.utils import sapien_utils
from mani_skill.utils.building.urdf_loader import URDFLoader
from numpy.typing import ArrayLike, NDArray

from tr_grasp.robots.cartesian import (
    FingerDrive,
    ToolLimits,
    ToolTarget,
    inverse_kinematics,
    next_target,
    pose_of,
)

Array = NDArray[np.floating]


FINGERS = ("panda_leftfinger", "panda_rightfinger")


class SapienKinematics:
    """Kinematics of a loaded articulation (SAPIEN's own Pinocchio model); the base frame is the root link's."""

    def __init__(self, articulation: sapien.physx.PhysxArticulation, tcp_link: str, arm_dof: int) -> None:
        self._model = articulation.create_pinocchio_model()
        names = [link.name for link in articulation.links]
        self._tcp = next(i for i, name in enumerate(names) if name.endswith(tcp_link))
        self._arm_dof = arm_dof
        self._rest = np.zeros(articulation.dof - arm_dof)

    def pose(self, q: Array) -> Array:
        """``T_base_tcp`` (4, 4)."""
        self._model.compute_forward_kinematics(np.concatenate([q, self._rest]))
        return self._model.get_link_pose(self._tcp).to_transformation_matrix().astype(float)

    def jacobian(self, q: Array) -> Array:
        """(6, n) in the tcp frame, linear part first."""
        full = self._model.compute_single_link_local_jacobian(np.concatenate([q, self._rest]), self._tcp)
        return full[:, : self._arm_dof]


class CartesianController(BaseController):
    """Actions (dx, dy, dz, dphi, gripper) in [-1, 1] for a tool that points down.

    A step is one straight joint-space move from the commanded joints to those of the next target, with the move's
    velocity fed forward: at 4 Hz the tool ends 5 cm moves within about 1 mm, where plain position targets leave 16 mm.
    """

    config: CartesianControllerConfig
    sets_target_qpos = True
    sets_target_qvel = True

    def _initialize_action_space(self) -> None:
        self.single_action_space = spaces.Box(-1.0, 1.0, (5,), np.float32)

    def _initialize_joints(self) -> None:
        super()._initialize_joints()
        self._articulation = self.articulation._objs[0]
        active = self._articulation.active_joints
        self._arm, self._fingers = active[: self.config.arm_dof], active[self.config.arm_dof :]
        limits = self._articulation.get_qlimits()[: self.config.arm_dof].astype(float)
        self._lower, self._upper = limits[:, 0] + 0.02, limits[:, 1] - 0.02
        self.kinematics = SapienKinematics(self._articulation, self.config.tcp_link, self.config.arm_dof)

    def set_drive_property(self) -> None:
        """Set gains and force limits of all joints."""
        for joint in self._arm:
            joint.set_drive_properties(1e3, 1e2, force_limit=100.0, mode="force")
            joint.set_friction(0.0)
        for joint in self._fingers:
            joint.set_drive_properties(self.config.fingers.stiffness, 1e2, force_limit=150.0, mode="force")
            joint.set_friction(0.0)

    def reset(self) -> None:
        """Take the present joints as commanded, gripper open; call after the joints were set."""
        q = self._articulation.qpos.astype(float)
        self._q = q[: self.config.arm_dof]
        self._step_q = np.zeros_like(self._q)
        self._substep = self.config.substeps_n
        T = self.kinematics.pose(self._q)
        self.target = ToolTarget(T[:3, 3], _yaw_from_home(T[:3, :3], self.config.R_base_home))
        self.closing = False
        self._finger_setpoint = self.config.fingers.open_m
        for joint, angle in zip(self._arm, self._q, strict=True):
            joint.set_drive_target(float(angle))
            joint.set_drive_velocity_target(0.0)
        for joint in self._fingers:
            joint.set_drive_target(self.config.fingers.open_m)

    def measured_pose(self) -> Array:
        """``T_base_tcp`` (4, 4) from the measured joints."""
        return self.kinematics.pose(self._articulation.qpos[: self.config.arm_dof].astype(float))

    def gripper_opening_m(self) -> float:
        """Measured distance between the fingers."""
        return float(self._articulation.qpos[self.config.arm_dof :].sum())

    def set_action(self, action: ArrayLike) -> None:
        """Plan the move of one policy step, (1, 5) or (5,); a NaN was refused before it came here."""
        a = np.clip(np.asarray(action, dtype=float).reshape(5), -1.0, 1.0)
        if abs(a[4]) > self.config.gripper_dead_zone:
            self.closing = bool(a[4] < 0)
        self.target = next_target(
            self.target,
            self.measured_pose()[:3, 3],
            a[:3] * self.config.translation_step_m,
            a[3] * self.config.yaw_step_rad,
            self.config.limits,
        )
        goal = inverse_kinematics(
            self.kinematics, pose_of(self.target, self.config.R_base_home), self._q, self._lower, self._upper
        )
        self._step_q = (goal - self._q) / self.config.substeps_n
        self._start_q, self._q, self._substep = self._q, goal, 0

    def before_simulation_step(self) -> None:
        """Send the drives their next targets."""
        self._drive_fingers()
        if self._substep >= self.config.substeps_n:
            return
        self._substep += 1
        q = self._start_q + self._step_q * self._substep
        velocity = self._step_q / self.config.timestep_s if self._substep < self.config.substeps_n else np.zeros_like(q)
        for joint, angle, speed in zip(self._arm, q, velocity, strict=True):
            joint.set_drive_target(float(angle))
            joint.set_drive_velocity_target(float(speed))

    def _drive_fingers(self) -> None:
        fingers = self._articulation.qpos[self.config.arm_dof :].astype(float)
        self._finger_setpoint, targets = self.config.fingers.targets(
            self._finger_setpoint, self.closing, fingers, self.config.timestep_s
        )
        for joint, target in zip(self._fingers, targets, strict=True):
            joint.set_drive_target(float(target))


def _yaw_from_home(R_base_tcp: Array, R_base_home: Array) -> float:
    R = R_base_tcp @ R_base_home.T
    return float(np.arctan2(R[1, 0], R[0, 0]))


@dataclass
class CartesianControllerConfig(ControllerConfig):
    """Settings of :class:`CartesianController` (``joint_names`` lists the arm, then the fingers)."""

    substeps_n: int = 25
    timestep_s: float = 0.01
    tcp_link: str = ""
    arm_dof: int = 7
    R_base_home: Array = field(default_factory=lambda: np.diag([1.0, -1.0, -1.0]))
    translation_step_m: float = 0.05
    yaw_step_rad: float = 0.4
    gripper_dead_zone: float = 0.0
    limits: ToolLimits = field(default_factory=lambda: ToolLimits(np.full(3, -1.0), np.full(3, 1.0)))
    fingers: FingerDrive = field(default_factory=FingerDrive)
    controller_cls = CartesianController


class _LightURDFLoader(URDFLoader):
    # Building a visual makes a RenderMaterial, which needs a Vulkan device even when nothing is ever drawn; and where
    # there is one, the detailed visuals cost more time than everything else in the picture.
    def _build_link(self, link, link_builder) -> None:
        link.visuals = []
        super()._build_link(link, link_builder)


class CartesianPanda(Panda):
    """ManiSkill's Panda with a Cartesian controller; loads without a graphics driver."""

    urdf_config: ClassVar = {
        "_materials": {"gripper": {"static_friction": 1.5, "dynamic_friction": 1.5, "restitution": 0.0}},
        "link": {name: {"material": "gripper", "patch_radius": 0.1, "min_patch_radius": 0.1} for name in FINGERS},
    }
    finger_links = FINGERS
    base_links = ("panda_link0",)

    # tcp at (0.5, 0, 0.24) in the base frame, pointing straight down, fingers closing along y.
    home_arm_q = np.array([0.0, -0.025767, 0.0, -2.344287, 0.0, 2.31852, 0.785398])

    def __init__(self, *args, controller: CartesianControllerConfig | None = None, **kwargs) -> None:
        self._controller_cfg = controller or CartesianControllerConfig(joint_names=[])
        super().__init__(*args, **kwargs)

    @property
    def _controller_configs(self) -> dict[str, ControllerConfig]:
        self._controller_cfg.joint_names = [*self.arm_joint_names, *self.gripper_joint_names]
        self._controller_cfg.tcp_link = self.ee_link_name
        return {"cartesian": self._controller_cfg}

    def _load_articulation(self, initial_pose: sapien.Pose | None = None) -> None:
        loader = _LightURDFLoader()
        loader.collision_is_visual = self.scene.can_render()
        loader.set_scene(self.scene)
        loader.name = self.uid
        loader.fix_root_link = True
        sapien_utils.apply_urdf_config(loader, sapien_utils.parse_urdf_config(self.urdf_config))
        builder = loader.parse(self.urdf_path)["articulation_builders"][0]
        builder.initial_pose = initial_pose
        self.robot = builder.build()
        self.robot_link_names = [link.name for link in self.robot.get_links()]
