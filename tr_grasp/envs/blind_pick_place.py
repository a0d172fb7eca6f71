"""Pick and place as a gymnasium task: joint speeds and fingers in, joints and the object's pose out."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from tr_grasp.envs.pick_place_view import snapshot, view_camera
from tr_grasp.envs.pick_place_world import OBJECT, Verdict, judge, pick_place_world
from tr_grasp.envs.sapien_station import SapienStation
from tr_grasp.geometry import wxyz_from_matrix
from tr_grasp.motion import MotionLimits, Servo
from tr_grasp.pick_place import StationCfg, read_station

Floats = NDArray[np.float32]
Observation = dict[str, Floats]
TICK_S = 0.02
SETTLE_S = 0.3


class BlindPickPlaceEnv(gym.Env):
    """Carry the object to its goal without touching what must not be touched.

    An action is (dof + 1,) in [-1, 1]: joint speeds as parts of the station's limits, ramped with limited jerk, and
    the fingers (positive opens). The episode terminates when the open hand has left the object in the goal, or when a
    wall is touched. :attr:`station` is the same world for the hardware protocols, so that
    ``BlindPickPlace(env.unwrapped.cfg, env.unwrapped.station).run()`` carries the nine stages out in it.

    Args:
        station: Name or YAML file of a station, or one.
        shift_m: Largest shift of the object along x and y, drawn at reset.
        control_hz: Actions per second.
        episode_s: Simulated time after which an episode is truncated.
        physics_hz: Steps per second.
    """

    metadata = {"render_modes": ["rgb_array"]}  # noqa: RUF012 (gymnasium's own)
    render_mode = "rgb_array"

    def __init__(
        self,
        station: str | StationCfg = "thesis",
        *,
        shift_m: float = 0.01,
        control_hz: float = 10.0,
        episode_s: float = 60.0,
        physics_hz: int = 120,
    ) -> None:
        self.cfg = station if isinstance(station, StationCfg) else read_station(station)
        self._shift_m, self._physics_hz = shift_m, physics_hz
        self._ticks_n, self._steps_n = max(1, round(1 / control_hz / TICK_S)), round(episode_s * control_hz)
        self._camera = view_camera(self.cfg)
        self.station = self._fresh(self.cfg.object.foot_m[:2], 0.0)
        dof = self.station.arm.limits.dof
        self.action_space = gym.spaces.Box(-1.0, 1.0, (dof + 1,), np.float32)
        sizes = {"q_rad": dof, "dq_rad_s": dof, "opening_m": 1, "object_position_m": 3, "object_wxyz": 4}
        self.observation_space = gym.spaces.Dict(
            {name: gym.spaces.Box(-np.inf, np.inf, (size,), np.float32) for name, size in sizes.items()}
        )

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Observation, dict]:
        """The arm at home, the object near where it was taught, turned in any way."""
        super().reset(seed=seed)
        shift = self.np_random.uniform(-self._shift_m, self._shift_m, 2)
        x, y, _ = self.cfg.object.foot_m
        self.station = self._fresh((x + shift[0], y + shift[1]), float(self.np_random.uniform(-np.pi, np.pi)))
        return self._observe(), self._info(self._judge())

    def step(self, action: NDArray[np.floating]) -> tuple[Observation, float, bool, bool, dict]:
        """One action; the reward is 1 for the step in which the object is placed."""
        a = np.clip(np.asarray(action, float), -1.0, 1.0)
        arm, gripper, world = self.station.arm, self.station.gripper, self.station.world
        opens = bool(a[-1] > 0)
        if opens != self._open:
            self._open = opens
            gripper.move(gripper.opening_range_m[1] if opens else max(gripper.opening_range_m[0], 0.0))
        for _ in range(self._ticks_n):
            told = self._servo.move(a[:-1] * self._limits.velocity_rad_s)
            arm.servo(told.q, told.dq)
            world.wait(TICK_S)
        self._steps += 1
        verdict = self._judge()
        placed = verdict.placed and self._open
        terminated = placed or bool(verdict.touches)
        truncated = self._steps >= self._steps_n and not terminated
        return self._observe(), float(placed and not verdict.touches), terminated, truncated, self._info(verdict)

    def render(self) -> NDArray[np.uint8]:
        """A shaded picture, drawn without a graphics driver."""
        return snapshot(self.station, self._camera)

    def _fresh(self, foot_m: Any, yaw_rad: float) -> SapienStation:
        station = pick_place_world(
            self.cfg, foot_m=foot_m, yaw_rad=yaw_rad, camera=self._camera, physics_hz=self._physics_hz
        )
        station.world.wait(SETTLE_S)
        station.world.forget_touches()
        own = station.arm.limits
        self._limits: MotionLimits = own.scaled(self.cfg.speed_share)
        self._servo = Servo(self._limits, TICK_S)
        self._servo.start(station.arm.commanded().q)
        self._steps, self._open = 0, True
        return station

    def _judge(self) -> Verdict:
        return judge(self.station, self.cfg)

    def _observe(self) -> Observation:
        arm, T = self.station.arm.state(), self.station.world.true_pose(OBJECT)
        values = {
            "q_rad": arm.q_rad,
            "dq_rad_s": arm.dq_rad_s,
            "opening_m": [self.station.gripper.state().opening_m],
            "object_position_m": T[:3, 3],
            "object_wxyz": wxyz_from_matrix(T[:3, :3]),
        }
        return {name: np.asarray(value, np.float32) for name, value in values.items()}

    def _info(self, verdict: Verdict) -> dict[str, Any]:
        return {"success": verdict.placed and self._open, "touches": [touch.thing for touch in verdict.touches]}


gym.register("BlindPickPlace-v1", entry_point="tr_grasp.envs.blind_pick_place:BlindPickPlaceEnv")
