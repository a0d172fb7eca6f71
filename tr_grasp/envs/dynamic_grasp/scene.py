"""The station of Task II in SAPIEN: an arm, a carrier on its way, the target on it, and what is in the way."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from sapien import physx

from tr_grasp.configs.dynamic import DynamicCfg, TrackingCfg
from tr_grasp.dynamic import DynamicTask, Phase
from tr_grasp.envs.dynamic_grasp.obstacles import PATH_M, known_object
from tr_grasp.envs.dynamic_grasp.ride import Ride
from tr_grasp.envs.dynamic_grasp.trial import Trial
from tr_grasp.envs.sapien_station import SapienStation
from tr_grasp.envs.things import Thing
from tr_grasp.errors import ConfigError
from tr_grasp.geometry import invert_transform, rotation_about_z, transform_from
from tr_grasp.grasps import GraspSet
from tr_grasp.hardware import PoseStreamCfg
from tr_grasp.objects import ObjectModel
from tr_grasp.objects.conveyor import ConveyorObject
from tr_grasp.robots import RobotSpec, robot_spec
from tr_grasp.sensing import PinholeCamera

Array = NDArray[np.floating]

TARGET, CARRIER, FLOOR, SLAB, OBSTACLE = "target", "carrier", "floor", "slab", "obstacle"
CARRIER_M = (0.10, 0.10, 0.02)
FLOOR_M = (4.0, 4.0, 0.1)
SLAB_M, SLAB_HEIGHT_M = (0.08, PATH_M, 0.02), 0.40
BELOW_M = 0.002
"""The floor is as far below the base's foot: a foot that stands on it would be in collision for planners."""
THESIS_HOME_RAD = (0.0, -1.15, 0.9, -0.66, 0.0, 0.0)
FLOOR_RGB, CARRIER_RGB, SLAB_RGB = (0.60, 0.62, 0.64), (0.20, 0.45, 0.70), (0.72, 0.58, 0.40)


@dataclass(frozen=True, eq=False)
class DynamicScene:
    """A trial that is ready to be run.

    Attributes:
        cfg, trial: What it is.
        spec: The robot.
        model: The target.
        station: For the method.
        ride: Of the carrier.
        T_top_target: (4, 4) the target on the carrier's top, as it stands there at first.
        obstacle_names: Of the things that can be overturned.
    """

    cfg: DynamicCfg
    trial: Trial
    spec: RobotSpec
    model: ObjectModel
    station: SapienStation
    ride: Ride
    T_top_target: Array
    obstacle_names: tuple[str, ...]

    @classmethod
    def of(cls, cfg: DynamicCfg, trial: Trial, camera: PinholeCamera | None = None) -> DynamicScene:
        """Build it; the clock stands at 0, and the carrier moves from then on.

        Raises:
            ConfigError: No such robot, object or folder; the thesis' home for another arm than the UR5.
            MeshError: Files of an object that cannot be used.
        """
        spec, ride = robot_spec(cfg.robot), Ride(trial.path(cfg.speed_m_s), 1 / cfg.physics_hz)
        target = _object(cfg, trial.object_name)
        T_top_target = standing(target.model, trial.yaw_rad)
        things = [*_carried(cfg, target, ride, T_top_target, trial.seed + trial.number), *_surroundings(cfg, trial)]
        station = SapienStation.of(cfg.robot, things=things, camera=camera, physics_hz=cfg.physics_hz)
        station.arm.place(home_q_rad(cfg, spec))
        _push_off(station, ride)
        names = tuple(thing.name for thing in things if thing.name.startswith(OBSTACLE))
        return cls(cfg, trial, spec, target.model, station, ride, T_top_target, names)

    def task(self, grasps: GraspSet, tell: Callable[[Phase], None]) -> DynamicTask:
        """What a method knows."""
        cfg, things = self.cfg, self.station.world.things
        still = [thing for name, thing in things.items() if name not in (TARGET, CARRIER, FLOOR)]
        obstacles = things[FLOOR].obstacles(may_touch=(self.spec.base_link,))
        return DynamicTask(
            robot=self.spec,
            target=TARGET,
            model=self.model,
            grasps=grasps,
            obstacles=(*obstacles, *(part for thing in still for part in thing.obstacles())),
            carrier_size_m=CARRIER_M,
            T_target_carrier=invert_transform(self.T_top_target) @ _above(-CARRIER_M[2] / 2),
            path_end_s=self.ride.duration_s if cfg.tell_path_end else None,
            lift_m=cfg.judge.lift_m,
            charges=cfg.charges,
            seed=self.trial.seed + self.trial.number,
            tell=tell,
        )


