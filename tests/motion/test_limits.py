from __future__ import annotations

import numpy as np
import pytest

from tr_grasp.errors import MotionError
from tr_grasp.motion import MotionLimits
from tr_grasp.robots.spec import robot_spec


def test_the_thesis_moves_as_moveit_timed_it() -> None:
    """A tenth of the rated speed, a tenth of MoveIt's own 1 rad/s², whatever the arm could do."""
    rated, thesis = (MotionLimits.of(robot_spec("ur5_rg2"), name) for name in ("rated", "thesis"))
    assert thesis.velocity_rad_s == pytest.approx([0.315] * 3 + [0.32] * 3)
    assert thesis.acceleration_rad_s2 == pytest.approx([0.1] * 6)
    assert (thesis.acceleration_rad_s2 / thesis.jerk_rad_s3 < 0.02).all()  # seconds: next to no limit of jerk
    assert np.array_equal(thesis.upper_rad, rated.upper_rad)


def test_an_unknown_name_gets_the_valid_ones() -> None:
    with pytest.raises(MotionError, match=r"did you mean 'rated'\? Valid: rated, thesis"):
        MotionLimits.of(robot_spec("ur5_rg2"), "ratd")  # type: ignore[arg-type]


@pytest.mark.parametrize("bad", [0.0, -1.0, np.nan, np.inf])
@pytest.mark.parametrize("place", [2, 3, 4])
def test_limits_must_be_positive_and_finite(bad: float, place: int) -> None:
    values = [[-1.0, -1.0], [1.0, 1.0], [1.0, 1.0], [1.0, 1.0], [1.0, 1.0]]
    values[place] = [1.0, bad]
    with pytest.raises(MotionError, match=r"limits\."):
        MotionLimits(*values)


def test_limits_must_have_room_and_be_of_one_length() -> None:
    with pytest.raises(MotionError, match="below"):
        MotionLimits([1.0], [1.0], [1.0], [1.0], [1.0])
    with pytest.raises(MotionError, match=r"limits\.lower_rad must hold one number for each of the 2 joints"):
        MotionLimits([-1.0], [1.0, 1.0], [1.0, 1.0], [1.0, 1.0], [1.0, 1.0])
