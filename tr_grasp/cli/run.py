"""``tr-grasp run``: let a policy act on a station, simulated or real, and keep a log that can be played again."""

from __future__ import annotations

import sys
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from tr_grasp.cli.arguments import device_settings
from tr_grasp.configs.io import parse
from tr_grasp.errors import ConfigError
from tr_grasp.files import make_folder

if TYPE_CHECKING:
    from tr_grasp.configs import EnvCfg
    from tr_grasp.deploy import RunLog, RunStep

SIM = "sim"
FAILED = 1
WORKSPACE_MARGIN_M = 0.05
SIM_EFFORT_SHARE = 10.0
"""Simulated drives take the steps in speed of `stepped`; the wrists of real arms are rated for less."""
FRAME_S = 0.25
SAME_ACTION = 1e-5


@dataclass(frozen=True)
class RunCfg:
    """Let a Task I policy grasp through the hardware protocols: camera, octree, policy, tool step, joint motion."""

    policy: str = "panda"
    """A shipped policy, or the folder of a saved one."""

    arm: str = SIM
    """sim, or the name of an arm's adapter; a run on a device begins with a dry run and asks."""

    gripper: str | None = None
    """Name of the gripper's adapter, where the arm does not bring its own."""

    camera: str | None = None
    """Name of the camera's adapter."""

    camera_pose: Path | None = None
    """Calibration of that camera (tr-grasp calibrate); in simulation it is known."""

    device: tuple[str, ...] = ()
    """Settings of the devices: arm_host=192.168.0.10."""

    execution: Literal["stepped", "smooth", "planned"] | None = None
    """How steps become motion: as in training (stepped), with limited acceleration and jerk (smooth), or planned
    around the table (planned); stepped in simulation and smooth on devices, if not given."""

    steps: int | None = None
    """At most so many actions; as many as an episode of the policy's task has, if not given."""

    objects: Literal["test", "train"] = "test"
    """Which simulated objects."""

    seed: int = 20_000
    """Of the first simulated scene; the next ones have the next seeds."""

    episodes: int = 1
    """How many runs, in simulation."""

    log: Path = Path("runs/run")
    """Folder of the logs, one file for each run."""

    replay: Path | None = None
    """Play the log of a run again instead: its actions are compared with the policy's, and it is filmed to --view."""

    view: Path | None = None
    """GIF or MP4 of the replay; a PNG shows pictures of it."""

    def __post_init__(self) -> None:
        if self.episodes < 1 or (self.steps is not None and self.steps < 1):
            raise ConfigError("--episodes and --steps must be 1 or more.")
        if self.arm != SIM and self.episodes > 1:
            raise ConfigError(f"--episodes counts simulated runs; leave it out for --arm {self.arm}.")
        if self.view is not None and self.replay is None:
            raise ConfigError("--view films a log; name it with --replay.")


def main(args: list[str]) -> int:
    """Run the verb.

    Returns:
        0; 1 if nothing was lifted in a single run, or a replay's actions are not the policy's.
    """
    # The policy may stand first, without a flag.
    args = ["--policy", *args] if args and not args[0].startswith("-") else args
    cfg = parse(RunCfg, args, prog="tr-grasp run")
    if cfg.replay is not None:
        return play_again(cfg, cfg.replay)
    return simulated(cfg) if cfg.arm == SIM else on_devices(cfg)


def simulated(cfg: RunCfg) -> int:
    """Runs in SAPIEN, each in a scene of Task I, through the protocols and behind a guard."""
    from tr_grasp.deploy import PolicyRun, RunEnding
    from tr_grasp.envs import make_env
    from tr_grasp.envs.policy_world import object_heights, station_of
    from tr_grasp.evaluation.rollouts import one_thread
    from tr_grasp.evaluation.statistics import Counts, wilson_interval
    from tr_grasp.modules import load_policy
    from tr_grasp.robots import robot_spec

    policy, training = load_policy(cfg.policy)
    task = with_objects(training.env, cfg.objects)
    lifted = []
    with one_thread():
        for number in range(cfg.seed, cfg.seed + cfg.episodes):
            with closing(make_env(task, seed=number)) as env:
                env.reset()
                devices, T_base_cam = station_of(env), env.task.view.camera.T_base_cam
            before = object_heights(devices)
            run = PolicyRun(
                policy,
                task,
                robot_spec(task.robot),
                guarded(devices, task, SIM_EFFORT_SHARE),
                T_base_cam,
                execution=cfg.execution or "stepped",
                meta={"policy": cfg.policy, "arm": SIM, "seed": number, "objects": cfg.objects},
            )
            result = run.run(cfg.steps)
            risen = float((object_heights(devices) - before).max())
            truly = result.ending is RunEnding.LIFTED and risen > task.reward.lift_height_m / 2
            lifted.append(truly)
            run.log.meta["lifted"] = truly
            path = run.log.save(cfg.log / f"{cfg.policy.rstrip('/').split('/')[-1]}_{number}.npz")
            print(f"seed {number}  {result.reason}  {result.steps_n} steps  {1e3 * risen:.0f} mm  {path}", flush=True)
    if cfg.episodes > 1:
        low, high = wilson_interval(Counts(sum(lifted), len(lifted)))
        print(f"{sum(lifted)} of {len(lifted)} lifted [{100 * low:.0f}, {100 * high:.0f}] %")
        return 0
    return 0 if lifted[0] else FAILED


