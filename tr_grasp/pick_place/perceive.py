"""Grasps of an object that a calibrated camera sees: the taught one, one from above, or one out of a grasp set."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from tr_grasp.errors import ConfigError
from tr_grasp.geometry import invert_transform, rotation_about_z, transform_from, wxyz_from_matrix
from tr_grasp.grasps import (
    Grasps,
    GraspSet,
    gripper_of,
    gripper_shape,
    height_map_of_points,
    shipped_grasp_set,
    top_down_grasps,
)
from tr_grasp.grasps.ranking import RankingAids, rank_grasps
from tr_grasp.hardware import RGBDImage, Station
from tr_grasp.motion import inverse_kinematics
from tr_grasp.objects.bottle import bottle
from tr_grasp.pick_place.find import LEAST_POINTS, find_object, points_of
from tr_grasp.pick_place.scene import PlanningScene
from tr_grasp.pick_place.station import StationCfg
from tr_grasp.sensing.registration import largest_cluster, register

Array = NDArray[np.floating]
GraspChoice = Literal["taught", "top_down", "grasp_set"]
Candidates = Sequence[StationCfg] | str
ABOVE_M = 0.004
"""Points this much above the plane on which the object stands are the object's."""
MAP_SIDE_M, CELL_M = 0.30, 0.004
SHAPE_POINTS_N = 6000
LEAST_FITNESS, LARGEST_RMSE_M = 0.85, 0.004
SHIPPED_OBJECT = "bottle"
TURNS_N = 8
TAUGHT_TURNS_RAD = np.radians([15.0, -15.0, 30.0, -30.0, 45.0, -45.0])
"""Turns about the object's axis in which the taught grasp is tried where it cannot be carried out as it is."""
LOOKED_AT_N = 40
"""Grasps, best first, of which it is asked whether they can be carried to the place."""


@dataclass(frozen=True, eq=False)
class Perception:
    """Looks for a station's object and says how it could be grasped.

    Args:
        cfg: The station as it was taught.
        devices: With a camera; the arm at home must not stand in its way.
        T_base_cam: (4, 4) where the camera is, from a calibration.
        choice: ``taught`` moves the taught grasp to where the object is and, where the arm cannot do it so, turns it
            about the object's axis; ``top_down`` plans Task I's grasps on the height map that is seen, and knows
            nothing of the object's shape; ``grasp_set`` lays the known shape over the cloud and takes grasps that
            were tried before, ranked for this arm and place.
        grasps: For ``grasp_set``; those of the shipped bottle, if not given.

    Raises:
        ConfigError: No camera, no region to look in, or poses that do not follow the grasp.
        GraspError: The set is for another shape or gripper, or there is none for this robot.
    """

    cfg: StationCfg
    devices: Station
    T_base_cam: Array
    choice: GraspChoice = "taught"
    grasps: GraspSet | None = None

    def __post_init__(self) -> None:
        """Refuse what cannot work."""
        if self.devices.camera is None:
            raise ConfigError("looking for the object needs a camera.")
        if self.cfg.search_m is None:
            raise ConfigError("the station has no search_m, the region in which to look.")
        if self.choice != "taught" and self._on_their_own:
            raise ConfigError(
                f"--grasp {self.choice} needs a pose {self._on_their_own[0]!r} that is like {self.cfg.grasp!r}, "
                "backed off."
            )
        if self.choice == "grasp_set":
            gripper = gripper_of(self.cfg.robot)
            grasps = self.grasps or shipped_grasp_set(SHIPPED_OBJECT, gripper)
            object.__setattr__(self, "grasps", grasps.require_for(self._model, gripper))

    def __call__(self) -> Candidates:
        """The station for each grasp, best first, or why there is none."""
        ways: dict[GraspChoice, Callable[[RGBDImage], Candidates]] = {
            "taught": self._taught, "top_down": self._top_down, "grasp_set": self._from_set,
        }  # fmt: skip
        assert self.devices.camera is not None
        return ways[self.choice](self.devices.camera.capture())

    def _taught(self, image: RGBDImage) -> Candidates:
        found = find_object(image, self.T_base_cam, self.cfg)
        if isinstance(found, str):
            return found
        x, y, _ = self.cfg.object.foot_m
        moved = self.cfg.with_grasp_shifted((found[0] - x, found[1] - y, 0.0)).with_object_at(*found)
        if self._on_their_own:
            return [moved]
        T_base_object = moved.object.T_base_object
        T_object_tcp = invert_transform(T_base_object) @ self._scene.tool(moved.T_base_link(moved.grasp))
        turned = [
            self._regrasped(T_base_object @ transform_from(rotation_about_z(turn), np.zeros(3)) @ T_object_tcp, *found)
            for turn in TAUGHT_TURNS_RAD
        ]
        return [moved, *turned]

    def _top_down(self, image: RGBDImage) -> Candidates:
        points = object_points(image, self.T_base_cam, self.cfg)
        if isinstance(points, str):
            return points
        middle, table = (points[:, :2].min(0) + points[:, :2].max(0)) / 2, self.cfg.object.foot_m[2]
        seen = height_map_of_points(points, (float(middle[0]), float(middle[1])), MAP_SIDE_M, CELL_M, table)
        grasps = top_down_grasps(seen, middle[None], gripper=gripper_shape(self.cfg.robot))
        if not len(grasps):
            return "what stands there offers no grasp from above"
        # A hand of two sides grasps as well after half a turn.
        hands = np.stack(
            [
                from_above(grasps.position[k] + [0.0, 0.0, table], grasps.yaw_rad[k] + turn)
                for k in range(len(grasps))
                for turn in (0.0, np.pi)
            ]
        )
        reachable = hands[self._in_reach(hands)]
        if not len(reachable):
            return f"none of the {len(hands)} grasps from above can be reached"
        return self._carried([self._regrasped(T, T[0, 3], T[1, 3]) for T in reachable[:LOOKED_AT_N]])

    def _from_set(self, image: RGBDImage) -> Candidates:
        assert self.grasps is not None
        T_base_model = object_pose(image, self.T_base_cam, self.cfg)
        if isinstance(T_base_model, str):
            return T_base_model
        q, arm = np.asarray(self.devices.arm.commanded().q, float), self._scene.empty_hand
        aids, known = RankingAids(collisions=self._scene.at_object), all_around(self.grasps)
        order = rank_grasps(arm, known, T_base_model, q, "ours", self._back_off_m, aids)[:LOOKED_AT_N]
        if not len(order):
            return f"none of the {len(self.grasps)} grasps of the set can be reached"
        hands = T_base_model @ known.grasps.poses()[order]
        return self._carried([self._regrasped(T, *T_base_model[:2, 3]) for T in hands])

    def _in_reach(self, T_base_tcp: Array) -> NDArray[np.bool_]:
        """(n,) whether hands (n, 4, 4), and those backed off from them, have a posture without contact."""
        before = T_base_tcp.copy()
        before[:, :3, 3] -= self._back_off_m * before[:, :3, 2]
        scene = self._scene
        found = inverse_kinematics(scene.empty_hand, np.concatenate([T_base_tcp, before]), scene.home_q)
        free = found.found.copy()
        free[free] = scene.at_object.free(found.q_rad[free])
        return free.reshape(2, -1).all(axis=0)

    def _carried(self, stations: Sequence[StationCfg]) -> Candidates:
        """Those whose hand reaches the place as well."""
        scene = self._scene
        places = np.stack([scene.tool(station.T_base_link(station.place)) for station in stations])
        found = inverse_kinematics(scene.empty_hand, places, scene.home_q).found
        kept = [station for station, reached in zip(stations, found, strict=True) if reached]
        return kept or f"{len(stations)} grasps can be reached, but none can be carried to the place"

    def _regrasped(self, T_base_tcp: Array, x_m: float, y_m: float) -> StationCfg:
        return self._scene.regrasped(T_base_tcp, self.cfg.with_object_at(x_m, y_m).object.T_base_object)

    @property
    def _on_their_own(self) -> list[str]:
        """Poses around the grasp that do not follow it."""
        return [name for name in self.cfg.near_grasp if self.cfg.poses[name].like != self.cfg.grasp]

    @cached_property
    def _scene(self) -> PlanningScene:
        return PlanningScene(self.cfg)

    @property
    def _back_off_m(self) -> float:
        return self.cfg.poses[self.cfg.approach[-2]].back_off_m

    @property
    def _model(self):
        return bottle(self.cfg.object.radius_m, self.cfg.object.height_m)


