from __future__ import annotations

from pathlib import Path

import imageio.v3 as imageio
import numpy as np
import pytest

from tests.motion.conftest import at
from tr_grasp.errors import MotionError
from tr_grasp.motion import Kinematics, MotionLimits, Trajectory, time_optimal
from tr_grasp.motion.pictures import plot_trajectory, save_replay

READY = np.array([0.6, -1.4, 1.6, -1.77, -1.57, 0.6])


@pytest.fixture
def motion(ur5: Kinematics) -> tuple[MotionLimits, Trajectory]:
    limits = MotionLimits.of(ur5.spec)
    trajectory = time_optimal([READY, READY + 0.3, READY - 0.2], limits).trajectory
    assert trajectory is not None
    return limits, trajectory


def test_a_plot_of_a_motion_shows_lines(tmp_path: Path, motion, ur5: Kinematics) -> None:
    limits, trajectory = motion
    times, state = trajectory.every(0.05)
    path = plot_trajectory(
        trajectory, limits, tmp_path / "a.png", executed=(times, state.q), joint_names=ur5.spec.joint_names
    )
    picture = imageio.imread(path)[..., :3]
    assert picture.shape[0] > 600
    # Every joint's colour is there.
    for colour in ((0x3B, 0x6F, 0xD4), (0x2B, 0x9A, 0xA0)):
        assert (np.abs(picture.astype(int) - colour).max(-1) < 40).sum() > 100


def test_a_replay_has_a_picture_for_each_moment(tmp_path: Path, motion, ur5: Kinematics) -> None:
    _, trajectory = motion
    times, state = trajectory.every(0.05)
    path = save_replay(
        ur5,
        trajectory,
        tmp_path / "a.gif",
        executed=(times, state.q + 0.02),
        boxes=[(np.array([0.1, 0.1, 0.3]), at(0.4, 0.3, 0.15))],
        frame_s=0.2,
    )
    pictures = imageio.imread(path)
    assert len(pictures) == int(np.ceil(trajectory.duration_s / 0.2)) + 1
    assert np.abs(pictures[0].astype(int) - pictures[-1]).max() > 100


def test_other_endings_and_other_arms_are_refused(
    tmp_path: Path, motion, ur5: Kinematics, limits: MotionLimits
) -> None:
    _, trajectory = motion
    with pytest.raises(MotionError, match=r"\.png"):
        plot_trajectory(trajectory, motion[0], tmp_path / "a.jpg")
    with pytest.raises(MotionError, match=r"\.gif"):
        save_replay(ur5, trajectory, tmp_path / "a.mp4")
    with pytest.raises(MotionError, match="6 joints"):
        plot_trajectory(trajectory, limits, tmp_path / "a.png")
