"""The world of Task II in physics: what rides stays where it stands, and the judge sees what happens."""

from dataclasses import replace

import numpy as np
import pytest

from tests.envs.patient_method import Patient
from tr_grasp.configs.dynamic import ChargesCfg, DynamicCfg, TrackingCfg
from tr_grasp.dynamic import GraspOutcome, MethodResult, Phase, TrialOver, charged
from tr_grasp.envs.dynamic_grasp import DynamicScene, Judge, make_trial, run_trial
from tr_grasp.envs.dynamic_grasp.scene import TARGET
from tr_grasp.errors import ConfigError, GraspError
from tr_grasp.motion import CollisionModel, Kinematics

pytestmark = pytest.mark.sim

MEAT, MUSTARD = "010_potted_meat_can", "006_mustard_bottle"
SLOW = DynamicCfg(speed_m_s=0.01, charges=ChargesCfg(mode="free"))


def shove(scene, name, velocity):
    from sapien import physx

    body = scene.station.world.entities[name].find_component_by_type(physx.PhysxRigidDynamicComponent)
    body.set_linear_velocity(velocity)


class Idle:
    name = "idle"

    def __init__(self, act=lambda station, task: None):  # what it does before it waits
        self.act = act

    def run(self, station, task):
        self.act(station, task)
        station.world.wait(1000.0)
        return MethodResult(GraspOutcome.GAVE_UP)


@pytest.mark.parametrize("motion", ["linear", "circular", "sinusoidal", "rotating"])
def test_what_rides_the_carrier_stays_where_it_stands(motion):
    scene = DynamicScene.of(DynamicCfg(speed_m_s=0.05), make_trial(motion, MUSTARD, 1))
    scene.station.world.wait(1.5)
    now = np.array([scene.station.world.now_s])
    expected, real = scene.ride(now)[0] @ scene.T_top_target, scene.station.world.true_pose(TARGET)
    assert np.linalg.norm(real[:3, 3] - expected[:3, 3]) < 2e-3
    assert np.allclose(real[:3, :3], expected[:3, :3], atol=0.03)
    task = scene.task(None, lambda phase: None)
    carrier = scene.station.world.true_pose("carrier")
    assert np.linalg.norm((real @ task.T_target_carrier)[:3, 3] - carrier[:3, 3]) < 2e-3


def test_the_arm_at_home_is_free_in_every_case():
    for motion in ("linear_slab", "linear_obstacles"):
        for number in range(2):
            scene = DynamicScene.of(DynamicCfg(), make_trial(motion, MUSTARD, number))
            task = scene.task(None, lambda phase: None)
            model = CollisionModel(Kinematics(task.robot), list(task.obstacles))
            assert model.contact(scene.station.arm.commanded().q) is None


def near_trial(yaw_rad=0.0):
    """A short line in front of the arm."""
    drawn = make_trial("linear", MEAT, 0)
    place = {"distance_m": 0.55, "theta_rad": 0.0, "direction": 1.0, "length_m": 0.3, "yaw_rad": yaw_rad}
    return replace(drawn, parameters={**drawn.parameters, **place})


def test_a_patient_method_lifts_what_is_slow_and_the_row_tells_it():
    record = run_trial(SLOW, near_trial(), Patient())
    assert record.success, record
    assert record.committed
    assert record.time_s == pytest.approx(4.0, abs=0.05)
    assert record.time_s < record.lifted_s < record.end_s - SLOW.judge.hold_s
    assert record.attempts == 1


def test_who_claims_a_lift_that_was_none_is_not_believed():
    class Liar:
        name = "liar"

        def run(self, station, task):
            task.tell(Phase.LIFTING)
            return MethodResult(GraspOutcome.LIFTED)

    record = run_trial(SLOW, make_trial("linear", MEAT, 0), Liar())
    assert not record.success
    assert record.outcome == GraspOutcome.NOT_LIFTED.label


def test_the_end_of_the_path_ends_the_trial():
    hasty = replace(SLOW, speed_m_s=0.5)
    record = run_trial(hasty, make_trial("linear", MEAT, 0), Idle(lambda station, task: station.world.charge(0.25)))
    assert record.thinking_s == 0.25
    assert record.outcome == GraspOutcome.PATH_FINISHED.label
    assert not record.committed
    assert record.time_s == record.end_s == pytest.approx(2.0, abs=0.1)