def standing(model: ObjectModel, yaw_rad: float) -> Array:
    """(4, 4) an object that stands on z = 0 with its origin above that of the plane."""
    lowest = min(float(np.asarray(part.vertices)[:, 2].min()) for part in model.parts)
    return transform_from(rotation_about_z(yaw_rad), [0.0, 0.0, -lowest])


def home_q_rad(cfg: DynamicCfg, spec: RobotSpec) -> tuple[float, ...]:
    """(dof,) where the arm waits.

    Raises:
        ConfigError: The thesis' home is the UR5's.
    """
    if cfg.home == "robot":
        return spec.home_q_rad
    if not spec.name.startswith("ur5"):
        raise ConfigError(f"home: the thesis' home is that of a UR5, not of {spec.name!r}; choose --home robot.")
    return THESIS_HOME_RAD


def _object(cfg: DynamicCfg, name: str) -> ConveyorObject:
    return known_object(name, None if cfg.models == "primitive" else cfg.models)


def _carried(cfg: DynamicCfg, target: ConveyorObject, ride: Ride, T_top_target: Array, seed: int) -> list[Thing]:
    T_base_top = ride(np.zeros(1))[0]
    sunk = _above(-CARRIER_M[2] / 2)
    mass = target.mass_kg if cfg.target_mass_kg is None else cfg.target_mass_kg
    rides = Thing(
        TARGET, T_base_top @ T_top_target, model=target.model, mass_kg=mass, friction=cfg.friction,
        stream=_stream(cfg.tracking, seed),
    )  # fmt: skip
    carries = Thing(
        CARRIER, T_base_top @ sunk, size_m=CARRIER_M, motion=lambda times: ride(times) @ sunk, colour=CARRIER_RGB
    )
    return [rides, carries]


def _surroundings(cfg: DynamicCfg, trial: Trial) -> list[Thing]:
    things = [Thing(FLOOR, _above(-BELOW_M - FLOOR_M[2] / 2), size_m=FLOOR_M, colour=FLOOR_RGB)]
    for obstacle in trial.obstacles:
        one = _object(cfg, obstacle.name)
        T = standing(one.model, obstacle.yaw_rad)
        T[:3, 3] += obstacle.x_m, obstacle.y_m, -BELOW_M
        things.append(Thing(f"{OBSTACLE} {obstacle.name}", T, model=one.model, mass_kg=one.mass_kg))
    if trial.has_slab:
        x, y = trial.line.point(0.0, 0.0)
        T = transform_from(rotation_about_z(trial.line.theta_rad), [x, y, SLAB_HEIGHT_M])
        things.append(Thing(SLAB, T, size_m=SLAB_M, colour=SLAB_RGB))
    return things


def _push_off(station: SapienStation, ride: Ride) -> None:
    """Give the target the carrier's speed, so that nothing jerks at the start."""
    body = station.world.entities[TARGET].find_component_by_type(physx.PhysxRigidDynamicComponent)
    body.set_linear_velocity(ride.velocity)
    body.set_angular_velocity([0.0, 0.0, ride.yaw_rate])


def _stream(cfg: TrackingCfg, seed: int) -> PoseStreamCfg:
    return PoseStreamCfg(cfg.rate_hz, cfg.latency_s, cfg.noise_m, cfg.noise_rad, cfg.dropout_share, seed)


def _above(height_m: float) -> Array:
    return transform_from(np.eye(3), [0.0, 0.0, height_m])