def object_points(image: RGBDImage, T_base_cam: Array, cfg: StationCfg) -> Array | str:
    """(n, 3) of the one thing that stands in the searched region, base frame, or why there is none."""
    assert cfg.search_m is not None
    low, high = np.array(cfg.search_m[0]), np.array(cfg.search_m[1])
    low[2] = max(low[2], cfg.object.foot_m[2] + ABOVE_M)
    points = points_of(image, T_base_cam)
    points = largest_cluster(points[((points >= low) & (points <= high)).all(axis=1)])
    if len(points) < LEAST_POINTS:
        return f"{len(points)} points stand where to look; {LEAST_POINTS} are needed"
    return points


def object_pose(image: RGBDImage, T_base_cam: Array, cfg: StationCfg) -> Array | str:
    """``T_base_model`` (4, 4) of the station's upright object, its known shape laid over what is seen, or why not."""
    start = find_object(image, T_base_cam, cfg)
    points = object_points(image, T_base_cam, cfg)
    if isinstance(start, str) or isinstance(points, str):
        return start if isinstance(start, str) else str(points)
    model = bottle(cfg.object.radius_m, cfg.object.height_m)
    standing = cfg.object.foot_m[2] - float(model.bounds_m[0, 2])
    shape = np.asarray(model.visual.sample(SHAPE_POINTS_N, seed=0), float)
    found = register(points, shape, transform_from(np.eye(3), (*start, standing)))
    if found.fitness < LEAST_FITNESS or found.rmse_m > LARGEST_RMSE_M:
        return (
            f"what stands there is not the known object: {100 * found.fitness:.0f} % of its points lie on it, "
            f"{1e3 * found.rmse_m:.1f} mm off"
        )
    return found.T_cloud_shape


def all_around(grasps: GraspSet) -> GraspSet:
    """Each grasp in all turns about the object's axis: the object is one of revolution, so they hold alike."""
    turns = [transform_from(rotation_about_z(k * 2 * np.pi / TURNS_N), np.zeros(3)) for k in range(TURNS_N)]
    T = np.concatenate([turn @ grasps.grasps.poses() for turn in turns])
    every = np.tile(np.arange(len(grasps)), TURNS_N)
    turned = Grasps(T[:, :3, 3], wxyz_from_matrix(T[:, :3, :3]), grasps.grasps.width_m[every])
    return replace(grasps.subset(every), grasps=turned)


def from_above(position_m: Array, yaw_rad: float) -> Array:
    """``T_base_tcp`` (4, 4) of a hand that points down and closes along a yaw."""
    down = np.diag([1.0, -1.0, -1.0])
    # The tcp's y, along which it closes, is turned from -y of the base to the yaw.
    return transform_from(rotation_about_z(yaw_rad + np.pi / 2) @ down, position_m)