def test_a_target_that_is_pushed_off_is_knocked_over():
    scene = DynamicScene.of(SLOW, make_trial("linear", MEAT, 0))
    judge = Judge(scene)
    shove(scene, TARGET, [1.5, 1.5, 0.5])
    with pytest.raises(TrialOver) as over:
        scene.station.world.wait(3.0)
    assert judge.verdict(over.value).outcome is GraspOutcome.KNOCKED_OVER


def test_an_obstacle_that_is_pushed_away_ends_the_trial_with_its_name():
    scene = DynamicScene.of(SLOW, make_trial("linear_obstacles", MEAT, 0))
    judge = Judge(scene)
    scene.station.world.wait(0.3)
    shove(scene, scene.obstacle_names[0], [1.0, 1.0, 0.0])
    with pytest.raises(TrialOver) as over:
        scene.station.world.wait(3.0)
    verdict = judge.verdict(over.value)
    assert verdict.outcome is GraspOutcome.OBSTACLE_MOVED
    assert scene.obstacle_names[0] in verdict.detail


def test_a_slab_that_is_touched_ends_the_trial():
    scene = DynamicScene.of(SLOW, make_trial("linear_slab", MEAT, 0))
    judge = Judge(scene)
    shove(scene, TARGET, [0.0, 0.0, 3.0])
    with pytest.raises(TrialOver) as over:
        scene.station.world.wait(2.0)
    assert judge.verdict(over.value).outcome is GraspOutcome.SLAB_TOUCHED
    assert TARGET in over.value.detail


def test_thinking_is_charged_to_the_world():
    scene = DynamicScene.of(replace(SLOW, charges=ChargesCfg(mode="fixed")), make_trial("linear", MEAT, 0))
    world = scene.station.world
    with charged(world, scene.cfg.charges, "planning") as thought:
        pass
    assert thought.seconds == 0.14
    assert world.now_s == pytest.approx(0.14, abs=0.005)


def test_poses_come_at_their_rate_late_and_noisy():
    cfg = replace(SLOW, tracking=TrackingCfg(rate_hz=5.0, latency_s=0.3, noise_m=0.002))
    scene = DynamicScene.of(cfg, make_trial("linear", MEAT, 0))
    world = scene.station.world
    world.wait(0.25)
    assert world.poses(TARGET) == ()
    world.wait(1.0)
    readings = world.poses(TARGET)
    assert np.diff([reading.stamp_s for reading in readings]) == pytest.approx(0.2, abs=0.005)
    assert readings[-1].stamp_s <= world.now_s - 0.3
    heights = [reading.T_base_object[2, 3] for reading in readings]
    assert 1e-4 < np.std(heights) < 1e-2


def test_what_cannot_be_is_refused():
    with pytest.raises(ConfigError, match="home"):
        DynamicScene.of(DynamicCfg(robot="j2s7s300"), make_trial("linear", MEAT, 0))
    with pytest.raises(ConfigError, match="no_such_folder"):
        DynamicScene.of(DynamicCfg(models="no_such_folder"), make_trial("linear", MEAT, 0))
    with pytest.raises(GraspError, match="no grasp set at"):
        run_trial(replace(SLOW, grasps="no_such_folder"), make_trial("linear", MEAT, 0), Idle())


def test_the_gymnasium_world_keeps_its_promises_and_equal_seeds_give_equal_trials():
    import gymnasium
    from gymnasium.utils.env_checker import check_env

    import tr_grasp.envs  # noqa: F401 -- registers it

    env = gymnasium.make("DynamicGrasp-v1", motion="circular", cfg=replace(SLOW, speed_m_s=0.2))
    check_env(env.unwrapped, skip_render_check=True)
    first, _ = env.reset(seed=3)
    still = np.zeros(7, np.float32)
    still[-1] = 1.0
    moved, reward, *_ = env.step(np.array([0.5, 0, 0, 0, 0, 0, 1.0], np.float32))
    assert reward == 0.0
    assert moved["q"][0] > first["q"][0] + 0.01
    over = {}
    while not over:
        *_, terminated, _, over = env.step(still)
    assert terminated
    assert over == {"outcome": GraspOutcome.PATH_FINISHED.label, "success": False}
    again, _ = env.reset(seed=3)
    assert all(np.array_equal(first[name], again[name]) for name in first)
