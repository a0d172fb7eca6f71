"""What a camera sees becomes grasps: the taught one moved along, from above, or out of a set."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.pick_place.eye import Eye
from tr_grasp.errors import ConfigError, GraspError
from tr_grasp.geometry import invert_transform
from tr_grasp.grasps import Grasps, GraspSet, shape_key
from tr_grasp.hardware import KinematicFake
from tr_grasp.objects.bottle import bottle
from tr_grasp.pick_place import BlindPickPlace, Perception, PlanningScene, PoseCfg, TaskOutcome, read_station
from tr_grasp.pick_place.perceive import all_around, from_above, object_points, object_pose
from tr_grasp.robots import robot_spec
from tr_grasp.sensing import PinholeCamera

SHIFT_M = np.array([0.03, -0.02])


@pytest.fixture(scope="module")
def cfg():
    return read_station("bench")


@pytest.fixture(scope="module")
def camera(cfg):
    x, y, _ = cfg.object.foot_m
    return PinholeCamera.looking_at((x + 0.45, y - 0.25, 1.0), (x, y, 0.12), 0.45, 200)


def devices(eye):
    station = KinematicFake.of(robot_spec("j2s7s300"))
    station.gripper.blocked_at_m = 0.03
    return replace(station, camera=eye)


def place_of(cfg):
    x, y, _ = cfg.object.foot_m
    return float(x + SHIFT_M[0]), float(y + SHIFT_M[1])


def perception(cfg, camera, choice, **more):
    eye = Eye(*place_of(cfg), camera=camera)
    return Perception(cfg, devices(eye), camera.T_base_cam, choice, **more)


def side_grasps(radius_m=0.03, gripper="kg3"):
    """Four grasps of a bottle from the side, a quarter turn apart, level with its middle: z inwards, y around."""
    model = bottle(radius_m, 0.24)
    turns = np.arange(4) * np.pi / 2
    inwards = np.stack([-np.cos(turns), -np.sin(turns), np.zeros(4)], axis=1)
    half = np.sqrt(0.5)
    # From pointing along +z to pointing along -x; then turned about z.
    first = np.array([half, 0.0, -half, 0.0])
    turned = np.stack([np.cos(turns / 2), np.zeros(4), np.zeros(4), np.sin(turns / 2)], axis=1)
    q = np.stack([product(t, first) for t in turned])
    set_ = Grasps(-0.01 * inwards, q, np.full(4, 2 * radius_m))
    key = shape_key(model, "kg3")
    return GraspSet("bottle", gripper, set_, np.full(4, 10), np.full(4, 10), key, bounds_m=model.bounds_m)


def product(a, b):
    w, x, y, z = a
    W, X, Y, Z = b
    return np.array(
        [
            w * W - x * X - y * Y - z * Z,
            w * X + x * W + y * Z - z * Y,
            w * Y - x * Z + y * W + z * X,
            w * Z + x * Y - y * X + z * W,
        ]
    )


def test_a_hand_from_above_points_down_and_closes_along_its_yaw():
    """At yaw 0 the hand closes along x, at a quarter turn along y."""
    for yaw, closing in ((0.0, [1, 0, 0]), (np.pi / 2, [0, 1, 0])):
        T = from_above(np.array([0.4, 0.1, 0.2]), yaw)
        assert T[:3, 2] == pytest.approx([0, 0, -1])
        assert T[:3, 1] == pytest.approx(closing, abs=1e-12)
        assert T[:3, 3] == pytest.approx([0.4, 0.1, 0.2])
        assert np.linalg.det(T[:3, :3]) == pytest.approx(1.0)


def test_the_shape_is_laid_over_one_side_of_an_object_that_even_leans(cfg, camera):
    """From the side that is seen alone: 2 mm, and the lean to half a degree."""
    lean = np.radians(4.0)
    eye = Eye(*place_of(cfg), camera=camera, lean_rad=lean)
    found = object_pose(eye.capture(), camera.T_base_cam, cfg)
    assert found[:3, 3] == pytest.approx(eye.pose[:3, 3], abs=2e-3)
    assert np.degrees(np.arccos(found[:3, 2] @ eye.pose[:3, 2])) < 0.5


def test_the_taught_grasp_moves_along(cfg, camera):
    moved = perception(cfg, camera, "taught")()[0]
    shift = moved.T_base_link("grasp")[:3, 3] - cfg.T_base_link("grasp")[:3, 3]
    assert shift == pytest.approx([*SHIFT_M, 0.0], abs=1.5e-3)
    assert moved.T_base_link("place") == pytest.approx(cfg.T_base_link("place"))


def test_the_taught_grasp_is_turned_about_the_object_where_the_poses_around_it_follow(cfg, camera):
    def hand_from_object(station):
        return PlanningScene(station).goal("grasp")[:3, 3] - station.object.T_base_object[:3, 3]

    moved, *turned = perception(cfg, camera, "taught")()
    first = hand_from_object(moved)
    for station, turn in zip(turned, np.radians([15, -15, 30, -30, 45, -45]), strict=True):
        x, y, z = hand_from_object(station)
        c, s = np.cos(turn), np.sin(turn)
        assert [x, y, z] == pytest.approx([c * first[0] - s * first[1], s * first[0] + c * first[1], first[2]])
    own = replace(cfg, poses={**cfg.poses, "pre_grasp": PoseCfg.of(cfg.T_base_link("pre_grasp"))})
    assert len(perception(own, camera, "taught")()) == 1


@pytest.mark.parametrize("choice", ["taught", "top_down", "grasp_set"])
def test_the_object_is_carried_to_the_taught_place_whatever_the_grasp(cfg, camera, choice):
    taught = PlanningScene(cfg)
    goal = taught.goal("place") @ invert_transform(taught.goal("grasp")) @ cfg.object.T_base_object
    more = {"grasps": side_grasps()} if choice == "grasp_set" else {}
    found = perception(cfg, camera, choice, **more)()
    assert found
    assert not isinstance(found, str), found
    for station in found[:4]:
        scene = PlanningScene(station)
        carried = scene.goal("place") @ invert_transform(scene.goal("grasp")) @ station.object.T_base_object
        assert carried[:3, 3] == pytest.approx(goal[:3, 3], abs=1e-9)
        assert carried[:3, 2] == pytest.approx(goal[:3, 2], abs=1e-9)  # it may be turned about its own axis
        assert station.object.foot_m[:2] == pytest.approx(place_of(cfg), abs=4e-3)


def test_grasps_from_above_meet_the_neck_that_is_seen(cfg, camera):
    station = perception(cfg, camera, "top_down")()[0]
    T = PlanningScene(station).goal("grasp")
    assert T[:3, 2] == pytest.approx([0, 0, -1], abs=1e-6)
    assert T[:2, 3] == pytest.approx(place_of(cfg), abs=6e-3)
    assert 0.19 < T[2, 3] < 0.24  # the neck, of a bottle of 0.24 m


def test_the_hand_at_the_place_is_turned_no_further_than_it_must(cfg):
    """The taught grasp of an object where it was taught gives back the taught place."""
    scene = PlanningScene(cfg)
    same = PlanningScene(scene.regrasped(scene.goal("grasp"), cfg.object.T_base_object))
    assert same.goal("place") == pytest.approx(scene.goal("place"), abs=1e-6)


def test_the_whole_task_is_carried_out_with_a_grasp_from_above(cfg, camera):
    home = replace(cfg, home_q_rad=robot_spec("j2s7s300").home_q_rad)
    station = devices(Eye(*place_of(cfg), camera=camera))
    result = BlindPickPlace(home, station, locate=Perception(home, station, camera.T_base_cam, "top_down")).run(0)
    assert result.outcome is TaskOutcome.DONE, result.reason


def test_what_cannot_be_seen_or_is_something_else_is_said(cfg, camera):
    def look(x, y, choice, **more):
        eye = Eye(x, y, camera=camera, **more)
        grasps = side_grasps() if choice == "grasp_set" else None
        return Perception(cfg, devices(eye), camera.T_base_cam, choice, grasps)()

    for choice in ("taught", "top_down", "grasp_set"):
        assert "points stand where to look" in look(0.5, 0.5, choice)
    x, y = place_of(cfg)
    assert "no cylinder" in look(x, y, "grasp_set", radius=0.09)


def test_points_of_another_thing_beside_the_object_are_left_out(cfg, camera):
    image = Eye(*place_of(cfg), camera=camera).capture()
    points = object_points(image, camera.T_base_cam, cfg)
    assert np.abs(points[:, :2] - place_of(cfg)).max() < 0.032
    speck = replace(image, depth_m=image.depth_m.copy())
    speck.depth_m[3:5, 3:5] -= 0.2  # a few pixels of something that floats in the region
    assert len(object_points(speck, camera.T_base_cam, cfg)) == len(points)


def test_what_cannot_work_is_refused_before_looking(cfg, camera):
    eye = Eye(*place_of(cfg), camera=camera)
    T = camera.T_base_cam
    with pytest.raises(ConfigError, match="needs a camera"):
        Perception(cfg, devices(None), T)
    with pytest.raises(ConfigError, match="search_m"):
        Perception(replace(cfg, search_m=None), devices(eye), T)
    own = {**cfg.poses, "pre_grasp": PoseCfg.of(cfg.T_base_link("pre_grasp"))}
    with pytest.raises(ConfigError, match="needs a pose 'pre_grasp' that is like 'grasp'"):
        Perception(replace(cfg, poses=own), devices(eye), T, "top_down")
    thin = replace(cfg, object=replace(cfg.object, radius_m=0.02))
    with pytest.raises(GraspError, match="another shape, size or gripper"):
        Perception(thin, devices(eye), T, "grasp_set", side_grasps())
    with pytest.raises(GraspError, match="for gripper 'rg2', not 'kg3'"):
        Perception(cfg, devices(eye), T, "grasp_set", side_grasps(gripper="rg2"))


def test_a_grasp_of_a_body_of_revolution_counts_in_all_turns_about_its_axis():
    known = side_grasps().subset(np.arange(1))
    turned = all_around(known)
    assert len(turned) == len(turned.tries) == 8
    inwards = turned.grasps.approach()
    angles = np.sort(np.arctan2(inwards[:, 1], inwards[:, 0]) % (2 * np.pi))
    assert np.diff(angles) == pytest.approx(np.pi / 4)
    for k in range(8):  # each stands off the axis as far as the one that it came from
        assert turned.grasps.position_m[k] == pytest.approx(-0.01 * inwards[k], abs=1e-9)
