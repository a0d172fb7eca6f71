"""Every arm follows the tool through the whole workspace, without a simulator."""

import numpy as np
import pytest

from tr_grasp.robots import ChainKinematics, robot_names, robot_spec
from tr_grasp.robots.cartesian import ToolLimits, ToolTarget, inverse_kinematics, next_target, pose_of

LOWER, UPPER = np.array([0.38, -0.12, 0.012]), np.array([0.62, 0.12, 0.26])
DOWN = np.diag([1.0, -1.0, -1.0])
LIMITS = ToolLimits(LOWER, UPPER)


class Walker:
    """Sends an arm from target to target as the controller does; the tcp is the hand's."""

    def __init__(self, name, retracted_m=0.0):
        spec = robot_spec(name)
        self.arm, self.q = ChainKinematics(spec), np.array(spec.home_q_rad)
        self.lower, self.upper = spec.lower_rad + 0.02, spec.upper_rad - 0.02
        self.target = ToolTarget(np.array([0.5, 0.0, 0.24]), 0.0)
        self.retracted_m = retracted_m
        # The Panda's controller has no rest: what its policies were trained with.
        self.rest = np.array(spec.home_q_rad) if name == "j2s7s300" else None

    def step(self, move_m, turn_rad):
        """One step; returns the largest joint move and the errors of position and direction."""
        self.target = next_target(self.target, self.target.position, move_m, turn_rad, LIMITS)
        goal = pose_of(self.target, DOWN)
        goal[2, 3] -= self.retracted_m
        q = inverse_kinematics(self.arm, goal, self.q, self.lower, self.upper, rest=self.rest)
        jump, self.q = np.abs(q - self.q).max(), q
        T = self.arm.pose(q)
        return jump, np.linalg.norm(T[:3, 3] - goal[:3, 3]), np.abs(T[:3, :3] - goal[:3, :3]).max()


@pytest.mark.parametrize("name", robot_names())
def test_random_steps_are_followed_without_error_or_jump(name):
    walker, rng = Walker(name), np.random.default_rng(0)
    for _ in range(100 if name == "panda" else 1000):
        jump, offset, turn = walker.step(rng.uniform(-0.05, 0.05, 3), rng.uniform(-0.4, 0.4))
        assert offset < 5e-4
        assert turn < 2e-3
        # 5 cm along each axis and 0.4 rad at once, with margin: another branch is more than 2 rad away.
        assert jump < 1.1


@pytest.mark.parametrize("name", robot_names())
@pytest.mark.parametrize("retracted_m", [0.0, 0.041])
def test_every_corner_is_reached_with_every_turn(name, retracted_m):
    for corner in np.ndindex(2, 2, 2):
        for yaw in (-1.87, 0.0, 1.87):
            walker = Walker(name, retracted_m)
            goal = np.where(corner, UPPER, LOWER)
            for _ in range(12):
                _, offset, turn = walker.step(
                    np.clip(goal - walker.target.position, -0.05, 0.05), np.clip(yaw - walker.target.yaw_rad, -0.4, 0.4)
                )
            assert offset < 5e-4
            assert turn < 2e-3


@pytest.mark.parametrize("name", [name for name in robot_names() if name != "panda"])
def test_a_walk_that_returns_brings_all_joints_back(name):
    walker, rng = Walker(name), np.random.default_rng(1)
    ends = []
    for _ in range(2):
        for _ in range(300):
            walker.step(rng.uniform(-0.05, 0.05, 3), rng.uniform(-0.4, 0.4))
        for _ in range(20):
            offset = np.array([0.5, 0.0, 0.24]) - walker.target.position
            walker.step(np.clip(offset, -0.05, 0.05), np.clip(-walker.target.yaw_rad, -0.4, 0.4))
        ends.append(walker.q)
    # A redundant arm leans back towards its rest while it moves.
    assert np.abs(ends[1] - ends[0]).max() < (1e-3 if len(walker.q) == 6 else 0.1)