def on_devices(cfg: RunCfg) -> int:
    """One run on real devices: a rehearsal without them, a question, then the run behind a guard."""
    from tr_grasp.calibration.interchange import load_calibration
    from tr_grasp.deploy import CartesianSteps, PolicyRun, RunEnding
    from tr_grasp.hardware.devices import confirm, open_station, robot_of
    from tr_grasp.modules import load_policy

    if cfg.camera is None or cfg.camera_pose is None:
        raise ConfigError("a run on devices needs --camera and --camera-pose, the result of tr-grasp calibrate.")
    policy, training = load_policy(cfg.policy)
    task, spec = training.env, robot_of(cfg.arm, cfg.gripper)
    if spec.name != task.robot:
        raise ConfigError(f"'{cfg.policy}' learned on {task.robot}, --arm {cfg.arm} makes {spec.name}.")
    record = load_calibration(cfg.camera_pose)
    if record.setup != "eye_on_base":
        raise ConfigError(f"--camera-pose must be of a camera beside the robot, '{cfg.camera_pose}' is in its hand.")
    execution = cfg.execution or "smooth"

    def rehearse(copy) -> str:
        steps = CartesianSteps(task, spec, guarded(copy, task), execution)
        for action in np.vstack([np.eye(5), -np.eye(5)]) * 0.5:
            if reason := steps.step(action):
                raise ConfigError(f"the rehearsal failed: {reason}.")
        return f"half a step along every axis keeps the rules; up to {cfg.steps or task.episode_steps} steps follow."

    if not confirm(cfg.arm, cfg.gripper, rehearse):
        print("nothing was moved")
        return FAILED
    with closing(open_station(cfg.arm, cfg.gripper, cfg.camera, **device_settings(cfg.device))) as devices:
        run = PolicyRun(
            policy,
            task,
            spec,
            guarded(devices, task),
            np.asarray(record.T_parent_cam),
            execution=execution,
            meta={"policy": cfg.policy, "arm": cfg.arm},
        )
        try:
            result = run.run(cfg.steps, watch=say)
        finally:
            print(f"log   {run.log.save(cfg.log / f'{spec.name}.npz')}", file=sys.stderr)
    print(result.reason)
    return 0 if result.ending is RunEnding.LIFTED else FAILED


def play_again(cfg: RunCfg, path: Path) -> int:
    """Compare a log with its policy, and film it."""
    from tr_grasp.deploy import RunLog
    from tr_grasp.deploy.pictures import log_frames
    from tr_grasp.deploy.runner import disagreement
    from tr_grasp.evaluation.film import check_format, save_film
    from tr_grasp.evaluation.rollouts import one_thread
    from tr_grasp.modules import load_policy

    if cfg.view is not None:
        check_format(cfg.view)
    log = RunLog.load(path)
    for step in log.steps:
        say(step)
    print(summary(log))
    policy, _ = load_policy(str(log.meta.get("policy", cfg.policy)))
    with one_thread():
        worst = disagreement(policy, log)
    print(f"actions of the log and of the policy differ by {worst:.1e} at most")
    if cfg.view is not None and log.steps:
        make_folder(cfg.view.parent)
        save_film(cfg.view, log_frames(log), FRAME_S)
        print(f"film  {cfg.view}")
    return 0 if worst < SAME_ACTION else FAILED


def say(step: RunStep) -> None:
    """One decision in one line."""
    x, y, z = step.proprio[-1][1:4]
    action = " ".join(f"{a:+.2f}" for a in step.action)
    print(f"  {step.stamp_s:6.2f} s  [{action}]  tcp ({x:.3f}, {y:.3f}, {z:.3f}) m  {1e3 * step.opening_m:.0f} mm")


def summary(log: RunLog) -> str:
    """What a log is of."""
    meta = log.meta
    return (
        f"{len(log.steps)} steps of '{meta.get('policy')}' on {meta.get('arm')} ({meta.get('execution')}): "
        f"{meta.get('reason', 'unfinished')}"
    )


def with_objects(task: EnvCfg, split: Literal["test", "train"]) -> EnvCfg:
    """The task with the objects of a split, scattered, two to four of them."""
    chosen = replace(task.objects, split=split, arrangement="scattered", count_range=(2, 4))
    return replace(task, objects=chosen)


def guarded(devices, task: EnvCfg, effort_share: float = 1.0):
    """The devices behind a guard that keeps the tool near the workspace."""
    from tr_grasp.hardware import Guard, GuardCfg
    from tr_grasp.motion import Kinematics
    from tr_grasp.robots import robot_spec

    w, half = task.workspace, task.workspace.side_m / 2 + WORKSPACE_MARGIN_M
    (x, y, _), (low, high) = w.centre_m, w.tcp_height_m
    corners = (
        (x - half, y - half, min(low, 0.0) - WORKSPACE_MARGIN_M),
        (x + half, y + half, high + WORKSPACE_MARGIN_M),
    )
    cfg = GuardCfg(workspace_m=corners, jump_rad=0.2, effort_share=effort_share)
    return Guard(devices, Kinematics(robot_spec(task.robot)), cfg).station
