"""``tr-grasp pick-place``: carry an object from one taught pose to another."""

from __future__ import annotations

import dataclasses
import json
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from tr_grasp.cli.arguments import device_settings
from tr_grasp.cli.table import text_table
from tr_grasp.configs.io import parse
from tr_grasp.errors import ConfigError
from tr_grasp.files import make_folder, write_atomically

if TYPE_CHECKING:
    from tr_grasp.envs.sapien_station import SapienStation
    from tr_grasp.pick_place import BlindPickPlace, StationCfg, TaskPlan, TaskResult

SIM = "sim"
FILM_S = 0.2
SETTLE_S = 0.3
AFTER_S = 0.7
FAILED = 1


@dataclass(frozen=True)
class PickPlaceCfg:
    """Pick and place at a station's taught poses, in simulation or on real devices: planned, timed, carried out."""

    station: str = "thesis"
    """A station that comes with the package, or your own YAML file."""

    dry_run: bool = False
    """Plan all stages, print them, and move nothing."""

    arm: str = SIM
    """sim, or the name of an arm's adapter; a run on a device begins with a dry run and asks."""

    gripper: str | None = None
    """Name of the gripper's adapter, where the arm does not bring its own."""

    camera: str | None = None
    """Name of the camera's adapter."""

    device: tuple[str, ...] = ()
    """Settings of the devices: arm_host=192.168.0.10, camera_serial=..."""

    find: Literal["taught", "camera"] = "taught"
    """Where the object is: where it was taught, or where a camera sees it."""

    grasp: Literal["taught", "top_down", "grasp_set"] = "taught"
    """How an object that the camera sees is grasped: as taught, moved along and, if need be, turned about the object;
    from above, whatever it is (Task I's grasps, on the heights that are seen); as in a grasp set, its known shape laid
    over what is seen."""

    grasp_set: Path | None = None
    """A file of tr-grasp grasps build for --grasp grasp_set; that of the station's bottle comes with the package."""

    camera_pose: Path | None = None
    """A calibration of that camera (tr-grasp calibrate); in simulation it is known."""

    trials: int = 1
    """How many, in simulation."""

    shift_m: float = 0.0
    """Largest shift of the simulated object along x and y."""

    seed: int = 0
    """Of the first trial; the next ones have the next seeds."""

    retries: int = 2
    """How often a grip that failed is tried again."""

    strip: Path | None = None
    """Write a PNG with one picture for each stage."""

    view: Path | None = None
    """Film it into this GIF or MP4."""

    out: Path | None = None
    """Write a line of JSON for each trial, and go on from those that are there; on devices, one for each stage."""

    def __post_init__(self) -> None:
        if self.trials < 1 or self.retries < 0:
            raise ConfigError(f"--trials must be 1 or more and --retries 0 or more, got {self.trials}, {self.retries}.")
        if self.trials > 1 and (self.dry_run or self.strip or self.view or self.arm != SIM or self.camera_pose):
            raise ConfigError("--trials counts simulated ones; leave the other flags out or make it 1.")
        if self.grasp != "taught" and self.find != "camera":
            raise ConfigError(f"--grasp {self.grasp} needs --find camera.")
        if self.grasp_set is not None and self.grasp != "grasp_set":
            raise ConfigError("--grasp-set is for --grasp grasp_set.")
        if self.arm != SIM and (self.strip or self.view):
            raise ConfigError("--strip and --view draw a simulation; leave them out for --arm " + self.arm)


def main(args: list[str]) -> int:
    """Run the verb.

    Returns:
        0; 1 if the object was not placed, a wall was touched, or there is no plan.
    """
    cfg = parse(PickPlaceCfg, args, prog="tr-grasp pick-place")
    from tr_grasp.pick_place import read_station

    station = read_station(cfg.station)
    if cfg.trials > 1:
        from tr_grasp.cli.pick_place_trials import many

        return many(cfg, station)
    return simulated(cfg, station) if cfg.arm == SIM else on_devices(cfg, station)


