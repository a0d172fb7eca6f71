import textwrap

import numpy as np
import pytest

from tr_grasp.errors import ConfigError
from tr_grasp.robots import link_poses, load_robot, robot_spec
from tr_grasp.robots.bodies import robot_bodies

INERTIA = '<inertia ixx="1e-3" iyy="1e-3" izz="1e-3" ixy="0" ixz="0" iyz="0"/></inertial>'
URDF = f"""
<robot name="two_bars">
  <link name="base"/>
  <link name="upper"><inertial><mass value="1"/>{INERTIA}
    <visual><geometry><mesh filename="package://meshes/bar.stl"/></geometry></visual></link>
  <link name="lower"><inertial><mass value="1"/>{INERTIA}</link>
  <link name="left"><inertial><mass value="0.1"/>{INERTIA}</link>
  <link name="right"><inertial><mass value="0.1"/>{INERTIA}</link>
  <link name="tool"/>
  <joint name="hip" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 0 2"/>
    <limit lower="-3" upper="3" velocity="1" effort="10"/></joint>
  <joint name="knee" type="continuous"><parent link="upper"/><child link="lower"/><origin xyz="1 0 0"/>
    <axis xyz="0 0 1"/><limit velocity="1" effort="10"/></joint>
  <joint name="end" type="fixed"><parent link="lower"/><child link="tool"/><origin xyz="1 0 0"/></joint>
  <joint name="l" type="prismatic"><parent link="lower"/><child link="left"/><axis xyz="0 1 0"/>
    <limit lower="0" upper="0.05" velocity="1" effort="10"/></joint>
  <joint name="r" type="prismatic"><parent link="lower"/><child link="right"/><axis xyz="0 -1 0"/>
    <limit lower="0" upper="0.05" velocity="1" effort="10"/></joint>
</robot>
"""
YAML = """
urdf: urdf/robot.urdf
base_link: base
tcp_link: tool
arm_joints: [hip, knee]
home_q_rad: [0.1, -0.2]
gripper:
  joints: [l, r]
  closed: [0, 0]
  open: [0.04, 0.04]
  opening_m: 0.08
"""
TRIANGLE = (
    "solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid\n"
)


@pytest.fixture
def write(tmp_path):
    def write(urdf=URDF, yaml=YAML, mesh=True):
        (tmp_path / "urdf").mkdir()
        (tmp_path / "meshes").mkdir()
        (tmp_path / "urdf" / "robot.urdf").write_text(urdf)
        if mesh:
            (tmp_path / "meshes" / "bar.stl").write_text(TRIANGLE)
            (tmp_path / "meshes" / "bar.docx").write_text(TRIANGLE)
        path = tmp_path / "mine.yaml"
        path.write_text(textwrap.dedent(yaml))
        return path

    return write


def test_a_urdf_and_a_few_lines_make_a_robot(write):
    robot = load_robot(write())
    assert (robot.name, robot.joint_names, robot.gripper.joint_names) == ("mine", ("hip", "knee"), ("l", "r"))
    np.testing.assert_allclose(robot.lower_rad, [-3, -2 * np.pi])
    tool = link_poses(robot, [np.pi / 2, -np.pi / 2])["tool"]
    np.testing.assert_allclose(tool[:3, 3], [1, 1, 0], atol=1e-12)
    np.testing.assert_allclose(robot.gripper.joint_positions(0.03), [0.015, 0.015])


def test_the_path_of_its_yaml_is_the_name_of_a_robot(write):
    path = write()
    assert robot_spec(str(path)) == load_robot(path)


def test_joints_that_follow_each_other_are_one_finger(write):
    urdf = URDF.replace('<parent link="lower"/><child link="right"/>', '<parent link="left"/><child link="right"/>')
    gripper = load_robot(write(urdf)).gripper
    assert [finger.links for finger in gripper.fingers] == [("right", "left")]


