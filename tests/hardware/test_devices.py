"""Opening stations by name: what is refused, what is missing, and the question before anything real moves."""

import sys

import pytest

from tests.hardware.transports import urcap
from tests.hardware.transports.stepped import SteppedWorld
from tr_grasp.errors import ConfigError, HardwareError
from tr_grasp.hardware import Ending, KinematicFake, Station, devices, finish
from tr_grasp.hardware.devices import confirm, open_station, register_station, rehearsal, robot_of
from tr_grasp.robots import robot_spec

NOBODY = "127.0.0.1"


@pytest.mark.parametrize(
    ("arm", "gripper", "robot"),
    [
        ("ur5", None, "ur5_rg2"),
        ("ur5", "robotiq_2f85", "ur5_robotiq_2f85"),
        ("ur5_robotiq_2f85", None, "ur5_robotiq_2f85"),
        ("j2s7s300", None, "j2s7s300"),
        ("panda", "panda_hand", "panda"),
    ],
)
def test_arm_and_gripper_make_a_robot(arm, gripper, robot):
    assert robot_of(arm, gripper).name == robot


@pytest.mark.parametrize(
    ("names", "settings", "words"),
    [
        (("ur6",), {}, "unknown arm 'ur6'; did you mean 'ur5'"),
        (("ur5", "rg3"), {}, "unknown gripper 'rg3'; did you mean 'rg2'"),
        (("ur5", "kg3"), {}, "has no gripper 'kg3'; valid: rg2, robotiq_2f85"),
        (("ur5_rg2", "robotiq_2f85"), {}, "ur5_rg2 has no robotiq_2f85"),
        (("ur5", "rg2", "kinect"), {}, "unknown camera 'kinect'"),
        (("ur5",), {}, "arm_host must be given"),
        (("ur5",), {"arm_host": NOBODY, "arm_gian": 300}, "unknown setting of the arm 'gian'; did you mean 'gain'"),
        (("ur5",), {"arm_host": NOBODY, "host": NOBODY}, "unknown setting 'host'"),
        (("ur5",), {"arm_host": NOBODY, "arm_gain": "much"}, "arm_gain must be a number, got 'much'"),
        (("ur5",), {"arm_host": NOBODY, "arm_gain": "5000"}, "ur.gain must be from 100 to 2000, got 5000"),
        (("panda",), {"arm_host": NOBODY, "arm_rate_hz": 5}, "panda.rate_hz must be from 50 to 1000"),
        (("j2s7s300",), {"arm_host": NOBODY, "arm_gain_hz": 80.0}, "kinova.gain_hz must be from 0 to 8"),
        (("ur5", "robotiq_2f85"), {"arm_host": NOBODY, "gripper_open_count": 250}, "must ascend within 0 to 255"),
    ],
)
def test_names_and_settings_that_do_not_fit_are_refused_before_anything_is_opened(names, settings, words):
    with pytest.raises(ConfigError, match=words):
        open_station(*names, **settings)


@pytest.mark.parametrize(
    ("names", "module", "extra"),
    [
        (("panda",), "panda_py", "franka"),
        (("j2s7s300",), "roslibpy", "kinova"),
        (("ur5", None, "realsense"), "pyrealsense2", "realsense"),
    ],
)
def test_a_package_that_is_missing_is_named_with_its_extra(monkeypatch, names, module, extra):
    for name in [name for name in sys.modules if name.split(".")[0] == module]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(HardwareError, match=rf"needs the package {module}.*: pip install 'tr-grasp\[{extra}\]'"):
        open_station(*names, arm_host=NOBODY)


def test_a_missing_ur_package_is_named_and_the_gripper_that_was_opened_is_let_go(monkeypatch):
    fake = urcap.Rg2(SteppedWorld())
    monkeypatch.setitem(sys.modules, "rtde_control", None)
    with pytest.raises(
        HardwareError, match=r"the arm 'ur5' needs the package rtde_control: pip install 'tr-grasp\[ur\]'"
    ):
        open_station("ur5", "rg2", arm_host=NOBODY, gripper_port=str(fake.port))
    fake.close()


def test_a_gripper_that_nobody_answers_for_is_named_with_its_address():
    with pytest.raises(HardwareError, match=r"no Robotiq gripper answers at 127\.0\.0\.1:1"):
        open_station("ur5", "robotiq_2f85", arm_host=NOBODY, gripper_port=1)
    with pytest.raises(HardwareError, match=r"no RG2 answers at 127\.0\.0\.1:1; is OnRobot's URCap running"):
        open_station("ur5", "rg2", arm_host=NOBODY, gripper_port=1)


def test_a_registered_station_gets_the_names_and_settings_and_asks_nobody(monkeypatch):
    monkeypatch.setattr(devices, "_STATIONS", {})
    station = KinematicFake.of(robot_spec("panda"))
    asked = []

    def factory(gripper, camera, **settings):
        asked.append((gripper, camera, settings))
        return station

    register_station("sim", factory)
    assert open_station("sim", None, "raycast", robot="panda") is station
    assert asked == [(None, "raycast", {"robot": "panda"})]
    assert confirm("sim", None, rehearse=lambda _: pytest.fail("nothing to rehearse"))


def test_a_real_run_is_rehearsed_without_the_device_and_then_somebody_is_asked():
    seen, questions = [], []

    def rehearse(station: Station) -> str:
        seen.append(finish(station.gripper.move(0.02), station.world).ending)
        return "one grasp, 0.8 s"

    def answer(text):
        return lambda question: (questions.append(question), text)[1]

    assert confirm("ur5", "rg2", rehearse, answer("Yes"))
    assert not confirm("ur5", "rg2", rehearse, answer(""))
    assert not confirm("ur5", "rg2", rehearse, answer("maybe"))
    assert seen == [Ending.DONE] * 3
    assert "one grasp, 0.8 s" in questions[0]
    assert "ur5_rg2 will move" in questions[0]


def test_nobody_there_is_a_no_and_a_rehearsal_that_fails_asks_nothing():
    def nobody(_):
        raise EOFError

    assert not confirm("panda", None, lambda _: "fine", nobody)
    with pytest.raises(HardwareError, match="wall"):
        confirm("panda", None, lambda _: (_ for _ in ()).throw(HardwareError("wall")), lambda _: "yes")


def test_a_rehearsal_is_of_the_same_robot():
    assert rehearsal("j2s7s300").arm.name == "j2s7s300"
