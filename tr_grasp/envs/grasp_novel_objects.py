"""Task I as a ManiSkill task: lift one of several unknown objects."""

from __future__ import annotations

import gc
from collections import deque
from functools import lru_cache
from typing import Any

import numpy as np
import sapien
import torch
from mani_skill.envs.sapien_env import BaseEnv
from mani_skill.utils.registration import register_env
from mani_skill.utils.structs.types import DefaultMaterialsConfig, SceneConfig, SimConfig
from numpy.typing import NDArray

from tr_grasp import keys
from tr_grasp.configs import EnvCfg
from tr_grasp.envs.contacts import Contacts, read_contacts
from tr_grasp.envs.expert import (
    ToolState,
    choose_grasp,
    expert_action,
    lift_action,
    no_target,
    target_from_tool,
    wait_action,
)
from tr_grasp.envs.outcome import outcome_of
from tr_grasp.envs.placement import all_inside, drop_poses, inside
from tr_grasp.envs.rewards import STAGES, completed_stages, reward_terms
from tr_grasp.envs.robot_bodies import ARM_COLOUR, FINGER_COLOUR, TABLE_COLOUR, entity_pose, link_body, table_body
from tr_grasp.envs.sensor import OctreeSensor, picture
from tr_grasp.errors import ConfigError, unknown_name
from tr_grasp.grasps import HeightMap, TopDownGrasps, top_down_grasps
from tr_grasp.objects import ObjectSet, object_set
from tr_grasp.objects.actors import add_object
from tr_grasp.octree import OctreeFrame
from tr_grasp.robots.agents import CartesianController, CartesianControllerConfig, CartesianPanda
from tr_grasp.robots.cartesian import ToolLimits
from tr_grasp.sensing import Body, DepthImage, PinholeCamera, RaycastScene
from tr_grasp.sensing.sapien_camera import SapienCamera

Array = NDArray[np.floating]
AGENTS = {"panda": CartesianPanda}
SETTLE_S, SETTLE_TRIES = 1.2, 6
COLLECT_GARBAGE_EVERY = 25


@lru_cache(maxsize=8)
def _objects(source: str, split: str, diagonal_range_m: tuple[float, float]) -> ObjectSet:
    return object_set(source, split, diagonal_range_m=diagonal_range_m)


