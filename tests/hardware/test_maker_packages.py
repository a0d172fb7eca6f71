"""Against the makers' packages, where they are installed: fakes and adapters call things by their real names."""

import inspect
import re
from importlib import import_module

import pytest

from tests.hardware.transports import panda as fake_panda
from tests.hardware.transports import rtde as fake_rtde
from tr_grasp.errors import HardwareError
from tr_grasp.hardware.devices import open_station

NOBODY = "127.0.0.1"


def public(kind):
    """Methods that a fake has and its own helpers are not."""
    own = {"measure", "step", "submit", "wait_until_still"}
    return {name: f for name, f in vars(kind).items() if inspect.isfunction(f) and name[0] != "_" and name not in own}


def arguments(signature):
    """Names in a pybind11 docstring, without self; ``argN`` where it has none."""
    inside = re.search(r"\((.*)\)\s*->", signature, re.DOTALL)
    assert inside is not None, signature
    return [name for name in re.findall(r"(?:^|,\s*)(\w+)\s*:", inside.group(1)) if name != "self"]


def assert_same(fake, real):
    for name, function in public(fake).items():
        doc = getattr(real, name).__doc__
        theirs = arguments(doc.splitlines()[0])
        ours = [p for p in inspect.signature(function).parameters if p != "self"]
        assert len(ours) == len(theirs), f"{real.__name__}.{name}: {theirs}"
        for mine, other in zip(ours, theirs, strict=True):
            assert other.startswith("arg") or mine == other, f"{real.__name__}.{name}: {theirs}"


@pytest.mark.parametrize(
    ("fake", "module", "name"),
    [
        (fake_rtde.RTDEControlInterface, "rtde_control", "RTDEControlInterface"),
        (fake_rtde.RTDEReceiveInterface, "rtde_receive", "RTDEReceiveInterface"),
        (fake_panda.Panda, "panda_py", "Panda"),
        (fake_panda.JointPosition, "panda_py.controllers", "JointPosition"),
        (fake_panda.Gripper, "panda_py.libfranka", "Gripper"),
    ],
)
def test_a_fake_has_the_names_and_arguments_of_the_real_class(fake, module, name):
    pytest.importorskip(module.split(".")[0])
    assert_same(fake, getattr(import_module(module), name))


def test_states_of_a_panda_have_the_fields_that_we_read():
    libfranka = pytest.importorskip("panda_py").libfranka
    for field in ("q", "dq", "tau_ext_hat_filtered", "time", "robot_mode"):
        assert hasattr(libfranka.RobotState, field)
    assert hasattr(libfranka.Duration, "to_sec")
    assert {mode.name for mode in fake_panda.RobotMode} == set(libfranka.RobotMode.__members__)
    assert hasattr(libfranka.GripperState, "width")
    assert hasattr(libfranka.GripperState, "is_grasped")


def test_a_realsense_has_what_we_call():
    rs = pytest.importorskip("pyrealsense2")
    for owner, names in {
        rs.pipeline: ("start", "stop", "wait_for_frames", "poll_for_frames"),
        rs.config: ("enable_stream", "enable_device"),
        rs.align: ("process",),
        rs.composite_frame: ("get_color_frame", "get_depth_frame"),
        rs.depth_frame: ("get_timestamp", "get_data", "profile"),
        rs.depth_sensor: ("get_depth_scale",),
        rs.stream_profile: ("as_video_stream_profile",),
        rs.video_stream_profile: ("get_intrinsics",),
        rs.intrinsics: ("width", "height", "fx", "fy", "ppx", "ppy"),
    }.items():
        for name in names:
            assert hasattr(owner, name), f"{owner.__name__}.{name}"
    assert hasattr(rs.stream, "color")
    assert hasattr(rs.format, "rgb8")


def test_the_real_ur_package_without_an_arm_is_one_sentence():
    pytest.importorskip("rtde_receive")
    from tr_grasp.hardware.adapters.ur import UrCfg, open_arm
    from tr_grasp.hardware.real_world import RealWorld
    from tr_grasp.robots import robot_spec

    with pytest.raises(HardwareError, match=r"no UR controller answers at 127\.0\.0\.1"):
        open_arm(robot_spec("ur5_rg2"), UrCfg(NOBODY), RealWorld())


def test_the_real_panda_package_without_a_hand_is_one_sentence():
    pytest.importorskip("panda_py")
    with pytest.raises(HardwareError, match=r"no Franka Hand answers at 127\.0\.0\.1"):
        open_station("panda", arm_host=NOBODY)


def test_the_real_realsense_package_without_a_camera_is_one_sentence():
    pytest.importorskip("pyrealsense2")
    with pytest.raises(HardwareError, match=r"no RealSense camera gives pictures: No device connected\."):
        open_station("ur5", "rg2", "realsense", arm_host=NOBODY)
