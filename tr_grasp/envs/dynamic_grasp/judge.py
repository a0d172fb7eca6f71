"""Who says how a trial ended: physics, not the method."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tr_grasp.dynamic import GraspOutcome, MethodResult, Phase, TrialOver
from tr_grasp.envs.dynamic_grasp.scene import SLAB, TARGET, DynamicScene

Array = NDArray[np.floating]

CHECK_HZ = 20.0
OFF_CARRIER_M = 0.10
HELD = (Phase.LIFTING, Phase.HOLDING)


@dataclass(frozen=True)
class Verdict:
    """How a trial ended.

    Attributes:
        outcome, detail: And why.
        committed_s: When the hand left the pre-grasp in the last attempt.
        lifted_s: When the object was as far up as a success takes.
        attempts: How often the fingers closed.
    """

    outcome: GraspOutcome
    detail: str
    committed_s: float | None
    lifted_s: float | None
    attempts: int


class Judge:
    """Watches a trial while it runs, and ends it when something has gone wrong for good.

    Give its :meth:`tell` to the method, and :meth:`verdict` what the method says, or what has ended the trial.
    """

    def __init__(self, scene: DynamicScene) -> None:
        self._scene, self._world, self._cfg = scene, scene.station.world, scene.cfg.judge
        self.phase = Phase.REACHING
        self._committed_s: float | None = None
        self._lifted_s: float | None = None
        self._attempts = 0
        self._at_first = {name: self._world.true_pose(name) for name in scene.obstacle_names}
        self._height_m: float | None = None
        self._next_s = 0.0
        if scene.trial.has_slab:
            # The object in the hand is as much of a touch as the hand.
            self._world.watch_also(TARGET)
        self._world.before_step(self._before_step)

    def tell(self, phase: Phase) -> None:
        """The method is in another phase."""
        now = self._world.now_s
        if phase is Phase.APPROACHING:
            self._committed_s = now
        if phase is Phase.CLOSING and phase is not self.phase:
            self._attempts += 1
        if phase is Phase.LIFTING:
            self._height_m = float(self._world.true_pose(TARGET)[2, 3])
            if self._scene.cfg.freeze_on_lift:
                self._scene.ride.freeze(now)
        self.phase = phase

    def verdict(self, said: MethodResult | TrialOver) -> Verdict:
        """How it ended; a lifted object is watched for as long as it has to be held."""
        outcome, detail = said.outcome, said.detail
        if isinstance(said, MethodResult):
            outcome, detail = self._weighed(said)
        return Verdict(outcome, detail, self._committed_s, self._lifted_s, self._attempts)

    @property
    def rise_m(self) -> float:
        """How far the target is above where it was when the lift began; 0 without a lift."""
        return 0.0 if self._height_m is None else float(self._world.true_pose(TARGET)[2, 3]) - self._height_m

    def _weighed(self, said: MethodResult) -> tuple[GraspOutcome, str]:
        try:
            was_up = self.rise_m >= self._cfg.lifted_m
            if was_up:
                self._world.wait(self._cfg.hold_s)
        except TrialOver as over:
            return over.outcome, over.detail
        rise = self.rise_m
        if rise >= self._cfg.lifted_m:
            return GraspOutcome.LIFTED, ""
        if was_up:
            return GraspOutcome.DROPPED, f"{100 * rise:.1f} cm up after {self._cfg.hold_s:g} s"
        if said.outcome.is_success:
            return GraspOutcome.NOT_LIFTED, f"the method says it was; it is {100 * rise:.1f} cm up"
        return said.outcome, said.detail

    def _before_step(self) -> None:
        if self._world.now_s < self._next_s:
            return
        self._next_s = self._world.now_s + 1 / CHECK_HZ
        if self._lifted_s is None and self.phase in HELD and self.rise_m >= self._cfg.lifted_m:
            self._lifted_s = self._world.now_s
        self._look_at_slab()
        self._look_at_obstacles()
        if self.phase not in HELD:
            self._look_at_target()
            self._look_at_clock()

    def _look_at_slab(self) -> None:
        if not self._scene.trial.has_slab:
            return
        for touch in self._world.touches:
            if touch.thing == SLAB:
                raise TrialOver(GraspOutcome.SLAB_TOUCHED, f"{touch.link} touched it")

    def _look_at_obstacles(self) -> None:
        for name, before in self._at_first.items():
            now = self._world.true_pose(name)
            lean, shift = lean_deg(now), float(np.linalg.norm(now[:2, 3] - before[:2, 3]))
            if lean > self._cfg.obstacle_tilt_deg or shift > self._cfg.obstacle_shift_m:
                raise TrialOver(GraspOutcome.OBSTACLE_MOVED, f"{name}: {lean:.0f} deg, {100 * shift:.1f} cm")

    def _look_at_target(self) -> None:
        now, place = self._world.true_pose(TARGET), self._scene.ride(np.array([self._world.now_s]))[0]
        place = place @ self._scene.T_top_target
        drop, lean = float(place[2, 3] - now[2, 3]), lean_deg(now)
        away = float(np.linalg.norm(now[:2, 3] - place[:2, 3]))
        if drop > self._cfg.target_drop_m or lean > self._cfg.target_tilt_deg or away > OFF_CARRIER_M:
            detail = f"{lean:.0f} deg, {100 * away:.1f} cm off its place, {100 * drop:.1f} cm below it"
            raise TrialOver(GraspOutcome.KNOCKED_OVER, detail)

    def _look_at_clock(self) -> None:
        late = self._world.now_s - self._scene.ride.duration_s
        if late > (0.0 if self.phase is Phase.REACHING else self._cfg.grace_s):
            raise TrialOver(GraspOutcome.PATH_FINISHED, "" if self._committed_s is None else "after a grasp was begun")


def lean_deg(T_base_thing: Array) -> float:
    """How far a thing that stood upright leans."""
    return float(np.degrees(np.arccos(np.clip(T_base_thing[2, 2], -1.0, 1.0))))