def simulated(cfg: PickPlaceCfg, station: StationCfg) -> int:
    """One task in SAPIEN."""
    from tr_grasp.envs.pick_place_view import snapshot, strip_of, view_camera
    from tr_grasp.envs.pick_place_world import judge, look_camera, pick_place_world
    from tr_grasp.pick_place import BlindPickPlace

    rng = np.random.default_rng(cfg.seed)
    shift = rng.uniform(-cfg.shift_m, cfg.shift_m, 2)
    foot = (station.object.foot_m[0] + shift[0], station.object.foot_m[1] + shift[1])
    eye = view_camera(station)
    devices = pick_place_world(station, foot_m=foot, camera=look_camera(station) if cfg.find == "camera" else eye)
    devices.world.wait(SETTLE_S)
    devices.world.forget_touches()
    pictures = []

    def watch(record) -> None:
        print(f"  {record.begun_s:6.2f} s  {record.name:12} {record.reason or 'done'}", flush=True)
        if cfg.strip is not None:
            pictures.append((record.name, snapshot(devices, eye)))

    locate = None if cfg.find == "taught" else locator(cfg, station, devices)
    task = BlindPickPlace(station, devices, locate=locate, watch=watch)
    if cfg.dry_run:
        return show_plan(task, cfg.strip, devices, eye)
    film = Film(devices, eye) if cfg.view is not None else None
    result = task.run(cfg.retries)
    devices.world.wait(AFTER_S)
    verdict = judge(devices, station)
    say(result)
    where = ("upright" if verdict.upright else "lying") if verdict.placed else "not placed"
    print(f"the simulator: {where}, {len(verdict.touches)} touches of walls")
    if cfg.strip is not None and pictures:
        make_folder(cfg.strip.parent)
        write_atomically(cfg.strip, strip_of(pictures))
        print(f"strip {cfg.strip}")
    if film is not None and cfg.view is not None:
        film.save(cfg.view)
        print(f"film  {cfg.view}")
    return 0 if verdict.placed and not verdict.touches else FAILED


def on_devices(cfg: PickPlaceCfg, station: StationCfg) -> int:
    """One task on real devices: a dry run without them, a question, then the task behind a guard."""
    from tr_grasp.hardware import Guard
    from tr_grasp.hardware.devices import confirm, open_station, robot_of
    from tr_grasp.motion import Kinematics
    from tr_grasp.pick_place import BlindPickPlace
    from tr_grasp.robots import robot_spec

    settings = device_settings(cfg.device)
    spec = robot_of(cfg.arm, cfg.gripper)
    if spec.name != station.robot:
        raise ConfigError(f"the station is for {station.robot}, --arm {cfg.arm} makes {spec.name}.")

    def rehearse(copy) -> str:
        plan = BlindPickPlace(station, copy).dry_run()
        if isinstance(plan, str) or not plan.succeeded:
            raise ConfigError(f"there is no plan: {plan if isinstance(plan, str) else plan.reason}.")
        print(plan_table(plan))
        return f"{len(plan.stages)} stages, motions of {sum(step.duration_s for step in plan.stages):.1f} s."

    if cfg.dry_run:
        print(rehearse(rehearsal_of(cfg)))
        return 0
    if not confirm(cfg.arm, cfg.gripper, rehearse):
        print("nothing was moved")
        return FAILED
    with closing(open_station(cfg.arm, cfg.gripper, cfg.camera, **settings)) as devices:
        guarded = Guard(devices, Kinematics(robot_spec(station.robot))).station
        locate = None if cfg.find == "taught" else locator(cfg, station, guarded)
        stages = []

        def watch(record) -> None:
            print(f"  {record.name:12} {record.reason or 'done'}", flush=True)
            stages.append(json.dumps(dataclasses.asdict(record)))
            if cfg.out is not None:  # after every stage: whatever happens next, this is known
                make_folder(cfg.out.parent)
                write_atomically(cfg.out, "\n".join(stages) + "\n")

        result = BlindPickPlace(station, guarded, locate=locate, watch=watch).run(cfg.retries)
    say(result)
    return 0 if result.outcome.succeeded else FAILED


