"""Lets a policy act on a station until something is lifted, time is up, or a device says no."""

from __future__ import annotations

import enum
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
import torch
from numpy.typing import NDArray
from tensordict import TensorDict, TensorDictBase
from torchrl.envs.utils import ExplorationType, set_exploration_type

from tr_grasp import keys
from tr_grasp.configs import EnvCfg
from tr_grasp.deploy.cartesian import CartesianSteps, Execution
from tr_grasp.deploy.log import RunLog, RunStep
from tr_grasp.deploy.observe import Observer
from tr_grasp.errors import ConfigError, HardwareError
from tr_grasp.hardware import Station
from tr_grasp.octree import OctreeFrame
from tr_grasp.robots import RobotSpec

Policy = Callable[[TensorDictBase], TensorDictBase]


class RunEnding(enum.Enum):
    """How a run ended; ``label`` is for people."""

    LIFTED = "the fingers hold something and it was lifted"
    TIME_UP = "nothing was lifted in the steps allowed"
    FAILED = "a device did not do what it was told"

    @property
    def label(self) -> str:
        """A clause for people."""
        return self.value


@dataclass(frozen=True)
class RunResult:
    """How a run ended, and what exactly was the matter."""

    ending: RunEnding
    detail: str = ""
    steps_n: int = 0

    @property
    def reason(self) -> str:
        """A sentence for people."""
        return f"{self.ending.label}{': ' if self.detail else ''}{self.detail}"


class PolicyRun:
    """One run of a policy.

    Whether something was lifted is told from the devices alone: the fingers were stopped by something as they closed,
    and have risen by the task's lift height since.

    Args:
        policy: Reads an observation and writes an action.
        cfg: The task that it was trained for.
        spec: The robot.
        station: Its devices, maybe behind a guard; with a camera.
        T_base_cam: (4, 4) where the camera is.
        execution: How steps become motion.
        meta: What else the log says.

    Attributes:
        log: Grows with every step; worth saving however the run ends.

    Raises:
        HardwareError: The station has no camera.
        ConfigError: The policy reads pictures, whose size and view it would have to share with its training.
    """

    def __init__(
        self,
        policy: Policy,
        cfg: EnvCfg,
        spec: RobotSpec,
        station: Station,
        T_base_cam: NDArray[np.floating],
        *,
        execution: Execution = "stepped",
        meta: dict[str, Any] | None = None,
    ) -> None:
        if station.camera is None:
            raise HardwareError("a policy needs a camera, and the station has none.")
        if keys.COLOUR_IMAGE in getattr(policy, "in_keys", ()):
            raise ConfigError("a policy that reads pictures (image_cnn) acts in simulation alone; take one of octrees.")
        self._policy, self._cfg, self._station, self._camera = policy, cfg, station, station.camera
        self._observer = Observer(cfg, T_base_cam)
        self._steps = CartesianSteps(cfg, spec, station, execution)
        self._held_at_m: float | None = None
        self.log = RunLog({"robot": spec.name, "execution": execution, "T_base_cam": np.asarray(T_base_cam).tolist()})
        self.log.meta.update(meta or {})

    def run(self, steps_n: int | None = None, watch: Callable[[RunStep], None] | None = None) -> RunResult:
        """Act.

        Args:
            steps_n: At most so many actions; as many as an episode of the task has, if not given.
            watch: Called with every step before it is carried out.
        """
        result = self._run(self._cfg.episode_steps if steps_n is None else steps_n, watch)
        if result.ending is RunEnding.FAILED:
            self._station.arm.stop()
        self.log.meta.update(ending=result.ending.name, reason=result.reason)
        return result

    def _run(self, steps_n: int, watch: Callable[[RunStep], None] | None) -> RunResult:
        for k in range(steps_n):
            try:
                step = self.decide()
                if watch is not None:
                    watch(step)
                reason = self._steps.step(step.action)
                if reason:
                    return RunResult(RunEnding.FAILED, reason, k + 1)
                if self._has_lifted():
                    return RunResult(RunEnding.LIFTED, steps_n=k + 1)
            except HardwareError as error:
                return RunResult(RunEnding.FAILED, str(error), k)
        return RunResult(RunEnding.TIME_UP, f"{steps_n} steps", steps_n)

    def decide(self) -> RunStep:
        """Look, let the policy choose, and write it into the log; nothing moves."""
        image, arm = self._camera.capture(), self._station.arm.state()
        observation = self._observer.observe(image, self._steps.proprioception())
        action = act(self._policy, observation)
        octree = cast(OctreeFrame, observation[keys.OCTREE])
        step = RunStep(
            stamp_s=self._station.world.now_s,
            q_rad=np.asarray(arm.q_rad, float),
            opening_m=self._station.gripper.state().opening_m,
            proprio=observation[keys.PROPRIO].numpy(),
            codes=octree.codes.numpy(),
            features=octree.features.numpy(),
            action=action,
            rgb=image.rgb,
            depth_m=image.depth_m,
        )
        self.log.steps.append(step)
        return step

    def _has_lifted(self) -> bool:
        if not (self._steps.closing and self._station.gripper.state().holding):
            self._held_at_m = None
            return False
        height = float(self._steps.tool_pose()[2, 3])
        if self._held_at_m is None:
            self._held_at_m = height
        return height - self._held_at_m >= self._cfg.reward.lift_height_m


def act(policy: Policy, observation: TensorDict) -> NDArray[np.float32]:
    """(5,) what a policy does without exploring."""
    with torch.no_grad(), set_exploration_type(ExplorationType.DETERMINISTIC):
        return policy(observation.clone())[keys.ACTION].numpy().astype(np.float32)


def disagreement(policy: Policy, log: RunLog) -> float:
    """The greatest difference between the actions of a log and what a policy does in the same observations."""
    return max((float(np.abs(act(policy, s.observation()) - s.action).max()) for s in log.steps), default=0.0)
