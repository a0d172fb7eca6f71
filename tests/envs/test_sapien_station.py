"""What the simulated station does beyond the contract of backends: physics."""

import numpy as np
import pytest

from tr_grasp.envs.sapien_station import SapienStation
from tr_grasp.envs.sapien_world import SapienWorld
from tr_grasp.envs.things import Thing
from tr_grasp.errors import MotionError
from tr_grasp.hardware import Ending, finish
from tr_grasp.motion import CollisionModel, Kinematics, time_optimal
from tr_grasp.robots import robot_spec
from tr_grasp.sensing import PinholeCamera

pytestmark = pytest.mark.sim


def at(x, y, z):
    T = np.eye(4)
    T[:3, 3] = x, y, z
    return T


def rails(times):
    T = np.tile(at(0.5, 0.4, 0.1), (len(times), 1, 1))
    T[:, 0, 3] += 0.05 * times
    return T


@pytest.fixture(scope="module")
def scene():
    """A UR5 at home, a post in front of it, a slab that moves, a box that lies on it, and one between the fingers."""
    spec = robot_spec("ur5_robotiq_2f85")
    tool = Kinematics(spec).pose(np.array(spec.home_q_rad))[:3, 3]
    things = [
        Thing("post", at(0.30, 0.40, 0.4), size_m=(0.08, 0.08, 0.8)),
        Thing("slab", at(0.5, 0.4, 0.1), size_m=(0.2, 0.2, 0.02), motion=rails),
        Thing("box", at(0.5, 0.4, 0.1351), size_m=(0.05, 0.05, 0.05), mass_kg=0.2),
        Thing("stand", at(tool[0], tool[1], tool[2] - 0.07), size_m=(0.06, 0.06, 0.06)),
        Thing("cube", at(tool[0], tool[1], tool[2] - 0.02), size_m=(0.04, 0.04, 0.04), mass_kg=0.1),
    ]
    camera = PinholeCamera.looking_at((1.3, 0.2, 0.5), (0.5, 0.2, 0.2), 0.8, 48)
    return SapienStation.of("ur5_robotiq_2f85", things=things, camera=camera)


def test_what_lies_on_a_moving_slab_is_carried_and_both_are_tracked(scene):
    scene.world.wait(0.2)
    before = scene.world.true_pose("box")[0, 3]
    begun = scene.world.now_s
    scene.world.wait(1.0)
    way = 0.05 * (scene.world.now_s - begun)
    assert scene.world.true_pose("box")[0, 3] - before == pytest.approx(way, abs=0.004)
    reading = scene.world.poses("slab")[-1]
    assert reading.T_base_object[0, 3] == pytest.approx(0.5 + 0.05 * reading.stamp_s, abs=1e-4)


def test_fingers_hold_an_object_and_lift_it(scene):
    arm, world = scene.arm, scene.world
    result = finish(scene.gripper.move(0.0, force_n=30.0), world)
    assert result.ending is Ending.HOLDING
    assert scene.gripper.state().opening_m == pytest.approx(0.04, abs=0.002)
    q = arm.commanded().q
    up = q + np.array([0.0, -0.2, 0, 0.2, 0, 0])
    height = world.true_pose("cube")[2, 3]
    assert finish(arm.move(time_optimal(np.stack([q, up]), arm.limits).trajectory.slower(2.0)), world).succeeded
    rise = world.true_pose("cube")[2, 3] - height
    assert rise > 0.05
    assert scene.gripper.state().holding


def test_even_soft_drives_are_where_they_should_be_at_the_end_of_a_fast_motion():
    """Without the torques of turning links the Panda, of 1000 N m/rad, would be 2.6 mm behind here."""
    station, spec = SapienStation.of("panda"), robot_spec("panda")
    start = np.array(spec.home_q_rad)
    goal = start + np.array([1.2, 0.5, -1.0, 0.6, 0.8, 0.7, -0.9])
    motion = time_optimal(np.stack([start, goal]), station.arm.limits).trajectory
    assert finish(station.arm.move(motion), station.world).succeeded
    kinematics = Kinematics(spec)
    away = kinematics.pose(station.arm.state().q_rad)[:3, 3] - kinematics.pose(goal)[:3, 3]
    assert np.linalg.norm(away) < 5e-4


def test_a_contact_is_reported_with_its_names_when_the_planner_expects_it(scene):
    """The planner's model and the simulator agree on where the post is."""
    arm, world = scene.arm, scene.world
    spec = robot_spec("ur5_robotiq_2f85")
    kinematics, robot_links = Kinematics(spec), {link.name for link in spec.links}
    model = CollisionModel(kinematics, world.things["post"].obstacles())
    q = arm.commanded().q
    into = time_optimal(np.stack([q, q + 1.3 * np.eye(6)[0]]), arm.limits).trajectory.slower(2.0)
    when, contact = model.first_contact(into, period_s=0.005)
    world.forget_touches()
    begun, command = world.now_s, arm.move(into)

    def on_post():
        return [touch for touch in world.touches if touch.thing == "post"]  # the fingers still hold the cube

    while not on_post() and not command.done:
        world.wait(0.005)
    arm.stop()
    (touch, *_) = on_post()
    assert contact.second == "post"
    # Several links may reach it within a sample; the planner names any of them.
    assert touch.link in robot_links
    assert touch.since_s - begun == pytest.approx(when, abs=0.1)
    world.forget_touches()
    assert world.touches == ()


def test_the_camera_sees_the_robot_and_the_things(scene):
    image = scene.camera.capture()
    assert np.isfinite(image.depth_m).mean() > 0.05
    assert np.isnan(image.depth_m).any()
    assert len(np.unique(image.rgb.reshape(-1, 3), axis=0)) > 3


def test_things_that_make_no_sense_are_refused():
    with pytest.raises(MotionError, match="either size_m"):
        Thing("x", at(0, 0, 0))
    with pytest.raises(MotionError, match="motion or a mass_kg"):
        Thing("x", at(0, 0, 0), size_m=(1, 1, 1), motion=rails, mass_kg=1.0)
    with pytest.raises(MotionError, match="two called 'x'"):
        SapienWorld([Thing("x", at(0, 0, 0), size_m=(1, 1, 1))] * 2)
    with pytest.raises(MotionError, match="unknown object 'y'"):
        SapienWorld([Thing("x", at(0, 0, 0), size_m=(1, 1, 1))]).true_pose("y")