def rehearsal_of(cfg: PickPlaceCfg):
    """The same robot without devices."""
    from tr_grasp.hardware.devices import rehearsal

    return rehearsal(cfg.arm, cfg.gripper)


def show_plan(task: BlindPickPlace, strip: Path | None = None, devices: SapienStation | None = None, eye=None) -> int:
    """Print what would be done and, if wanted, draw where the arm would be after each stage."""
    plan = task.dry_run()
    if isinstance(plan, str):
        print(f"the object was not found: {plan}")
        return FAILED
    print(plan_table(plan))
    if not plan.succeeded:
        print(f"no plan: {plan.reason}")
    if strip is not None and devices is not None and eye is not None:
        from tr_grasp.envs.pick_place_view import snapshot, strip_of

        pictures = []
        for step in plan.stages:
            if step.trajectory is not None:
                devices.arm.place(step.trajectory.q_rad[-1])
            pictures.append((step.stage.name, snapshot(devices, eye)))
        if pictures:
            make_folder(strip.parent)
            write_atomically(strip, strip_of(pictures))
            print(f"strip {strip}")
    return 0 if plan.succeeded else FAILED


def plan_table(plan: TaskPlan) -> str:
    """Stages, how each motion was found, and how long it takes."""
    rows = []
    for step in plan.stages:
        if step.plan is None or step.plan.path is None:
            rows.append([step.stage.name, step.stage.do, "", "", ""])
            continue
        found = step.plan.how or "already there"
        rows.append([step.stage.name, step.stage.do, found, str(len(step.plan.path)), f"{step.duration_s:.2f}"])
    total = sum(step.duration_s for step in plan.stages)
    table = text_table(["stage", "do", "found by", "waypoints", "seconds"], rows, left_n=3)
    return f"{table}\nmotions take {total:.1f} s, planning took {plan.seconds:.2f} s; nothing was moved"


def say(result: TaskResult) -> None:
    """How the task went, by its own account."""
    for reason in result.retries:
        print(f"tried again: {reason}")
    print(f"{result.reason}; {result.cycle_s:.1f} s")


def locator(cfg: PickPlaceCfg, station: StationCfg, devices):
    """What finds the object with the camera of the devices.

    Raises:
        ConfigError: There is no camera, or its place is not known.
        GraspError: The grasp set is for something else.
    """
    from tr_grasp.grasps import GraspSet
    from tr_grasp.pick_place import Perception

    if devices.camera is None:
        raise ConfigError("--find camera needs --camera.")
    if cfg.camera_pose is not None:
        from tr_grasp.calibration.interchange import load_calibration

        record = load_calibration(cfg.camera_pose)
        if record.setup != "eye_on_base":
            raise ConfigError(
                f"--camera-pose must be of a camera beside the robot, '{cfg.camera_pose}' is in its hand."
            )
        T_base_cam = np.asarray(record.T_parent_cam)
    elif cfg.arm == SIM:
        T_base_cam = devices.camera.camera.T_base_cam
    else:
        raise ConfigError("--find camera needs --camera-pose, the result of tr-grasp calibrate.")
    grasps = None if cfg.grasp_set is None else GraspSet.load(cfg.grasp_set)
    return Perception(station, devices, T_base_cam, cfg.grasp, grasps)


class Film:
    """Takes a picture every 0.2 simulated seconds."""

    def __init__(self, devices: SapienStation, eye) -> None:
        self._devices, self._eye, self._next_s, self._frames = devices, eye, 0.0, []
        devices.world.before_step(self._look)

    def _look(self) -> None:
        from tr_grasp.envs.pick_place_view import snapshot

        if self._devices.world.now_s >= self._next_s:
            self._next_s = self._devices.world.now_s + FILM_S
            self._frames.append(snapshot(self._devices, self._eye))

    def save(self, path: Path) -> None:
        """Write it."""
        from tr_grasp.evaluation.film import save_film

        make_folder(path.parent)
        save_film(path, self._frames, FILM_S / 2)
