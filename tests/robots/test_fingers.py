import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tr_grasp.robots import CoupledFingers, robot_names, robot_spec
from tr_grasp.robots.cartesian import FingerDrive

NAMES = robot_names()
DT_S = 0.01


def drive(name):
    return CoupledFingers.of(robot_spec(name).gripper)


@pytest.mark.parametrize("name", NAMES)
@given(part=st.floats(0, 1))
def test_an_opening_and_its_joint_positions_undo_each_other(name, part):
    gripper = robot_spec(name).gripper
    opening = part * gripper.opening_range_m[1]
    assert gripper.opening_m(gripper.joint_positions(opening)) == pytest.approx(opening, abs=1e-9)


@pytest.mark.parametrize("name", NAMES)
def test_an_opening_outside_the_range_is_the_nearest_one_inside(name):
    gripper = robot_spec(name).gripper
    np.testing.assert_allclose(gripper.joint_positions(1.0), gripper.open)
    np.testing.assert_allclose(gripper.joint_positions(-1.0), gripper.closed)


@pytest.mark.parametrize("name", NAMES)
def test_free_fingers_close_with_the_speed_of_the_gripper(name):
    """The setpoint's way over the whole opening, with fingers that follow at once."""
    fingers = drive(name)
    setpoint, positions, times = fingers.open_setpoint, fingers.open_positions, 0
    while fingers.opening_m(positions) > 0.2 * fingers.gripper.opening_range_m[1]:
        setpoint, targets = fingers.targets(setpoint, True, positions, DT_S)
        positions, times = targets, times + 1
    expected_s = 0.8 * fingers.gripper.opening_range_m[1] / fingers.speed_mps
    assert times * DT_S == pytest.approx(expected_s, rel=0.1)


@pytest.mark.parametrize("name", NAMES)
def test_fingers_that_are_held_press_with_the_force_of_the_gripper(name):
    """Torque of the driven joint times its turn is force times the way of the pad."""
    fingers, gripper = drive(name), robot_spec(name).gripper
    opening = 0.5 * gripper.opening_range_m[1]
    held, setpoint = gripper.joint_positions(opening), 1.0
    for _ in range(400):
        setpoint, targets = fingers.targets(setpoint, True, held, DT_S)
    effort = np.abs([gain.stiffness * (t - q) for gain, t, q in zip(fingers.gains, targets, held, strict=True)])
    moved = np.abs(gripper.joint_positions(opening + 5e-4) - gripper.joint_positions(opening - 5e-4))
    index = 0
    for finger in gripper.fingers:
        force = effort[index] * moved[index] / 5e-4
        # The three fingers of the KG-3 do not move their pads by quite the same.
        assert force == pytest.approx(finger.share * fingers.force_n, rel=0.15 if name == "j2s7s300" else 0.03)
        index += len(finger.joints)


def test_a_finger_ahead_of_the_other_is_driven_back_and_its_fingertip_stays_parallel():
    fingers = drive("ur5_rg2")
    positions = np.array([0.7, 0.7, 0.5, 0.5])
    _, targets = fingers.targets(0.5, True, positions, DT_S)
    assert targets[0] - positions[0] < targets[2] - positions[2]
    np.testing.assert_allclose(targets[[1, 3]], positions[[0, 2]])


def test_closing_on_nothing_ends_when_the_pads_meet():
    fingers = drive("ur5_rg2")
    setpoint = 1.0
    for _ in range(500):
        setpoint, _ = fingers.targets(setpoint, True, fingers.gripper.closed, DT_S)
    assert -0.5 < setpoint < 0.0


def test_the_pandas_data_say_the_same_as_its_drive():
    gripper, fingers = robot_spec("panda").gripper, FingerDrive()
    np.testing.assert_allclose(gripper.open, fingers.open_positions)
    assert gripper.opening_m(np.array([0.01, 0.02])) == pytest.approx(fingers.opening_m(np.array([0.01, 0.02])))
    assert gripper.speed_mps == 2 * fingers.speed_mps
    assert (gripper.force_n, gripper.stiffness) == (fingers.force_n, fingers.stiffness)
    same, ours = fingers.targets(0.02, True, np.array([0.025, 0.019]), DT_S)
    openness, theirs = drive("panda").targets(0.5, True, np.array([0.025, 0.019]), DT_S)
    assert openness * 0.04 == pytest.approx(same)
    np.testing.assert_allclose(theirs, ours)


def test_linkages_retract_their_tips_as_they_open_and_sliding_fingers_do_not():
    rg2, panda = drive("ur5_rg2"), drive("panda")
    assert rg2.reach_m(rg2.gripper.closed) == pytest.approx(0.0)
    assert rg2.reach_m(rg2.gripper.open) == pytest.approx(0.0620 * (np.cos(1.2141585) - np.cos(0.05)), abs=1e-4)
    assert panda.reach_m(panda.gripper.open) == FingerDrive().reach_m(np.full(2, 0.04)) == 0.0


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("part", [-0.2, 1.2])
def test_fingers_pushed_beyond_their_stops_get_targets_that_are_numbers(name, part):
    gripper = robot_spec(name).gripper
    beyond = gripper.closed + part * (gripper.open - gripper.closed)
    for closing in (True, False):
        setpoint, targets = drive(name).targets(0.5, closing, beyond, DT_S)
        assert np.isfinite([setpoint, *targets]).all()