@register_env("GraspNovelObjects-v1", max_episode_steps=None)
class GraspNovelObjectsEnv(BaseEnv):
    """Grasp one of ``objects.count_range`` unknown objects and lift it.

    Observations are a dict of tensors with a leading batch dimension of 1 (keys and shapes in :mod:`tr_grasp.keys`);
    actions are (dx, dy, dz, dphi, gripper) in [-1, 1]. The episode terminates with success, or when every object has
    left the workspace; it is truncated after ``cfg.episode_steps``.

    Args:
        cfg: The task.
        robot_uids: Overrides ``cfg.robot``.
    """

    SUPPORTED_ROBOTS = tuple(AGENTS)
    SUPPORTED_OBS_MODES = ("none",)
    SUPPORTED_REWARD_MODES = ("sparse", "none")
    agent: CartesianPanda

    def __init__(self, *args: Any, cfg: EnvCfg | None = None, robot_uids: str | None = None, **kwargs: Any) -> None:
        self.cfg = cfg or EnvCfg()
        robot = robot_uids or self.cfg.robot
        if robot not in AGENTS:
            raise ConfigError(unknown_name("robot", robot, AGENTS))
        kwargs.setdefault("sim_backend", "physx_cpu")
        kwargs.setdefault("render_backend", "cpu" if self.cfg.camera.backend == "sapien" else "none")
        kwargs.setdefault("obs_mode", "none")
        kwargs.setdefault("reward_mode", "sparse")
        self._contacts: Contacts | None = None
        self._scenes_cleared = 0
        self._link_bodies: list[Body | None] | None = None
        super().__init__(*args, robot_uids=robot, **kwargs)

    def _clear(self) -> None:
        # As BaseEnv does, but without collecting all garbage of the process each time: with torch loaded that takes
        # several times as long as everything else about a fresh scene.
        self._close_viewer()
        self.agent = self.scene = None
        self._sensors, self._human_render_cameras, self._hidden_objects = {}, {}, []
        self._scenes_cleared += 1
        if self._scenes_cleared % COLLECT_GARBAGE_EVERY == 0:
            gc.collect()

    # ---- scene -------------------------------------------------------------------------------------------------

    @property
    def _default_sim_config(self) -> SimConfig:
        # Fewer than 15 position iterations let held boxes and capsules slip.
        scene = SceneConfig(contact_offset=0.005, solver_position_iterations=15, solver_velocity_iterations=1)
        materials = DefaultMaterialsConfig(static_friction=1.0, dynamic_friction=1.0, restitution=0.0)
        return SimConfig(
            sim_freq=self.cfg.physics_hz,
            control_freq=1,  # an int to ManiSkill, which has no 2.5 Hz: the true rate is set in _setup_scene
            scene_config=scene,
            default_materials_config=materials,
        )

    @property
    def control_timestep(self) -> float:
        """Duration of a policy step [s]."""
        return 1.0 / self.cfg.control_hz

    def _setup_scene(self) -> None:
        super()._setup_scene()
        self._sim_steps_per_control = round(self.cfg.physics_hz / self.cfg.control_hz)

    def _load_agent(self, options: dict) -> None:
        w, a = self.cfg.workspace, self.cfg.action
        half = w.side_m / 2
        x, y, _ = w.centre_m
        low, high = w.tcp_height_m
        controller = CartesianControllerConfig(
            joint_names=[],
            substeps_n=self._sim_steps_per_control,
            timestep_s=1.0 / self.cfg.physics_hz,
            translation_step_m=a.translation_step_m,
            yaw_step_rad=a.yaw_step_rad,
            gripper_dead_zone=a.gripper_dead_zone,
            limits=ToolLimits(np.array([x - half, y - half, low]), np.array([x + half, y + half, high])),
        )
        agent_class = AGENTS[self.robot_uids]
        self.agent = agent_class(
            self.scene, self._control_freq, "cartesian", initial_pose=sapien.Pose(), controller=controller
        )

    def _load_scene(self, options: dict) -> None:
        rng = np.random.default_rng([int(self._episode_seed[0]), 0])
        cfg = self.cfg.objects
        builder = self.scene.create_actor_builder()
        builder.add_plane_collision(sapien.Pose(q=[0.7071068, 0, -0.7071068, 0]))
        builder.initial_pose = sapien.Pose()
        if self.scene.can_render():
            material = sapien.render.RenderMaterial(base_color=[*TABLE_COLOUR, 1.0])
            builder.add_box_visual(sapien.Pose([0, 0, -0.005]), [1.0, 1.0, 0.005], material)
        self._table = builder.build_static("table")
        chosen = _objects(cfg.source, cfg.split, cfg.diagonal_range_m)
        count = int(rng.integers(cfg.count_range[0], cfg.count_range[1] + 1))
        self.models = [chosen.sample(rng) for _ in range(count)]
        actors = [
            add_object(
                self.scene,
                model,
                f"object_{i}",
                mass_kg=float(rng.uniform(*cfg.mass_range_kg)),
                friction=float(rng.uniform(*cfg.friction_range)),
            )
            for i, model in enumerate(self.models)
        ]
        self._bodies = [
            actor._objs[0].find_component_by_type(sapien.physx.PhysxRigidDynamicComponent) for actor in actors
        ]
        for body in self._bodies:
            body.angular_damping = 1.0  # PhysX has no rolling friction: without it balls roll for ever
        self._entities = [body.entity for body in self._bodies]
        self._index_robot()

    def _index_robot(self) -> None:
        """Look up, once per scene, what sensing and contacts need."""
        links = self.agent.robot._objs[0].links
        by_name = {name: link._objs[0].entity for name, link in self.agent.robot.links_map.items()}
        self._fingers = [by_name[name] for name in self.agent.finger_links]
        fixed = {by_name[name] for name in self.agent.base_links}
        self._arm = [link.entity for link in links if link.entity not in fixed]
        if self._link_bodies is None:  # the robot is the same in every scene
            self._link_bodies = [
                link_body(link, FINGER_COLOUR if link.entity in self._fingers else ARM_COLOUR) for link in links
            ]
        seen = [(link.entity, body) for link, body in zip(links, self._link_bodies, strict=True) if body is not None]
        objects = [Body(m.visual.vertices, m.visual.faces, m.face_colours) for m in self.models]
        self._seen = [entity for entity, _ in seen] + self._entities
        self.raycast = RaycastScene([*(body for _, body in seen), *objects, table_body()])
        self._sapien_camera: SapienCamera | None = None
        self._sensor = OctreeSensor(self.cfg, self.capture)

    @property
    def controller(self) -> CartesianController:
        """The Cartesian controller."""
        return self.agent.controller

    # ---- episode -----------------------------------------------------------------------------------------------

    def _initialize_episode(self, env_idx: torch.Tensor, options: dict) -> None:
        self._rng = np.random.default_rng([int(self._episode_seed[0]), 1])
        self._drop_objects()
        self._place_arm(self.agent.home_arm_q + self._rng.normal(0, self.cfg.initial_joint_noise_rad, 7))
        self.controller.reset()
        self._rest_height = self._positions()[:, 2].copy()
        self._stages = np.zeros(len(STAGES), bool)
        self._terms: dict[str, float] = {}
        self._contacts = None
        self._grasps: TopDownGrasps | None = None
        self._stack: deque[tuple[OctreeFrame, Array]] = deque(maxlen=self.cfg.observation.stack_n)

    def _place_arm(self, arm_q: Array) -> None:
        # Drive targets survive set_qpos: left alone they would pull the arm back while the objects settle.
        robot = self.agent.robot._objs[0]
        q = np.concatenate([arm_q, [self.controller.config.fingers.open_m] * 2]).astype(np.float32)
        robot.set_qpos(q)
        robot.set_qvel(np.zeros_like(q))
        for joint, target in zip(robot.active_joints, q, strict=True):
            joint.set_drive_target(float(target))
            joint.set_drive_velocity_target(0.0)

    def _drop_objects(self) -> None:
        """Let the objects fall with the arm turned aside, again while one of them rolls off."""
        aside = self.agent.home_arm_q.copy()
        aside[0] += np.pi / 2
        self._place_arm(aside)
        diagonals = np.array([model.diagonal_m for model in self.models])
        for _ in range(SETTLE_TRIES):
            for body, (position, q) in zip(
                self._bodies, drop_poses(diagonals, self.cfg.objects, self.cfg.workspace, self._rng), strict=True
            ):
                body.entity.set_pose(sapien.Pose(position, q))
                body.set_linear_velocity(np.zeros(3))
                body.set_angular_velocity(np.zeros(3))
            self._settle()
            if all_inside(self._positions(), self.cfg.workspace, -0.01):
                return

    def _settle(self) -> None:
        for step in range(int(SETTLE_S * 2 * self.cfg.physics_hz)):
            self.scene.px.step()
            if step % 10 == 9 and step > 0.4 * self.cfg.physics_hz and self._at_rest():
                return

    def _at_rest(self) -> bool:
        return all(
            np.linalg.norm(body.linear_velocity) < 0.005 and np.linalg.norm(body.angular_velocity) < 0.1
            for body in self._bodies
        )

    def _positions(self) -> Array:
        """(objects, 3) centres of mass [m]."""
        return np.array([entity.pose.p for entity in self._entities])

    # ---- one step ----------------------------------------------------------------------------------------------

    def evaluate(self) -> dict[str, torch.Tensor]:
        """Read the contacts, advance the stages, and say how the episode stands."""
        cfg = self.cfg.reward
        contacts = self._read_contacts()
        positions = self._positions()
        self._tcp = self.controller.measured_pose()
        held = contacts.pinched & self.controller.closing
        height = positions[:, 2] - (self._rest_height if cfg.lift_reference == "rest" else 0.0)
        now = np.array(
            [
                (np.linalg.norm(positions - self._tcp[:3, 3], axis=1) < cfg.reach_distance_m).any(),
                contacts.touched.any(),
                held.any(),
                (held & (height > cfg.lift_height_m)).any(),
            ]
        )
        # Nothing is completed at reset: a stage that holds there is paid with the first step.
        after = completed_stages(self._stages, now) if self._elapsed_steps[0] > 0 else self._stages
        self._terms = reward_terms(self._stages, after, contacts.ground, cfg)
        self._stages, self._contacts, self._holding = after, contacts, bool(held.any())
        all_out = not inside(positions, self.cfg.workspace, self.cfg.workspace.escape_margin_m).any()
        self.outcome = outcome_of(tuple(after.tolist()), self._holding, all_out)
        return {
            "success": torch.tensor([bool(after[3])]),
            "fail": torch.tensor([all_out and not after[3]]),
            "outcome": torch.tensor([int(self.outcome)]),
        }

    def _read_contacts(self) -> Contacts:
        return read_contacts(
            self.scene.px.get_contacts(),
            self._fingers,
            self._entities,
            self._arm,
            self._table._objs[0],
            1.0 / self.cfg.physics_hz,
        )

    def compute_sparse_reward(self, obs: Any, action: torch.Tensor, info: dict) -> torch.Tensor:
        """Sum of :attr:`reward_terms`."""
        return torch.tensor([sum(self._terms.values())], dtype=torch.float32)

    @property
    def reward_terms(self) -> dict[str, float]:
        """What the last step paid, by name."""
        return dict(self._terms)

    # ---- observation -------------------------------------------------------------------------------------------

    def get_obs(self, info: dict | None = None, unflattened: bool = False) -> dict[str, Any]:
        """Look, and stack what was seen on the observations before."""
        info = self.get_info() if info is None else info
        frame = self._sensor.observe(self._rng)
        newest = (frame, self._proprioception())
        while len(self._stack) < self.cfg.observation.stack_n - 1:
            self._stack.append(newest)
        self._stack.append(newest)
        frames, proprio = zip(*self._stack, strict=True)
        obs: dict[str, Any] = {
            keys.OCTREE: {
                "codes": torch.stack([f.codes for f in frames])[None],
                "features": torch.stack([f.features for f in frames])[None],
            },
            keys.PROPRIO: torch.from_numpy(np.stack(proprio))[None],
            keys.STAGES: torch.from_numpy(self._stages.astype(np.float32))[None],
        }
        if self.cfg.observation.expert_labels:
            action, target = self.expert_labels()
            obs[keys.EXPERT_ACTION] = torch.from_numpy(action)[None]
            obs[keys.EXPERT_TARGET] = torch.from_numpy(target)[None]
        return obs

    def _proprioception(self) -> NDArray[np.float32]:
        """(10,) gripper reading, tcp position [m], first two columns of R_base_tcp."""
        controller = self.controller
        if self.cfg.observation.gripper_reading == "measured":
            gripper = controller.gripper_opening_m() / controller.config.fingers.open_m - 1.0
        else:
            gripper = -1.0 if controller.closing else 1.0
        T = self._tcp
        return np.array([gripper, *T[:3, 3], *T[:3, 0], *T[:3, 1]], np.float32)

    def capture(self, camera: PinholeCamera) -> DepthImage:
        """A noise-free picture of the present instant, by the configured backend."""
        if self.cfg.camera.backend == "raycast":
            return self.raycast.capture(camera, self.body_poses())
        if self._sapien_camera is None:
            self._sapien_camera = SapienCamera(self.scene.sub_scenes[0], camera)
        return self._sapien_camera.capture()

    def body_poses(self) -> Array:
        """(bodies, 4, 4) ``T_base_body`` of all that :attr:`raycast` holds, in its order."""
        return np.stack([*(entity_pose(entity) for entity in self._seen), np.eye(4)])

    def render_image(self, size_px: int = 320) -> NDArray[np.uint8]:
        """A shaded (size, size, 3) picture of the scene, drawn without a graphics driver."""
        return picture(self.raycast, self.body_poses(), size_px)

    def render(self) -> torch.Tensor:
        """(1, 512, 512, 3) uint8 picture of the scene."""
        return torch.from_numpy(self.render_image(512))[None]

    # ---- expert ------------------------------------------------------------------------------------------------

    def expert_labels(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """What the scripted expert, which sees the true scene, does in the present state and where it is going.

        Returns:
            Action (5,) and target (6,), as in :mod:`tr_grasp.keys`.
        """
        controller = self.controller
        closing_axis = self._tcp[:2, 1]
        tool = ToolState(
            self._tcp[:3, 3],
            float(np.arctan2(closing_axis[1], closing_axis[0])),
            controller.closing,
            self._holding,
            controller.gripper_opening_m(),
        )
        if tool.holding:
            return lift_action(), no_target()
        grasps = self._plan()
        best = choose_grasp(grasps, tool)
        if best is None:
            return wait_action(), no_target()
        position, yaw, width = grasps.position[best], float(grasps.yaw_rad[best]), float(grasps.width_m[best])
        return expert_action(tool, position, yaw, width, self.cfg.action), target_from_tool(tool, position, yaw)

    def _plan(self) -> TopDownGrasps:
        """Grasps of the present scene, searched anew only if an object has moved since."""
        poses = np.stack([entity_pose(entity) for entity in self._entities])
        if self._grasps is not None and np.abs(poses - self._planned_for).max() < 0.004:
            return self._grasps
        self._planned_for = poses
        self._grasps = top_down_grasps(
            self.height_map(), poses[:, :2, 3], lowest_tcp_m=self.cfg.workspace.tcp_height_m[0]
        )
        return self._grasps

    def height_map(self, cell_m: float = 0.004) -> HeightMap:
        """Table and objects from above, without the robot."""
        half = self.cfg.workspace.side_m / 2 + 0.04
        n = int(2 * half / cell_m) + 1
        x0, y0 = np.array(self.cfg.workspace.centre_m[:2]) - (n - 1) / 2 * cell_m
        x, y = np.meshgrid(x0 + np.arange(n) * cell_m, y0 + np.arange(n) * cell_m, indexing="ij")
        top = 0.6
        rays = np.zeros((n * n, 6), np.float32)
        rays[:, 0], rays[:, 1], rays[:, 2], rays[:, 5] = x.ravel(), y.ravel(), top, -1.0
        first = len(self._seen) - len(self._entities)
        hits = self.raycast.cast(rays, self.body_poses(), range(first, len(self.raycast)))
        height = np.maximum(top - np.where(np.isfinite(hits.distance), hits.distance, top), 0.0)
        owner = hits.body - first
        return HeightMap(
            height.reshape(n, n), np.where(owner < len(self._entities), owner, -1).reshape(n, n), (x0, y0), cell_m
        )

    # ---- gymnasium ---------------------------------------------------------------------------------------------

    def step(self, action: Any) -> tuple[Any, torch.Tensor, torch.Tensor, torch.Tensor, dict]:
        """As BaseEnv, with truncation after ``episode_steps``."""
        obs, reward, terminated, _, info = super().step(action)
        truncated = (self._elapsed_steps >= self.cfg.episode_steps) & ~terminated
        return obs, reward, terminated, truncated, info
