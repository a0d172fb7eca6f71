import pytest

from tests.robots.test_user import URDF, YAML
from tr_grasp.errors import ConfigError
from tr_grasp.grasps import GripperShape, gripper_shape
from tr_grasp.robots import robot_names, robot_spec


@pytest.mark.parametrize("robot", robot_names())
def test_a_gripper_opens_as_wide_and_reaches_as_deep_as_its_robots_data_say(robot):
    shape, gripper = gripper_shape(robot), robot_spec(robot).gripper
    assert shape.opening_m == pytest.approx(gripper.opening_range_m[1], abs=1e-3)
    assert shape.tip_below_tcp_m == pytest.approx(gripper.tips_m[0], abs=1e-3)


def test_the_default_is_the_pandas():
    assert gripper_shape("panda") == GripperShape()


def test_of_a_users_robot_the_opening_is_known(tmp_path):
    (tmp_path / "robot.urdf").write_text(
        URDF.replace('<mesh filename="package://meshes/bar.stl"/>', '<sphere radius="0.1"/>')
    )
    path = tmp_path / "mine.yaml"
    path.write_text(YAML.replace("urdf/robot.urdf", "robot.urdf"))
    assert gripper_shape(str(path)).opening_m == robot_spec(str(path)).gripper.opening_range_m[1]


def test_an_unknown_robot_is_refused():
    with pytest.raises(ConfigError, match="unknown robot"):
        gripper_shape("ur5_rg3")
