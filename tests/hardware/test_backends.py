"""The contract, for every backend that runs without a device."""

from functools import cache

import pytest

from tests.hardware.contract import BackendContract
from tr_grasp.hardware import Guard, GuardCfg, KinematicFake, finish
from tr_grasp.motion import Kinematics
from tr_grasp.robots import robot_spec
from tr_grasp.sensing import PinholeCamera


class TestFake(BackendContract):
    @pytest.fixture(params=["ur5_rg2", "j2s7s300"])
    def station(self, request):
        return KinematicFake.of(robot_spec(request.param))


class TestFakeThatLags(BackendContract):
    @pytest.fixture
    def station(self):
        return KinematicFake.of(robot_spec("ur5_rg2"), lag_s=0.02)


class TestGuardedFake(BackendContract):
    """A guard changes nothing for commands that keep the rules; those that do not are its own tests' business."""

    @pytest.fixture
    def station(self):
        spec = robot_spec("ur5_robotiq_2f85")
        return Guard(KinematicFake.of(spec), Kinematics(spec), GuardCfg()).station


@pytest.mark.sim
class TestSapien(BackendContract):
    close_rad = 0.003

    @pytest.fixture(params=["panda", "ur5_rg2", "j2s7s300"])
    def station(self, request):
        station = simulated(request.param)
        # What it was doing in the test before is over; loading a robot takes longer than a test.
        station.arm.place(robot_spec(request.param).home_q_rad)
        finish(station.gripper.move(station.gripper.opening_range_m[1]), station.world)
        station.world.wait(0.5)
        return station


@cache
def simulated(robot):
    from tr_grasp.envs.sapien_station import SapienStation

    camera = PinholeCamera.looking_at((1.2, 0.6, 0.8), (0.3, 0.0, 0.2), 0.8, 32)
    return SapienStation.of(robot, camera=camera, physics_hz=120)
