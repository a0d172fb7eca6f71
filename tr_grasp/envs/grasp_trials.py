"""Grasps tried out in SAPIEN: many free hands side by side, each closing on its own copy of the object."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import sapien
from numpy.typing import NDArray
from sapien import physx
from sapien.wrapper.articulation_builder import ArticulationBuilder

from tr_grasp.envs.contacts import TOUCH_FORCE_N, read_contacts
from tr_grasp.grasps import Grasps, HandMotion, TrialCfg, floating_gripper
from tr_grasp.objects.actors import rigid_body
from tr_grasp.objects.model import ObjectModel
from tr_grasp.robots import CoupledFingers, RobotSpec
from tr_grasp.robots.urdf import cached_urdf

Array = NDArray[np.floating]
SPACING_M = 2.0
AT_REST = np.zeros(3)
FINGER_FRICTION = 1.5
NO_SELF_COLLISION = 1 << 29
"""Bodies that share this bit of the third group pass through each other."""
FINGER_PERIOD = 3
"""Physics steps between two targets of the fingers."""
HAND_STIFFNESS, HAND_DAMPING, HAND_FORCE_N = 2e4, 4e2, 300.0


class GraspTrials:
    """Tries grasps on an object that stands on a table, many at once in one scene.

    In every trial the object is moved and turned at random, the open hand comes along its approach direction, closes,
    lifts, shakes sideways and holds still. The grasp counts if then all fingers press the object and it is as high as
    :attr:`TrialCfg.raised_share` of the lift asks for.

    Args:
        model: The object; it stands on its lowest point, z up.
        mass_kg: Its mass.
        gripper: A name of :func:`tr_grasp.grasps.gripper_names`.
        cfg: What a trial is.
    """

    def __init__(self, model: ObjectModel, mass_kg: float, gripper: str, cfg: TrialCfg) -> None:
        self.cfg = cfg
        self._spec = floating_gripper(gripper)
        self._stand_z_m = -float(model.bounds_m[0, 2])
        self._system = _physics(cfg)
        self._scene = scene = sapien.Scene([self._system])  # its entities live as long as it does
        scene.add_ground(0.0, render=False, material=physx.PhysxMaterial(cfg.friction, cfg.friction, 0.0))
        self._ground = scene.entities[0]
        builder = _hand_builder(scene, self._spec)
        places = _places(cfg.parallel_n)
        self._slots = [_Slot(scene, builder, self._spec, model, mass_kg, cfg, place) for place in places]
        # Before its first step the engine has not placed what is new, and the first trial would differ from others.
        for slot in self._slots:
            slot.reset(np.eye(4), np.zeros(2), 0.0, self._stand_z_m)
            slot.park()
        self._system.step()

    def __call__(
        self, grasps: Grasps, rng: np.random.Generator, velocity_mps: Array | None = None
    ) -> NDArray[np.bool_]:
        """(n,) whether each of n grasps held, tried once.

        Args:
            grasps: Where the hand is while it closes, if the object stands still.
            rng: Of the misplacements.
            velocity_mps: (n, 3) of the object and what it stands on, in the object's frame, against a hand that only
                approaches and lifts; at rest, if not given. The object is where it should be when the fingers start
                to close.
        """
        velocity = np.zeros((len(grasps), 3)) if velocity_mps is None else velocity_mps
        rows = [
            np.arange(start, min(start + self.cfg.parallel_n, len(grasps)))
            for start in range(0, len(grasps), self.cfg.parallel_n)
        ]
        return np.concatenate([np.zeros(0, bool), *(self._try(grasps.subset(k), rng, velocity[k]) for k in rows)])

    def _closing_s(self, grasps: Grasps) -> float:
        """Until the fingers have closed on the thinnest of these."""
        gripper = self._spec.gripper
        return (gripper.opening_range_m[1] - float(grasps.width_m.min())) / gripper.speed_mps + self.cfg.settle_s

    def _try(self, grasps: Grasps, rng: np.random.Generator, velocity: Array) -> NDArray[np.bool_]:
        cfg = self.cfg
        n = len(grasps)
        shift = rng.uniform(-cfg.shift_m, cfg.shift_m, (n, 2))
        turn = np.radians(rng.uniform(-cfg.turn_deg, cfg.turn_deg, n))
        T_obj_tcp = grasps.poses()
        slots = self._slots[:n]
        for k, slot in enumerate(slots):
            slot.reset(T_obj_tcp[k], shift[k], turn[k], self._stand_z_m, velocity[k] * cfg.approach_s)
        for slot in self._slots[n:]:
            slot.park()
        motion, before, drifts = HandMotion(cfg, self._closing_s(grasps)), None, bool(velocity.any())
        for step in range(round(motion.duration_s * cfg.physics_hz)):
            time_s = (step + 1) / cfg.physics_hz
            back, moved = motion.back_at(time_s), motion.moved_at(time_s)
            closing = motion.closing_at(time_s) and step % FINGER_PERIOD == 0
            way = (back, *moved)
            # A belt at rest under a hand that drifts against it is the same physics as a belt that moves.
            drift = velocity * (cfg.approach_s - time_s)
            for slot, aside in zip(slots, drift, strict=True):
                if drifts or way != before:
                    slot.move(back, moved + aside)
                if closing:
                    slot.close()
            before = way
            self._system.step()
        touch = read_contacts(
            self._system.get_contacts(),
            [finger for slot in slots for finger in slot.fingers],
            [slot.object for slot in slots],
            [],
            self._ground,
            1 / cfg.physics_hz,
        )
        fingers_n = len(self._spec.gripper.fingers)
        pressed = np.array(
            [(touch.force_n[k * fingers_n : (k + 1) * fingers_n, k] > TOUCH_FORCE_N).all() for k in range(n)]
        )
        raised = np.array([slot.object.pose.p[2] - self._stand_z_m for slot in slots])
        return pressed & (raised > cfg.raised_share * cfg.lift_m)


class _Slot:
    """One hand and one object at a place of their own."""

    def __init__(
        self,
        scene: sapien.Scene,
        builder: ArticulationBuilder,
        spec: RobotSpec,
        model: ObjectModel,
        mass_kg: float,
        cfg: TrialCfg,
        place: Array,
    ) -> None:
        self._place, self._cfg = place, cfg
        self._coupling = CoupledFingers.of(spec.gripper)
        builder.initial_pose = sapien.Pose([*place, 1.0])
        self._hand = builder.build(fix_root_link=True)
        active = {joint.name: (index, joint) for index, joint in enumerate(self._hand.active_joints)}
        self._slides = [active[joint.name][1] for joint in spec.joints]
        self._finger_joints = [active[name][1] for name in spec.gripper.joint_names]
        self._finger_index = np.array([active[name][0] for name in spec.gripper.joint_names])
        self._slide_index = np.array([active[joint.name][0] for joint in spec.joints])
        for joint in self._slides:
            joint.set_drive_properties(HAND_STIFFNESS, HAND_DAMPING, force_limit=HAND_FORCE_N, mode="force")
        for joint, gain in zip(self._finger_joints, self._coupling.gains, strict=True):
            joint.set_drive_properties(gain.stiffness, gain.damping, force_limit=gain.force_limit, mode="force")
            joint.set_friction(0.0)
        links = {link.name: link for link in self._hand.links}
        _grip(links[name] for finger in spec.gripper.fingers for name in finger.links)
        for link in self._hand.links:
            link.disable_gravity = True
            for shape in link.collision_shapes:
                shape.set_collision_groups([1, 1, NO_SELF_COLLISION, 0])
        self.fingers = [[links[name].entity for name in finger.links] for finger in spec.gripper.fingers]
        self._body = rigid_body(model, mass_kg=mass_kg, friction=cfg.friction)
        self.object = sapien.Entity()
        self.object.add_component(self._body)
        scene.add_entity(self.object)
        self._open = spec.gripper.open

    def reset(self, T_obj_tcp: Array, shift: Array, turn: float, stand_z_m: float, aside: Array = AT_REST) -> None:
        """Put the object at its place, moved and turned, and the hand before where it was to be, or beside that."""
        origin = np.array([*self._place, stand_z_m])
        self.object.set_pose(sapien.Pose(origin + np.append(shift, 0.0), [np.cos(turn / 2), 0, 0, np.sin(turn / 2)]))
        self._body.set_linear_velocity(np.zeros(3))
        self._body.set_angular_velocity(np.zeros(3))
        T = T_obj_tcp.copy()
        T[:3, 3] += origin
        self._R_tcp_world = T[:3, :3].T
        self._hand.set_root_pose(sapien.Pose(T))
        q = np.zeros(self._hand.dof, np.float32)
        start = self._R_tcp_world @ aside - [0.0, 0.0, self._cfg.approach_m]
        q[self._slide_index] = start
        q[self._finger_index] = self._open
        self._hand.set_qpos(q)
        self._hand.set_qvel(np.zeros_like(q))
        self._setpoint = self._coupling.open_setpoint
        for joint, position in zip([*self._slides, *self._finger_joints], [*start, *self._open], strict=True):
            joint.set_drive_target(float(position))
            joint.set_drive_velocity_target(0.0)

    def park(self) -> None:
        """Leave the hand open, above the object."""
        self._hand.set_root_pose(sapien.Pose([*self._place, 1.5]))

    def move(self, back_m: float, moved_m: Array) -> None:
        """Send the hand to so far before its grasp, and so far (3,) from there along the axes of the world."""
        q = self._R_tcp_world @ moved_m
        q[2] -= back_m
        for joint, target in zip(self._slides, q.tolist(), strict=True):
            joint.set_drive_target(target)

    def close(self) -> None:
        """Send the fingers a little farther."""
        measured = self._hand.qpos[self._finger_index].astype(float)
        period_s = FINGER_PERIOD / self._cfg.physics_hz
        self._setpoint, targets = self._coupling.targets(self._setpoint, True, measured, period_s)
        for joint, target in zip(self._finger_joints, targets.tolist(), strict=True):
            joint.set_drive_target(target)


def _physics(cfg: TrialCfg) -> physx.PhysxCpuSystem:
    physx.set_scene_config(enable_tgs=True)
    physx.set_body_config(solver_position_iterations=cfg.solver_iterations, solver_velocity_iterations=1)
    physx.set_shape_config(contact_offset=0.005)
    system = physx.PhysxCpuSystem()
    system.timestep = 1 / cfg.physics_hz
    return system


def _hand_builder(scene: sapien.Scene, spec: RobotSpec) -> ArticulationBuilder:
    loader = scene.create_urdf_loader()
    return loader.parse(str(cached_urdf(spec)))[0][0]


def _grip(links: Iterable[physx.PhysxArticulationLinkComponent]) -> None:
    rubber = physx.PhysxMaterial(FINGER_FRICTION, FINGER_FRICTION, 0.0)
    for link in links:
        for shape in link.collision_shapes:
            shape.physical_material = rubber
            shape.patch_radius = shape.min_patch_radius = 0.1


def _places(n: int) -> Array:
    side = int(np.ceil(np.sqrt(n)))
    return SPACING_M * np.stack(np.divmod(np.arange(n), side), axis=1).astype(float)
