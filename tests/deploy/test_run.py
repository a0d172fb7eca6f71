"""A policy through the protocols: its motion on the fake, its log, and its parity with the environment."""

from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest
import torch
from tensordict.nn import TensorDictModule

from tr_grasp import keys
from tr_grasp.configs import EnvCfg
from tr_grasp.deploy import CalibratedCamera, CartesianSteps, Observer, PolicyRun, RunEnding, RunLog
from tr_grasp.deploy.pictures import log_frames
from tr_grasp.deploy.runner import act, disagreement
from tr_grasp.errors import ConfigError, DemonstrationError, HardwareError
from tr_grasp.hardware import Fault, Guard, GuardCfg, KinematicFake, intrinsics_of
from tr_grasp.motion import Kinematics
from tr_grasp.robots import robot_spec
from tr_grasp.sensing import PinholeCamera

SPEC = robot_spec("ur5_rg2")
CFG = replace(EnvCfg(), robot="ur5_rg2")
EYE = PinholeCamera.looking_at((0.9, -0.3, 0.7), (0.5, 0.0, 0.05), 0.5, 48)


def station(**faults):
    return KinematicFake.of(SPEC, camera=EYE, **faults)


def always(action):
    told = torch.tensor(action, dtype=torch.float32)
    return TensorDictModule(lambda proprio: told.clone(), in_keys=[keys.PROPRIO], out_keys=[keys.ACTION])


def a_run(policy, devices, **more):
    return PolicyRun(policy, CFG, SPEC, devices, EYE.T_base_cam, **more)


def test_a_policy_of_pictures_is_refused():
    policy = always([0.0] * 5)
    policy.in_keys = [keys.COLOUR_IMAGE, keys.DEPTH_IMAGE, keys.PROPRIO]
    with pytest.raises(ConfigError, match=r"reads pictures \(image_cnn\) acts in simulation alone"):
        a_run(policy, station())


@pytest.mark.parametrize("execution", ["stepped", "smooth"])
def test_a_step_moves_the_tool_by_what_the_action_says(execution):
    devices = station()
    steps = CartesianSteps(CFG, SPEC, devices, execution)
    before, begun = steps.tool_pose(), devices.world.now_s
    assert steps.step(np.array([-0.4, 0.3, -0.5, 0.5, 1.0])) == ""
    devices.world.wait(0.05)
    after = steps.tool_pose()
    assert after[:3, 3] - before[:3, 3] == pytest.approx([-0.02, 0.015, -0.025], abs=1e-3)
    turn = after[:3, :3] @ before[:3, :3].T
    assert np.arctan2(turn[1, 0], turn[0, 0]) == pytest.approx(0.2, abs=5e-3)
    assert devices.world.now_s - begun >= 1 / CFG.control_hz


def test_a_planned_step_ends_in_the_same_place():
    devices = station()
    steps = CartesianSteps(CFG, SPEC, devices, "planned")
    before = steps.tool_pose()
    assert steps.step(np.array([-0.4, 0.3, -0.5, 0.0, 1.0])) == ""
    assert steps.tool_pose()[:3, 3] - before[:3, 3] == pytest.approx([-0.02, 0.015, -0.025], abs=1e-3)


def test_a_smooth_step_never_exceeds_the_limits_of_acceleration():
    devices = station()
    steps, speeds = CartesianSteps(CFG, SPEC, devices, "smooth"), []
    devices.world.on_tick(lambda _: speeds.append(devices.arm.commanded().dq))
    for sign in (1, -1, 1):
        assert steps.step(sign * np.array([-0.5, 0.5, -0.5, 0.5, 1.0])) == ""
    change = np.abs(np.diff(speeds, axis=0)) / devices.world.tick_s
    # A set-point changes every second tick of the fake's clock.
    assert (change <= 2.05 * devices.arm.limits.acceleration_rad_s2).all()


def test_the_tool_stays_in_the_workspace_whatever_the_policy_wants():
    devices = station()
    steps = CartesianSteps(CFG, SPEC, devices)
    for _ in range(8):
        assert steps.step(np.array([1.0, 1.0, 1.0, 0.0, 1.0])) == ""
    devices.world.wait(0.05)
    w = CFG.workspace
    top = [w.centre_m[0] + w.side_m / 2, w.centre_m[1] + w.side_m / 2, w.tcp_height_m[1]]
    assert steps.tool_pose()[:3, 3] == pytest.approx(top, abs=2e-3)


def test_fingers_close_and_the_arm_holds_on_behind_a_guard():
    devices = station(blocked_at_m=0.05)
    guard = Guard(devices, Kinematics(SPEC), GuardCfg(jump_rad=0.2))
    steps = CartesianSteps(CFG, SPEC, guard.station)
    assert steps.step(np.array([0, 0, 0, 0, -1.0])) == ""
    assert guard.reason == ""
    assert devices.gripper.state().holding
    assert steps.proprioception()[0] == pytest.approx(2 * 0.05 / SPEC.gripper.opening_range_m[1] - 1, abs=1e-3)


