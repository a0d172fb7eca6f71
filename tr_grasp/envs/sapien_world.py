"""Physics as a world of the hardware protocols: virtual time, things that move, and who touched what."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import mani_skill.envs  # noqa: F401 -- registers what a scene needs
import numpy as np
import sapien
from mani_skill.envs.scene import ManiSkillScene
from mani_skill.envs.utils.system.backend import parse_sim_and_render_backend
from sapien import physx

from tr_grasp.envs.things import Thing
from tr_grasp.errors import MotionError, unknown_name
from tr_grasp.hardware import PoseReading, PoseStream
from tr_grasp.hardware.virtual_world import checked_duration
from tr_grasp.motion.arguments import Array

PHYSICS_HZ = 240


@dataclass(frozen=True)
class Touch:
    """A link of the robot on a thing: since when, and the greatest force [N] so far."""

    link: str
    thing: str
    since_s: float
    force_n: float


class SapienWorld:
    """A scene that is stepped when somebody waits.

    Args:
        things: What is in it beside the robot; their names are unique.
        physics_hz: Steps per second.

    Attributes:
        scene: For what is added to it.
        charged_s: Time that was charged so far.

    Raises:
        MotionError: Two things of one name.
    """

    def __init__(self, things: Sequence[Thing] = (), physics_hz: int = PHYSICS_HZ) -> None:
        names = [thing.name for thing in things]
        if repeated := sorted({name for name in names if names.count(name) > 1}):
            raise MotionError(f"things must have names of their own, got two called {repeated[0]!r}.")
        # Settings of the process, read when a scene is made: the same as in Task I.
        physx.set_scene_config(enable_tgs=True)
        physx.set_body_config(solver_position_iterations=15, solver_velocity_iterations=1)
        physx.set_shape_config(contact_offset=0.005)
        physx.set_default_material(1.0, 1.0, 0.0)
        self._system = physx.PhysxCpuSystem()
        self.timestep_s = self._system.timestep = 1 / physics_hz
        backend = parse_sim_and_render_backend("physx_cpu", "none")
        self.scene = ManiSkillScene([sapien.Scene([self._system])], backend=backend)
        self.things = {thing.name: thing for thing in things}
        self.entities = {thing.name: thing.entity() for thing in things}
        for entity in self.entities.values():
            self.scene.sub_scenes[0].add_entity(entity)
        self._streams = {thing.name: PoseStream(thing.stream) for thing in things}
        self._steps, self._owed_s, self.charged_s = 0, 0.0, 0.0
        self._before_step: list[Callable[[], None]] = []
        self._links: dict[sapien.Entity, str] = {}
        self._names = {entity: name for name, entity in self.entities.items()}
        self._touches: dict[tuple[str, str], Touch] = {}
        self._place_movers(0.0)
        self._observe()

    def watch(self, links: dict[sapien.Entity, str]) -> None:
        """Report what these links touch, by their names."""
        self._links = links

    def watch_also(self, name: str) -> None:
        """Report what a thing touches too, as if it were a link of the robot: what is in the hand, say.

        Raises:
            MotionError: No such thing.
        """
        self._known(name)
        self._links = {**self._links, self.entities[name]: name}

    def before_step(self, listener: Callable[[], None]) -> None:
        """Call a function before every physics step."""
        self._before_step.append(listener)

    @property
    def now_s(self) -> float:
        """The clock."""
        return self._steps * self.timestep_s

    def wait(self, duration_s: float) -> None:
        """Step as often as the time that has been waited for holds."""
        self._owed_s += checked_duration(duration_s)
        while self._owed_s > self.timestep_s * (1 - 1e-6):
            self._owed_s -= self.timestep_s
            self._step()

    def charge(self, duration_s: float) -> None:
        """As :meth:`wait`: nothing else makes virtual time pass."""
        self.charged_s += checked_duration(duration_s)
        self.wait(duration_s)

    @property
    def objects(self) -> tuple[str, ...]:
        """Names of the things."""
        return tuple(self.things)

    def poses(self, name: str, after_s: float = float("-inf")) -> tuple[PoseReading, ...]:
        """Readings that have arrived."""
        self._known(name)
        return self._streams[name].arrived(self.now_s, after_s)

    def true_pose(self, name: str) -> Array:
        """``T_base_thing`` (4, 4) now: for judges, not for whoever grasps.

        Raises:
            MotionError: No such thing.
        """
        self._known(name)
        return self.entities[name].pose.to_transformation_matrix().astype(float)

    @property
    def touches(self) -> tuple[Touch, ...]:
        """Which links have touched which things since :meth:`forget_touches`, in the order of time."""
        return tuple(self._touches.values())

    def forget_touches(self) -> None:
        """Begin a new report."""
        self._touches.clear()

    def _known(self, name: str) -> None:
        if name not in self.things:
            raise MotionError(unknown_name("object", name, self.things))

    def _step(self) -> None:
        for listener in self._before_step:
            listener()
        self._place_movers(self.now_s + self.timestep_s)
        self._system.step()
        self._steps += 1
        self._observe()
        self._note_touches()

    def _place_movers(self, time_s: float) -> None:
        for name, thing in self.things.items():
            if thing.motion is not None:
                pose = sapien.Pose(np.asarray(thing.motion(np.array([time_s])))[0])
                body = self.entities[name].find_component_by_type(physx.PhysxRigidDynamicComponent)
                if self._steps or time_s:
                    body.set_kinematic_target(pose)  # with a speed, so that friction carries what lies on it
                else:
                    self.entities[name].set_pose(pose)

    def _observe(self) -> None:
        for name, stream in self._streams.items():
            if stream.is_due(self.now_s):
                stream.observe(self.now_s, self.true_pose(name))

    def _note_touches(self) -> None:
        for contact in self._system.get_contacts():
            a, b = (body.entity for body in contact.bodies)
            if a not in self._links or b not in self._names:
                a, b = b, a
            if a not in self._links or b not in self._names:
                continue
            impulse = np.sum([point.impulse for point in contact.points], axis=0) if contact.points else np.zeros(3)
            force = float(np.linalg.norm(impulse)) / self.timestep_s
            if force > 0:
                key = self._links[a], self._names[b]
                before = self._touches.get(key)
                since = self.now_s if before is None else before.since_s
                self._touches[key] = Touch(*key, since, max(force, before.force_n if before else 0.0))
