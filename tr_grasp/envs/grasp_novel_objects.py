"""Task I as a ManiSkill task: lift one of several unknown objects."""

from __future__ import annotations

import gc
from collections import deque
from typing import Any, ClassVar

import numpy as np
import sapien
import torch
from mani_skill.envs.sapien_env import BaseEnv
from mani_skill.utils.registration import register_env
from mani_skill.utils.structs.types import DefaultMaterialsConfig, SceneConfig, SimConfig
from numpy.typing import NDArray

from tr_grasp import keys
from tr_grasp.configs import EnvCfg
from tr_grasp.envs.appearance import draw_look, tinted_models
from tr_grasp.envs.camera_pose import random_camera, require_outside
from tr_grasp.envs.contacts import Contacts, read_contacts
from tr_grasp.envs.drawn_scene import light_scene
from tr_grasp.envs.execution import controller_config
from tr_grasp.envs.expert import ToolState
from tr_grasp.envs.image_observation import picture_tensors
from tr_grasp.envs.latency import draw_delay_substeps
from tr_grasp.envs.outcome import outcome_of
from tr_grasp.envs.placement import all_inside, drop_poses, inside
from tr_grasp.envs.rewards import STAGES, completed_stages, reward_terms
from tr_grasp.envs.robot_bodies import link_bodies
from tr_grasp.envs.scene_objects import draw_models
from tr_grasp.envs.scene_view import SceneView
from tr_grasp.envs.scripted_expert import Label, ScriptedExpert
from tr_grasp.envs.sensor import OctreeSensor
from tr_grasp.envs.settling import drop
from tr_grasp.envs.streams import Stream, stream, uniform_or_middle
from tr_grasp.errors import ConfigError
from tr_grasp.grasps import gripper_shape
from tr_grasp.objects.actors import add_object
from tr_grasp.robots import robot_names, robot_spec
from tr_grasp.robots.agents import (
    CartesianArm,
    CartesianController,
    CartesianPanda,
    agent_class,
)
from tr_grasp.robots.cartesian import ToolLimits
from tr_grasp.sensing import Body

Array = NDArray[np.floating]
COLLECT_GARBAGE_EVERY = 25
GRAVITY_MPS2 = 9.81
SCENE_ITERATIONS = 15
"""Solver iterations while objects fall and for an arm that touches nothing."""


