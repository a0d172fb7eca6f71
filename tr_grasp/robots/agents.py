"""Arms as ManiSkill agents, with a Cartesian controller and without any need for a renderer."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from typing import Any, ClassVar, cast

import numpy as np
import sapien
from mani_skill.agents.base_agent import BaseAgent
from mani_skill.agents.controllers.base_controller import ControllerConfig
from mani_skill.agents.registration import register_agent
from mani_skill.agents.robots.panda import Panda
from mani_skill.utils import sapien_utils
from mani_skill.utils.building.urdf_loader import URDFLoader

from tr_grasp.robots.cartesian import DriveGain
from tr_grasp.robots.controller import CartesianController, CartesianControllerConfig, SapienKinematics
from tr_grasp.robots.fingers import CoupledFingers
from tr_grasp.robots.parts import Array
from tr_grasp.robots.spec import RobotSpec, robot_names, robot_spec
from tr_grasp.robots.urdf import cached_urdf

__all__ = [
    "CartesianArm",
    "CartesianController",
    "CartesianControllerConfig",
    "CartesianPanda",
    "SapienKinematics",
    "agent_class",
]

FINGERS = ("panda_leftfinger", "panda_rightfinger")


class _LightURDFLoader(URDFLoader):
    # Building a visual makes a RenderMaterial, which needs a Vulkan device even when nothing is ever drawn; and where
    # there is one, the Panda's detailed visuals cost more time than everything else in the picture.
    keep_visuals = False

    def _build_link(self, link, link_builder) -> None:
        if not self.keep_visuals:
            link.visuals = []
        super()._build_link(link, link_builder)


def _finger_friction(links: Iterable[str]) -> dict[str, Any]:
    """ManiSkill's URDF settings that make the links of fingers grip."""
    return {
        "_materials": {"gripper": {"static_friction": 1.5, "dynamic_friction": 1.5, "restitution": 0.0}},
        "link": {name: {"material": "gripper", "patch_radius": 0.1, "min_patch_radius": 0.1} for name in links},
    }


class CartesianPanda(Panda):
    """ManiSkill's Panda with a Cartesian controller; loads without a graphics driver."""

    urdf_config: ClassVar = _finger_friction(FINGERS)
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
        sapien_utils.apply_urdf_config(loader, sapien_utils.parse_urdf_config(cast(dict, self.urdf_config)))
        builder = loader.parse(self.urdf_path)["articulation_builders"][0]
        builder.initial_pose = initial_pose
        self.robot = builder.build()
        self.robot_link_names = [link.name for link in self.robot.get_links()]


class CartesianArm(BaseAgent):
    """A robot that is data, with the same controller as :class:`CartesianPanda`; subclasses name the robot.

    Links of the robot do not collide with each other: their simple solids overlap where real ones are shaped to fit.
    """

    spec: ClassVar[RobotSpec]

    def __init__(self, *args, controller: CartesianControllerConfig | None = None, **kwargs) -> None:
        self._controller_cfg = controller or CartesianControllerConfig(joint_names=[])
        super().__init__(*args, **kwargs)

    @property
    def home_arm_q(self) -> Array:
        """(n,) arm joints at home [rad]."""
        return np.array(self.spec.home_q_rad)

    @property
    def finger_links(self) -> tuple[str, ...]:
        """The link of each finger that grips."""
        return tuple(finger.links[0] for finger in self.spec.gripper.fingers)

    @property
    def base_links(self) -> tuple[str, ...]:
        """Links that stand on the table."""
        return (self.spec.base_link,)

    @property
    def _controller_configs(self) -> dict[str, ControllerConfig]:
        cfg, spec = self._controller_cfg, self.spec
        cfg.joint_names = [*spec.joint_names, *spec.gripper.joint_names]
        cfg.tcp_link, cfg.arm_dof = spec.tcp_link, len(spec.joints)
        cfg.rest_q = self.home_arm_q if cfg.arm_dof > 6 else None
        cfg.fingers = CoupledFingers.of(spec.gripper)
        cfg.arm_gains = [DriveGain(40.0 * effort, 4.0 * effort, effort) for effort in spec.effort_limit_nm]
        return {"cartesian": cfg}

    def _load_articulation(self, initial_pose: sapien.Pose | None = None) -> None:
        loader = _LightURDFLoader()
        loader.keep_visuals = self.scene.can_render()
        loader.set_scene(self.scene)
        loader.name = self.uid
        loader.fix_root_link = True
        loader.disable_self_collisions = True
        links = [name for finger in self.spec.gripper.fingers for name in finger.links]
        sapien_utils.apply_urdf_config(loader, sapien_utils.parse_urdf_config(_finger_friction(links)))
        builder = loader.parse(str(cached_urdf(self.spec)))["articulation_builders"][0]
        builder.initial_pose = initial_pose
        self.robot = builder.build()
        self.robot_link_names = [link.name for link in self.robot.get_links()]


@cache
def agent_class(robot: str) -> type[CartesianPanda | CartesianArm]:
    """The agent of a robot, by name or by the path of a user's YAML; it is registered for ManiSkill's ``robot_uids``.

    Raises:
        ConfigError: No such robot.
    """
    if robot == "panda":
        return CartesianPanda
    spec = robot_spec(robot)
    made = type(
        f"Cartesian_{spec.name}", (CartesianArm,), {"uid": spec.name, "spec": spec, "__doc__": CartesianArm.__doc__}
    )
    return register_agent(override=True)(made)


for _name in robot_names():
    agent_class(_name)
