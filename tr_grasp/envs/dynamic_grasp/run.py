"""A trial from the first step to the verdict."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from tr_grasp.configs.dynamic import DynamicCfg
from tr_grasp.dynamic import DynamicMethod, MethodResult, TrialOver
from tr_grasp.dynamic.record import TrialRecord
from tr_grasp.envs.dynamic_grasp.judge import Judge, Verdict
from tr_grasp.envs.dynamic_grasp.scene import DynamicScene
from tr_grasp.envs.dynamic_grasp.trial import Trial
from tr_grasp.errors import GraspError
from tr_grasp.grasps import GraspSet, floating_gripper, gripper_names, shipped_grasp_set
from tr_grasp.sensing import PinholeCamera

SAME_SHAPE_M = 0.002


def grasps_for(scene: DynamicScene) -> GraspSet:
    """The grasps of a scene's object: those in the folder that its settings name, else those of the package.

    Raises:
        GraspError: There are none, or they were made for another shape, as those of the package for scanned objects.
    """
    cfg, name, gripper = scene.cfg, scene.trial.object_name, _gripper_name(scene)
    if cfg.grasps is not None:
        return GraspSet.load(Path(cfg.grasps).expanduser() / f"{name}.grasps.safetensors")
    found = shipped_grasp_set(name, gripper)
    extent = np.ptp(np.concatenate([part.vertices for part in scene.model.parts]), axis=0)
    if cfg.models != "primitive" and np.abs(np.ptp(found.bounds_m, axis=0) - extent).max() > SAME_SHAPE_M:
        raise GraspError(
            f"the grasps of {name!r} that come with the package are for the plain solid, not for the mesh in"
            f" {cfg.models!r}; build some (tr-grasp grasps build) and name their folder with --grasps."
        )
    return found


def _gripper_name(scene: DynamicScene) -> str:
    for name in gripper_names():
        if floating_gripper(name).gripper == scene.spec.gripper:
            return name
    raise GraspError(f"no grasps are known for the gripper of {scene.spec.name!r}; name a folder with --grasps.")


def run_trial(
    cfg: DynamicCfg,
    trial: Trial,
    method: DynamicMethod,
    *,
    camera: PinholeCamera | None = None,
    find_grasps: Callable[[DynamicScene], GraspSet] | None = None,
    on_scene: Callable[[DynamicScene], None] | None = None,
) -> TrialRecord:
    """Let a method try once.

    Args:
        cfg: The world.
        trial: What is random in it.
        method: Who grasps.
        find_grasps: Grasps of the scene's object; those of :func:`grasps_for` by default.
        camera: Of the station, if there is one.
        on_scene: Called before the method runs: to film it, for instance.

    Raises:
        ConfigError: A world that cannot be.
        GraspError: There are no grasps for the object.
    """
    begun = time.perf_counter()
    scene = DynamicScene.of(cfg, trial, camera)
    grasps = (find_grasps or grasps_for)(scene)
    judge = Judge(scene)
    built = time.perf_counter()
    if on_scene is not None:
        on_scene(scene)
    said: MethodResult | TrialOver
    try:
        said = method.run(scene.station, scene.task(grasps, judge.tell))
    except TrialOver as over:
        said = over
    world = scene.station.world
    over_s, charged_s = world.now_s, world.charged_s
    verdict = judge.verdict(said)
    ended = time.perf_counter()
    times_s, walls_s = (over_s, world.now_s, charged_s), (ended - begun, built - begun)
    return _record(cfg, trial, method.name, verdict, said, times_s, walls_s)


def _record(
    cfg: DynamicCfg,
    trial: Trial,
    method: str,
    verdict: Verdict,
    said: MethodResult | TrialOver,
    times_s: tuple[float, float, float],
    walls_s: tuple[float, float],
) -> TrialRecord:
    result = said if isinstance(said, MethodResult) else MethodResult(said.outcome)
    committed = verdict.committed_s
    return TrialRecord(
        method=method,
        motion=trial.motion,
        object_name=trial.object_name,
        speed_m_s=cfg.speed_m_s,
        number=trial.number,
        seed=trial.seed,
        success=verdict.outcome.is_success,
        outcome=verdict.outcome.label,
        detail=verdict.detail,
        time_s=times_s[0] if committed is None else committed,
        committed=committed is not None,
        lifted_s=verdict.lifted_s,
        end_s=times_s[1],
        attempts=max(verdict.attempts, result.attempts),
        loops=result.loops,
        switches=result.switches,
        thinking_s=times_s[2],
        notes=json.dumps(result.notes, sort_keys=True),
        wall_s=walls_s[0],
        build_s=walls_s[1],
    )