NO_LIMIT = '<limit lower="-3" upper="3" velocity="1" effort="10"/></joint>'


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (NO_LIMIT, "</joint>", r"joint 'hip' .* has no limits; give it a <limit> with lower < upper"),
        (NO_LIMIT, '<limit lower="-3" upper="3"/></joint>', r"joint 'hip' .* positive velocity and effort"),
        ('<mass value="0.1"/>', '<mass value="0"/>', r"link 'left' .* has no mass, but joint 'l' moves it"),
        ('<axis xyz="0 -1 0"/>', '<mimic joint="l"/>', r"joint 'r' .* mimics another; remove its <mimic>"),
        ('type="fixed"', 'type="floating"', r"joint 'end' .* is of type 'floating'; valid: revolute, continuous"),
        ("</robot>", "", r"is not XML: no element found"),
        ("robot", "sdf", r"is not URDF: it starts with <sdf>"),
        ('<mass value="0.1"/>', '<mass value="nan"/>', r"has something else where numbers belong: 'nan' is not finite"),
        ('ixx="1e-3"', 'ixx="0"', r"link 'upper' .* has an inertia that no body has, but joint 'hip' moves it"),
        ('<axis xyz="0 -1 0"/>', '<axis xyz="0 0 0"/>', r"joint 'r' .* has an axis of length 0"),
        ('<link name="tool"/>', "", r"joint 'end' .*: unknown link 'tool'.* Valid: base, left, lower, right, upper\."),
        (
            '<parent link="lower"/><child link="left"/>',
            '<parent link="lowr"/><child link="left"/>',
            r"joint 'l' .*'lowr'",
        ),
        ('<link name="tool"/>', '<link name="tool"/><link name="base"/>', r"has 2 links of the name 'base'; rename"),
        ('<joint name="r"', '<joint name="l"', r"has 2 joints of the name 'l'; rename all but one"),
        (
            '<child link="right"/>',
            '<child link="left"/>',
            r"joints 'l' and 'r' of .* both move link 'left'; remove",
        ),
        ('<parent link="base"/>', '<parent link="tool"/>', r"joint 'hip' .* is part of a circle of joints; remove one"),
        ('lower="-3" upper="3"', 'lower="a" upper="3"', r"has something else where numbers belong: .*'a'"),
    ],
)
def test_a_bad_urdf_is_refused_in_one_sentence(write, old, new, message):
    with pytest.raises(ConfigError, match=message) as caught:
        load_robot(write(URDF.replace(old, new)))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("[hip, knee]", "[hip, kne]", r"unknown joint 'kne'; did you mean 'knee'\? Valid: hip, knee, l, r\."),
        ("[hip, knee]", "[knee, hip]", r"arm_joints must be those from 'base' to 'tool', in this order: hip, knee"),
        ("joints: [l, r]", "joints: [l]", r"one value for each joint, got 1, 2 and 2"),
        ("open: [0.04, 0.04]", "open: [0.04, 0.4]", r"gripper.open puts joint 'r' at 0.4, outside its limits 0..0.05"),
        ("open: [0.04, 0.04]", "open: [0.04, 0]", r"put joint 'r' at the same place, 0"),
        ("[0.1, -0.2]", "[0.1]", r"home_q_rad must have 2 values, one for each arm joint, got 1"),
        ("[0.1, -0.2]", "[5, -0.2]", r"home_q_rad puts joint 'hip' at 5.*outside its limits -3..3"),
        ("robot.urdf", "nothing.urdf", r"there is no URDF at '.*nothing.urdf'"),
        ("base_link: base", "base_links: base", r"base_links: unknown; did you mean base_link"),
        ("tcp_link: tool", "tcp_link: grip", r"unknown link 'grip'"),
        ("base_link: base", "base_link: left", r"no joints lead from link 'left' to link 'tool'"),
        ("urdf:", "name: panda\nurdf:", r"the name 'panda' is taken"),
    ],
)
def test_a_bad_yaml_is_refused_in_one_sentence(write, old, new, message):
    with pytest.raises(ConfigError, match=message) as caught:
        load_robot(write(yaml=YAML.replace(old, new)))
    assert "\n" not in str(caught.value)


def test_a_joint_that_nothing_drives_is_refused(write):
    yaml = YAML.replace("[l, r]", "[l]").replace("[0, 0]", "[0]").replace("[0.04, 0.04]", "[0.04]")
    with pytest.raises(ConfigError, match="nothing drives joint 'r'"):
        load_robot(write(yaml=yaml))


def test_a_missing_mesh_is_named(write):
    with pytest.raises(ConfigError, match=r"names the mesh 'package://meshes/bar.stl', which is not there"):
        load_robot(write(mesh=False))


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(ConfigError, match=r"there is no robot at '.*none.yaml'; give a YAML file, or one of: panda"):
        load_robot(tmp_path / "none.yaml")


@pytest.mark.parametrize("content", ["", "no mesh at all " * 20])
def test_a_mesh_without_triangles_is_named(write, content):
    path = write()
    (path.parent / "meshes" / "bar.stl").write_text(content)
    with pytest.raises(ConfigError, match=r"the robot's mesh '.*bar.stl' .*; export it again"):
        robot_bodies(load_robot(path))


def test_a_mesh_that_cannot_be_read_is_named(write):
    path = write(URDF.replace("bar.stl", "bar.docx"))
    with pytest.raises(ConfigError, match=r"cannot read the robot's mesh '.*bar.docx': .*; export it again"):
        robot_bodies(load_robot(path))