def test_what_is_held_and_rises_is_lifted():
    def policy(observation):
        height = float(observation[keys.PROPRIO][-1, 3])
        closed = float(observation[keys.PROPRIO][-1, 0]) < 0.9
        grip = -1.0 if closed or height < 0.1 else 1.0
        rise = 1.0 if closed else -1.0
        observation[keys.ACTION] = torch.tensor([0.0, 0.0, rise if height > 0.1 or closed else 0.0, 0.0, grip])
        return observation

    run = a_run(policy, station(blocked_at_m=0.05))
    result = run.run(30)
    assert result.ending is RunEnding.LIFTED
    assert len(run.log.steps) == result.steps_n


def test_fingers_that_hold_nothing_lift_nothing():
    result = a_run(always([0, 0, 0.2, 0, -1.0]), station()).run(3)
    assert result.ending is RunEnding.TIME_UP
    assert "3 steps" in result.reason


def test_a_device_that_fails_ends_the_run_with_its_reason():
    pressed = a_run(always([0, 0, -0.5, 0, 1.0]), station(faults=(Fault("emergency_stop", 0.4),))).run(10)
    assert pressed.ending is RunEnding.FAILED
    assert "emergency stop" in pressed.reason
    gone = a_run(always([0, 0, -0.5, 0, 1.0]), station(faults=(Fault("disconnected", 0.4),))).run(10)
    assert gone.ending is RunEnding.FAILED
    assert gone.detail


def test_a_camera_that_sees_nothing_of_the_workspace_is_said():
    away = EYE.T_base_cam.copy()
    away[:3, 3] += 3.0
    with pytest.raises(HardwareError, match="sees nothing in the workspace"):
        Observer(CFG, away).frame(station().camera.capture())


def test_a_calibrated_camera_with_the_intrinsics_of_a_pinhole_is_that_pinhole():
    same = CalibratedCamera.of(intrinsics_of(EYE), EYE.T_base_cam)
    assert same.rays_base == pytest.approx(EYE.rays_base, abs=1e-6)
    shifted = replace(intrinsics_of(EYE), cx=intrinsics_of(EYE).cx + 2.0)
    moved = CalibratedCamera.of(shifted, EYE.T_base_cam).directions_cam
    assert moved[5, 7] == pytest.approx(EYE.directions_cam[5, 5], abs=1e-6)


def test_a_log_comes_back_as_it_was_and_its_policy_agrees(tmp_path):
    policy = always([0.1, 0, -0.3, 0, 1.0])
    run = a_run(policy, station(), meta={"policy": "mine"})
    run.run(3)
    back = RunLog.load(run.log.save(tmp_path / "run.npz"))
    assert back.meta["policy"] == "mine"
    assert back.meta["ending"] == "TIME_UP"
    assert len(back.steps) == 3
    for one, other in zip(run.log.steps, back.steps, strict=True):
        for name in vars(one):
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    assert disagreement(policy, back) == 0.0
    assert disagreement(always([0.1, 0, 0.2, 0, 1.0]), back) == pytest.approx(0.5)
    frames = log_frames(back)
    assert len(frames) == 3
    assert all(frame.shape == frames[0].shape for frame in frames)


def test_an_empty_log_a_damaged_one_and_a_foreign_one(tmp_path):
    assert RunLog.load(RunLog({"policy": "mine"}).save(tmp_path / "empty.npz")).steps == []
    (tmp_path / "text.npz").write_text("no archive")
    np.savez(tmp_path / "foreign.npz", meta=np.array("{}"))
    for name in ("text", "foreign", "missing"):
        with pytest.raises(DemonstrationError, match=name):
            RunLog.load(tmp_path / f"{name}.npz")


@pytest.mark.sim
def test_the_shipped_policy_acts_the_same_through_the_protocols_as_in_the_environment():
    """Same octree, same first action; then the tools stay within 2 mm until the fingers close at another speed."""
    from tr_grasp.envs import make_env
    from tr_grasp.envs.policy_world import station_of
    from tr_grasp.modules import load_policy

    policy, training = load_policy("panda")
    noiseless = replace(training.env.randomise, depth_noise="none")
    cfg = replace(training.env, randomise=noiseless, objects=replace(training.env.objects, count_range=(2, 2)))
    with closing(make_env(cfg, seed=1)) as env:
        td = env.reset()
        run = PolicyRun(policy, cfg, robot_spec("panda"), station_of(env), env.task.view.camera.T_base_cam)
        for k in range(4):
            expected, step = act(policy, td.select(keys.OCTREE, keys.PROPRIO, keys.STAGES)), run.decide()
            assert step.action == pytest.approx(expected, abs=1e-3 if k == 0 else 0.1)
            assert step.proprio[-1][1:4] == pytest.approx(td[keys.PROPRIO][-1, 1:4].numpy(), abs=2e-3)
            if k == 0:
                np.testing.assert_array_equal(step.codes[-1], td[keys.OCTREE].codes[-1].numpy())
            td[keys.ACTION] = torch.from_numpy(expected)
            td = env.step(td)["next"]
            assert run._steps.step(expected) == ""
