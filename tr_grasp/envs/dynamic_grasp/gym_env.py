"""``DynamicGrasp-v1``: the world of Task II for learners, behind gymnasium's interface."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from tr_grasp.configs.dynamic import DynamicCfg
from tr_grasp.dynamic import GraspOutcome, Phase, TrialOver
from tr_grasp.envs.dynamic_grasp.judge import Judge
from tr_grasp.envs.dynamic_grasp.scene import TARGET, DynamicScene
from tr_grasp.envs.dynamic_grasp.trial import make_trial
from tr_grasp.errors import ConfigError
from tr_grasp.geometry import wxyz_from_matrix
from tr_grasp.motion import Kinematics
from tr_grasp.robots import robot_spec

Array = NDArray[np.floating]
Observation = dict[str, NDArray[np.float32]]

TRIALS_N = 1_000_000
MARGIN_RAD = 0.02


class DynamicGraspEnv(gymnasium.Env[Observation, NDArray[np.float32]]):
    """Grasp what rides by. One episode is one trial, judged as every other method's.

    Actions (dof + 1,) in [-1, 1]: speeds of the joints as shares of ``speed_share`` of their limits, then the fingers
    (0 and more opens). Observations, all float32, base frame: ``q``, ``dq`` (dof,); ``opening`` (1,) [m]; ``tcp`` and
    ``target`` (7,) position [m] and quaternion wxyz, that of the target as it was last measured; ``age`` (1,) [s] of
    that measurement. The reward is 1 in the step in which the object has been held for long enough.

    Args:
        motion, object_name: The case.
        cfg: The world.
        control_hz: Actions per second.
        speed_share: Of the joints' limits.

    Raises:
        ConfigError: No such motion or object, or a rate at which the arm would stop between two actions.
    """

    def __init__(
        self,
        motion: str = "linear",
        object_name: str = "010_potted_meat_can",
        cfg: DynamicCfg | None = None,
        control_hz: float = 20.0,
        speed_share: float = 0.5,
    ) -> None:
        self.cfg, self._case = cfg or DynamicCfg(), (motion, object_name)
        make_trial(*self._case, number=0)  # refuses what does not exist
        if not control_hz > 10:
            raise ConfigError(f"control_hz must be above 10, or the arm stops between two actions; got {control_hz}.")
        self._period_s, self._speed_share = 1 / control_hz, speed_share
        self._kinematics = Kinematics(robot_spec(self.cfg.robot))
        dof = self._kinematics.dof
        self.action_space = spaces.Box(-1.0, 1.0, (dof + 1,), np.float32)
        sizes = {"q": dof, "dq": dof, "opening": 1, "tcp": 7, "target": 7, "age": 1}
        self.observation_space = spaces.Dict(
            {name: spaces.Box(-np.inf, np.inf, (size,), np.float32) for name, size in sizes.items()}
        )

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin a trial: that of number ``seed``, or any."""
        super().reset(seed=seed)
        number = int(self.np_random.integers(TRIALS_N)) if seed is None else seed
        self.scene = DynamicScene.of(self.cfg, make_trial(*self._case, number))
        self._judge = Judge(self.scene)
        self._opens, self._up_s = True, 0.0
        while not self.scene.station.world.poses(TARGET):  # the first measurement may be late
            self.scene.station.world.wait(self._period_s)
        return self._observation(), {"trial": number}

    def step(self, action: NDArray[np.float32]) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Move for one period."""
        station, action = self.scene.station, np.clip(np.asarray(action, float), -1.0, 1.0)
        self._move(action[:-1])
        if (opens := bool(action[-1] >= 0)) != self._opens:
            self._opens = opens
            station.gripper.move(station.gripper.opening_range_m[int(opens)])
            self._judge.tell(Phase.REACHING if opens else Phase.CLOSING)
        try:
            station.world.wait(self._period_s)
        except TrialOver as over:
            return self._observation(), 0.0, True, False, {"outcome": over.outcome.label, "success": False}
        success = self._is_held()
        info = {"outcome": GraspOutcome.LIFTED.label, "success": True} if success else {}
        return self._observation(), float(success), success, False, info

    def _move(self, shares: Array) -> None:
        arm = self.scene.station.arm
        limits, now = arm.limits, arm.commanded()
        dq = self._speed_share * limits.velocity_rad_s * shares
        ahead = now.q + dq * arm.setpoint_timeout_s
        inside = (ahead > limits.lower_rad + MARGIN_RAD) & (ahead < limits.upper_rad - MARGIN_RAD)
        arm.servo(now.q, np.where(inside, dq, 0.0))

    def _is_held(self) -> bool:
        """The object has been up for as long as it takes; whether it is in the hand is what the fingers say."""
        held = self.scene.station.gripper.state().holding
        if held and self._judge.phase is Phase.CLOSING:
            self._judge.tell(Phase.LIFTING)
        elif not held and self._judge.phase is Phase.LIFTING:
            self._judge.tell(Phase.REACHING)
        up = held and self._judge.rise_m >= self.cfg.judge.lifted_m
        self._up_s = self._up_s + self._period_s if up else 0.0
        return self._up_s > self.cfg.judge.hold_s

    def _observation(self) -> Observation:
        station = self.scene.station
        state, world = station.arm.state(), station.world
        reading = world.poses(TARGET)[-1]
        values = {
            "q": state.q_rad,
            "dq": state.dq_rad_s,
            "opening": [station.gripper.state().opening_m],
            "tcp": _seven(self._kinematics.pose(state.q_rad)),
            "target": _seven(reading.T_base_object),
            "age": [world.now_s - reading.stamp_s],
        }
        return {name: np.asarray(value, np.float32) for name, value in values.items()}


def _seven(T: Array) -> Array:
    """Position and quaternion."""
    return np.concatenate([T[:3, 3], wxyz_from_matrix(T[:3, :3])])
