"""What a station means to a planner: tool poses, and what the arm may not touch while its hand is empty or full."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tr_grasp.errors import ConfigError, unknown_name
from tr_grasp.geometry import invert_transform, rotation_about_z, transform_from
from tr_grasp.motion import CollisionModel, Kinematics, MotionLimits, Obstacle, box
from tr_grasp.pick_place.station import HOME, BoxCfg, StationCfg
from tr_grasp.robots import JointSpec, LinkSpec, RobotSpec, Shape, robot_spec

Array = NDArray[np.floating]
MARGIN_M = 0.015
"""By which boxes grow for planning, and by which the bottle in the hand shrinks at its ends: it stands on things."""
HELD = "held_object"
HELD_PART = 0.9


class PlanningScene:
    """A station with the robot's kinematics.

    Args:
        station: The station.

    Attributes:
        spec: The robot.
        home_q: (dof,) joints at home.
        limits: What motions keep to.

    Raises:
        ConfigError: No such robot or link, or another number of joints at home.
    """

    def __init__(self, station: StationCfg) -> None:
        self.station, self.spec = station, robot_spec(station.robot)
        links = [link.name for link in self.spec.links]
        if station.pose_link not in links and station.pose_link != self.spec.tcp_link:
            raise ConfigError(f"pose_link: {unknown_name('link', station.pose_link, links)}")
        self.home_q = np.array(station.home_q_rad or self.spec.home_q_rad, float)
        if len(self.home_q) != len(self.spec.joints):
            raise ConfigError(
                f"home_q_rad must have the {len(self.spec.joints)} joints of {station.robot}, got {len(self.home_q)}"
            )
        self.limits = MotionLimits.of(self.spec).scaled(station.speed_share)
        self.empty_hand = Kinematics(self.spec)
        T_base_link = self.empty_hand.link_pose(self.home_q, station.pose_link)
        self._T_link_tcp = invert_transform(T_base_link) @ self.empty_hand.pose(self.home_q)

    def goal(self, name: str) -> Array:
        """Joints (dof,) of home, or ``T_base_tcp`` (4, 4) of a named pose."""
        return self.home_q if name == HOME else self.tool(self.station.T_base_link(name))

    def tool(self, T_base_link: Array) -> Array:
        """``T_base_tcp`` (4, 4) where the link whose poses are given is at ``T_base_link``."""
        return T_base_link @ self._T_link_tcp

    @cached_property
    def before_grip(self) -> CollisionModel:
        """The empty hand among all boxes and the object."""
        return self._with_object(self.station.object.T_base_object)

    @cached_property
    def after_release(self) -> CollisionModel:
        """The empty hand among all boxes and the object at its place."""
        return self._with_object(self.goal(self.station.place) @ self._T_tcp_object)

    @cached_property
    def at_object(self) -> CollisionModel:
        """The empty hand among all boxes: it may touch the object."""
        return CollisionModel(self.empty_hand, self._boxes)

    @cached_property
    def full_hand(self) -> CollisionModel:
        """The hand with the object in it, as the taught grasp holds it, among all boxes."""
        return CollisionModel(Kinematics(self._holding(), 2 * self.station.object.radius_m), self._boxes)

    def _with_object(self, T_base_object: Array) -> CollisionModel:
        o = self.station.object
        bottle = box("object", (2 * o.radius_m, 2 * o.radius_m, o.height_m), T_base_object)
        return CollisionModel(self.empty_hand, [*self._boxes, bottle])

    @cached_property
    def _boxes(self) -> list[Obstacle]:
        return [
            box(name, b.size_m, pose_of_box(b), margin_m=self._margin_m(name, b))
            for name, b in self.station.boxes.items()
        ]

    def _margin_m(self, name: str, b: BoxCfg) -> float:
        # What the object stands on is come close to; what must not be touched is not.
        return max(b.margin_m, MARGIN_M if name in self.station.not_to_touch else 0.0)

    def _holding(self) -> RobotSpec:
        """The robot with one more link, the object."""
        o = self.station.object
        T_tcp_object = self._T_tcp_object
        height = max(o.height_m - 2 * MARGIN_M, o.height_m / 2)
        rpy = _rpy(T_tcp_object[:3, :3])
        x, y, z = T_tcp_object[:3, 3]
        shape = Shape("cylinder", (HELD_PART * o.radius_m, height), (float(x), float(y), float(z)), rpy)
        link = LinkSpec(HELD, 1e-3, inertia_kgm2=(1e-6, 1e-6, 1e-6, 0.0, 0.0, 0.0), shapes=(shape,))
        joint = JointSpec("held_object_joint", self.spec.tcp_link, HELD, "fixed")
        return replace(
            self.spec, links=(*self.spec.links, link), fixed_joints=(*self.spec.fixed_joints, joint), urdf_path=None
        )

    @property
    def _T_tcp_object(self) -> Array:
        """(4, 4) the object in the hand, as it is grasped."""
        return invert_transform(self.goal(self.station.grasp)) @ self.station.object.T_base_object

    def regrasped(self, T_base_tcp: Array, T_base_object: Array) -> StationCfg:
        """The station with another grasp of an object that was seen; it is put where the taught motion puts it.

        The object is one of revolution. At its place it is turned about its own axis so that the hand is turned as
        little as possible from the taught pose.

        Args:
            T_base_tcp: (4, 4) the hand at the grasp.
            T_base_object: (4, 4) the middle of the object's height.
        """
        cfg = self.station
        taught = self.goal(cfg.place)
        T_base_placed, T_object_tcp = taught @ self._T_tcp_object, invert_transform(T_base_object) @ T_base_tcp
        # The trace of R_taughtᵀ R_placed Rz(turn) R_object_tcp is largest for this turn.
        M = T_object_tcp[:3, :3] @ taught[:3, :3].T @ T_base_placed[:3, :3]
        turn = np.arctan2(M[0, 1] - M[1, 0], M[0, 0] + M[1, 1])
        place = T_base_placed @ transform_from(rotation_about_z(turn), np.zeros(3)) @ T_object_tcp
        T_tcp_link = invert_transform(self._T_link_tcp)
        x, y, _ = T_base_object[:3, 3]
        moved = cfg.with_poses({cfg.grasp: T_base_tcp @ T_tcp_link, cfg.place: place @ T_tcp_link})
        return moved.with_object_at(x, y)


def pose_of_box(b: BoxCfg) -> Array:
    """``T_base_box`` (4, 4)."""
    return transform_from(rotation_about_z(np.radians(b.yaw_deg)), b.centre_m)


def _rpy(R: Array) -> tuple[float, float, float]:
    """Roll, pitch, yaw of a rotation (3, 3), as URDF has them."""
    pitch = -np.arcsin(np.clip(R[2, 0], -1.0, 1.0))
    return float(np.arctan2(R[2, 1], R[2, 2])), float(pitch), float(np.arctan2(R[1, 0], R[0, 0]))
