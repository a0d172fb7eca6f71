"""The loop of dynamic grasping: reach, close, lift, and once more if that failed."""

from __future__ import annotations

from typing import Protocol

from tr_grasp.dynamic.algorithm1 import Algorithm1
from tr_grasp.dynamic.attempt import Array, Run
from tr_grasp.dynamic.meet import RETREAT_M, MeetingPlanner
from tr_grasp.dynamic.method import DynamicTask, GraspOutcome, MethodResult, Phase
from tr_grasp.dynamic.settings import GrasperCfg
from tr_grasp.dynamic.target import Forecast
from tr_grasp.errors import GraspError
from tr_grasp.grasps.ranking import NO_AIDS, RankingAids
from tr_grasp.hardware import Station


class Reaching(Protocol):
    """What differs between the planners: how the hand comes to a grasp."""

    @property
    def follows_while_closing(self) -> bool:
        """The hand is to be taken along with the object while the fingers close."""
        ...

    def reach(self) -> tuple[GraspOutcome, str] | None:
        """Come to where the fingers close; or why that is not to be."""
        ...

    def grasp(self) -> tuple[Forecast, Array]:
        """The forecast by which the hand moves now, and ``T_obj_tcp`` (4, 4) of the grasp."""
        ...

    def failed(self) -> None:
        """The grasp did not hold."""
        ...


class DynamicGrasper:
    """Grasps an object that moves on a path that nobody tells; a :class:`~tr_grasp.dynamic.method.DynamicMethod`.

    Args:
        cfg: Settings; ours by default, ``GrasperCfg.thesis()`` for the thesis'.
        aids: What rankings know beside the arm and the grasps: a reachability field, a motion-aware scorer.

    Raises:
        GraspError: The ranking ``motion`` without a scorer.
    """

    def __init__(self, cfg: GrasperCfg | None = None, aids: RankingAids = NO_AIDS) -> None:
        self.cfg, self.aids = cfg or GrasperCfg(), aids
        if self.cfg.ranking == "motion" and aids.scorer is None:
            raise GraspError("the ranking 'motion' needs a motion-aware scorer; give one, or choose another ranking.")

    @property
    def name(self) -> str:
        """In tables."""
        return self.cfg.planner

    def run(self, station: Station, task: DynamicTask) -> MethodResult:
        """Grasp and lift, or find out why not.

        Raises:
            TrialOver: The judge of a trial has ended it.
        """
        run = Run(station, task, self.cfg, self.aids)
        planner: Reaching = Algorithm1(run) if self.cfg.planner == "thesis" else MeetingPlanner(run)
        while True:
            if (ending := planner.reach()) is not None:
                return run.result(*ending)
            failure = self._take(run, planner)
            if failure is None:
                run.tell(Phase.HOLDING)
                return run.result(GraspOutcome.LIFTED, lifted_s=run.now_s - run.begun_s)
            if not self.cfg.retry or run.attempts >= self.cfg.attempts_n or run.path_is_over():
                return run.result(failure, f"after {run.attempts} attempts" if run.attempts > 1 else "")
            planner.failed()
            run.let_go(RETREAT_M)

    def _take(self, run: Run, planner: Reaching) -> GraspOutcome | None:
        """Close, lift and look: nothing if the object is held, else what went wrong."""
        forecast, T_obj_tcp = planner.grasp()
        if not run.close(forecast, T_obj_tcp, planner.follows_while_closing):
            return GraspOutcome.MISSED
        before = run.target.last_pose
        if not run.lift():
            return GraspOutcome.NO_WAY
        return None if run.is_held(before) else GraspOutcome.SLIPPED