@register_env("GraspNovelObjects-v1", max_episode_steps=None)
class GraspNovelObjectsEnv(BaseEnv):
    """Grasp one of ``objects.count_range`` unknown objects and lift it.

    Observations are a dict of tensors with a leading batch dimension of 1 (keys and shapes in :mod:`tr_grasp.keys`);
    actions are (dx, dy, dz, dphi, gripper) in [-1, 1]. The episode terminates with success, or when every object has
    left the workspace; it is truncated after ``cfg.episode_steps``.

    Args:
        cfg: The task.
        robot_uids: Overrides ``cfg.robot``.

    Raises:
        ConfigError: No such robot.
    """

    SUPPORTED_ROBOTS: ClassVar[list[str | tuple[str]]] = [*robot_names()]
    SUPPORTED_OBS_MODES = ("none",)
    SUPPORTED_REWARD_MODES = ("sparse", "none")
    agent: CartesianPanda | CartesianArm

    def __init__(self, *args: Any, cfg: EnvCfg | None = None, robot_uids: str | None = None, **kwargs: Any) -> None:
        self.cfg = cfg or EnvCfg()
        robot = robot_uids or self.cfg.robot
        self._robot_uid = robot
        self._agent_class, self._robot, self._gripper = agent_class(robot), robot_spec(robot), gripper_shape(robot)
        self.SUPPORTED_ROBOTS = [*robot_names(), self._robot.name]
        kwargs.setdefault("sim_backend", "physx_cpu")
        kwargs.setdefault("render_backend", "cpu" if self.cfg.camera.backend == "sapien" else "none")
        kwargs.setdefault("obs_mode", "none")
        kwargs.setdefault("reward_mode", "sparse")
        self._contacts: Contacts | None = None
        self._scenes_cleared = 0
        self._link_bodies: dict[str, Body] | None = None
        super().__init__(*args, robot_uids=self._robot.name, **kwargs)

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
        # Objects get ``contact_iterations`` once they lie: an arm that touches none of them is solved with these.
        scene = SceneConfig(
            contact_offset=0.005, solver_position_iterations=SCENE_ITERATIONS, solver_velocity_iterations=1
        )
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
        if self.cfg.randomise.gravity:
            self.sim_config.scene_config.gravity = np.array([0.0, 0.0, -self._draw_gravity_mps2()])
        super()._setup_scene()
        self._sim_steps_per_control = round(self.cfg.physics_hz / self.cfg.control_hz)

    def _draw_gravity_mps2(self) -> float:
        return GRAVITY_MPS2 + self.cfg.gravity_sigma_mps2 * self._stream(Stream.GRAVITY).standard_normal()

    def _stream(self, which: Stream) -> np.random.Generator:
        return stream(int(self._episode_seed[0]), which)

    def _load_agent(self, options: dict) -> None:
        w, a = self.cfg.workspace, self.cfg.action
        half = w.side_m / 2
        x, y, _ = w.centre_m
        low, high = w.tcp_height_m
        controller = controller_config(self.cfg, self._robot_uid)(
            joint_names=[],
            substeps_n=self._sim_steps_per_control,
            timestep_s=1.0 / self.cfg.physics_hz,
            translation_step_m=a.translation_step_m,
            yaw_step_rad=a.yaw_step_rad,
            gripper_dead_zone=a.gripper_dead_zone,
            limits=ToolLimits(np.array([x - half, y - half, low]), np.array([x + half, y + half, high])),
        )
        self.agent = self._agent_class(
            self.scene, self._control_freq, "cartesian", initial_pose=sapien.Pose(), controller=controller
        )

    def _load_scene(self, options: dict) -> None:
        rng, cfg, randomise = self._stream(Stream.SCENE), self.cfg.objects, self.cfg.randomise
        builder = self.scene.create_actor_builder()
        builder.add_plane_collision(sapien.Pose(q=[0.7071068, 0, -0.7071068, 0]))
        builder.initial_pose = sapien.Pose()
        self._table = builder.build_static("table")
        drawn = draw_models(cfg, rng, count_is_drawn=randomise.object_count)
        self.models = tinted_models(self.cfg, int(self._episode_seed[0]), drawn)
        actors = [
            add_object(
                self.scene,
                model,
                f"object_{i}",
                mass_kg=uniform_or_middle(cfg.mass_range_kg, rng, uniform=randomise.object_properties),
                friction=uniform_or_middle(cfg.friction_range, rng, uniform=randomise.object_properties),
            )
            for i, model in enumerate(self.models)
        ]
        self._bodies = [
            actor._objs[0].find_component_by_type(sapien.physx.PhysxRigidDynamicComponent) for actor in actors
        ]
        for body in self._bodies:
            body.angular_damping = 1.0  # PhysX has no rolling friction: without it balls roll for ever
        self._entities = [body.entity for body in self._bodies]
        self._look_at_scene()

    def _look_at_scene(self) -> None:
        """Set up, once per scene, what senses it."""
        links = {name: link._objs[0] for name, link in self.agent.robot.links_map.items()}
        self._fingers = [[links[name].entity for name in finger.links] for finger in self._robot.gripper.fingers]
        self._arm = [link.entity for name, link in links.items() if name != self._robot.base_link]
        if self._link_bodies is None:  # the robot is the same in every scene
            self._link_bodies = link_bodies(self.agent, links)
        seen_links = [(links[name].entity, body) for name, body in self._link_bodies.items()]
        visuals = [Body(m.visual.vertices, m.visual.faces, m.face_colours) for m in self.models]
        seen_objects = list(zip(self._entities, visuals, strict=True))
        self.view = SceneView(self.cfg, self.scene.sub_scenes[0], seen_links, seen_objects, self.scene.can_render())
        self._sensor = OctreeSensor(self.cfg, self.view.capture, self.view.camera)

    @property
    def sensor(self) -> OctreeSensor:
        """What turns pictures into octrees, with the last picture."""
        return self._sensor

    @property
    def controller(self) -> CartesianController:
        """The Cartesian controller."""
        return self.agent.controller

    # ---- episode -----------------------------------------------------------------------------------------------

    def _initialize_episode(self, env_idx: torch.Tensor, options: dict) -> None:
        randomise = self.cfg.randomise
        self._rng = self._stream(Stream.EPISODE)
        self._noise_rng = self._stream(Stream.STEREO_NOISE) if randomise.depth_noise == "stereo" else self._rng
        self._drop_objects()
        home = self.agent.home_arm_q
        noise = self._rng.normal(0, self.cfg.initial_joint_noise_rad, len(home))
        self._place_arm(home + noise if randomise.initial_joints else home)
        if randomise.latency:
            latency_s, rng = self.cfg.action.latency_s, self._stream(Stream.LATENCY)
            self.controller.delay_substeps = draw_delay_substeps(latency_s, self.cfg.physics_hz, rng)
        self.controller.reset()
        self._aim_camera()
        self.view.dress(draw_look(self.cfg, int(self._episode_seed[0])))
        self._rest_height = self._positions()[:, 2].copy()
        self._stages = np.zeros(len(STAGES), bool)
        self._terms: dict[str, float] = {}
        self._contacts = None
        self._expert = ScriptedExpert(self.cfg, self.view.height_map, self._gripper)
        self._stack: deque[tuple[torch.Tensor, ...]] = deque(maxlen=self.cfg.observation.stack_n)

    def _aim_camera(self) -> None:
        if self.cfg.randomise.camera_pose:
            self.view.aim(random_camera(self.cfg, self._stream(Stream.CAMERA_POSE)))
            self._sensor = OctreeSensor(self.cfg, self.view.capture, self.view.camera)
        require_outside(self.view.camera, zip(self.models, self.view.object_poses(), strict=True))

    def _place_arm(self, arm_q: Array) -> None:
        # Drive targets survive set_qpos: left alone they would pull the arm back while the objects settle.
        robot = self.agent.robot._objs[0]
        q = self.controller.qpos(arm_q)
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
        rng = self._rng if self.cfg.randomise.object_poses else np.random.default_rng(0)
        self._solve_objects_with(SCENE_ITERATIONS)
        drop(
            self.scene.px,
            self._bodies,
            lambda: drop_poses(diagonals, self.cfg.objects, self.cfg.workspace, rng),
            lambda: all_inside(self._positions(), self.cfg.workspace, -0.01),
            self.cfg.physics_hz,
        )
        self._solve_objects_with(self.cfg.contact_iterations)

    def _solve_objects_with(self, iterations: int) -> None:
        for body in self._bodies:
            body.solver_position_iterations = iterations

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
        frame = self._sensor.observe(self._noise_rng)
        newest = (frame.codes, frame.features, torch.from_numpy(self._proprioception()))
        if self.cfg.observation.image:
            newest += picture_tensors(self._sensor.image)
        while len(self._stack) < self.cfg.observation.stack_n - 1:
            self._stack.append(newest)
        self._stack.append(newest)
        codes, features, proprio, *pictures = (torch.stack(column)[None] for column in zip(*self._stack, strict=True))
        obs: dict[str, Any] = {
            keys.OCTREE: {"codes": codes, "features": features},
            keys.PROPRIO: proprio,
            keys.STAGES: torch.from_numpy(self._stages.astype(np.float32))[None],
        }
        if pictures:
            obs[keys.COLOUR_IMAGE], obs[keys.DEPTH_IMAGE] = pictures
        if self.cfg.observation.expert_labels:
            action, target = self.expert_labels()
            obs[keys.EXPERT_ACTION] = torch.from_numpy(action)[None]
            obs[keys.EXPERT_TARGET] = torch.from_numpy(target)[None]
        return obs

    def _proprioception(self) -> NDArray[np.float32]:
        """(10,) gripper reading, tcp position [m], first two columns of R_base_tcp."""
        controller = self.controller
        if self.cfg.observation.gripper_reading == "measured":
            gripper = 2.0 * controller.gripper_opening_m() / self._robot.gripper.opening_range_m[1] - 1.0
        else:
            gripper = -1.0 if controller.closing else 1.0
        T = self._tcp
        return np.array([gripper, *T[:3, 3], *T[:3, 0], *T[:3, 1]], np.float32)

    def render_image(self, size_px: int = 320) -> NDArray[np.uint8]:
        """A shaded (size, size, 3) picture of the scene, drawn without a graphics driver."""
        return self.view.picture(size_px)

    def photograph(self, size_px: int = 320) -> NDArray[np.uint8]:
        """The same (size, size, 3) picture from SAPIEN's renderer.

        Raises:
            ConfigError: The environment was made without a renderer.
        """
        if not self.scene.can_render():
            raise ConfigError("photograph needs a renderer; make the environment with make_env(..., photographs=True).")
        return self.view.photograph(size_px)

    def _load_lighting(self, options: dict) -> None:
        light_scene(self.scene.sub_scenes[0])

    def render(self) -> torch.Tensor:
        """(1, 512, 512, 3) uint8 picture of the scene."""
        return torch.from_numpy(self.render_image(512))[None]

    def expert_labels(self) -> Label:
        """What the scripted expert does in the present state and where it is going; see :class:`ScriptedExpert`."""
        closing_axis = self._tcp[:2, 1]
        tool = ToolState(
            position=self._tcp[:3, 3],
            closing_yaw_rad=float(np.arctan2(closing_axis[1], closing_axis[0])),
            closing=self.controller.closing,
            holding=self._holding,
            opening_m=self.controller.gripper_opening_m(),
            opening_speed_mps=self._opening_speed_mps(),
        )
        return self._expert.label(tool, self.view.object_poses())

    def _opening_speed_mps(self) -> float:
        """How fast the fingers open."""
        robot, controller = self.agent.robot._objs[0], self.controller
        which = controller.active_joint_indices[controller.config.arm_dof :].numpy()
        q, half_step = robot.qpos[which], 0.5 / self.cfg.physics_hz * robot.qvel[which]
        opening_m = controller.config.fingers.opening_m
        return (opening_m(q + half_step) - opening_m(q - half_step)) * self.cfg.physics_hz

    # ---- gymnasium ---------------------------------------------------------------------------------------------

    def step(self, action: Any) -> tuple[Any, torch.Tensor, torch.Tensor, torch.Tensor, dict]:
        """As BaseEnv, with truncation after ``episode_steps``."""
        obs, reward, terminated, _, info = super().step(action)
        truncated = (self._elapsed_steps >= self.cfg.episode_steps) & ~terminated
        return obs, reward, terminated, truncated, info
