import subprocess
import sys
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tr_grasp.errors import ConfigError
from tr_grasp.geometry import invert_transform, rotation_about_z, transform_from, transform_points
from tr_grasp.robots import ChainKinematics, link_poses, robot_names, robot_spec, urdf_text, write_urdf
from tr_grasp.robots.chain import origin_transform
from tr_grasp.robots.parts import DhRow

NAMES = robot_names()
OWN = [name for name in NAMES if name != "panda"]


def joint_angles(name):
    spec = robot_spec(name)
    pairs = zip(spec.lower_rad, spec.upper_rad, strict=True)
    return st.tuples(*[st.floats(low, high) for low, high in pairs]).map(np.array)


def dh_pose(rows, base_rpy_rad, q):
    """The product of the four elementary motions of each row, as in the textbook."""
    T = origin_transform((0, 0, 0), base_rpy_rad)
    for row, angle in zip(rows, q, strict=True):
        turn = transform_from(rotation_about_z(angle + row.offset_rad), (0, 0, row.d_m))
        T = T @ turn @ origin_transform((row.a_m, 0, 0), (row.alpha_rad, 0, 0))
    return T


@pytest.mark.parametrize("name", OWN)
@given(data=st.data())
def test_forward_kinematics_equal_the_published_dh_parameters(name, data):
    spec = robot_spec(name)
    q = data.draw(joint_angles(name))
    expected = dh_pose(spec.dh.rows, spec.dh.base_rpy_rad, q)
    np.testing.assert_allclose(link_poses(spec, q)[spec.dh.link], expected, atol=1e-6)


def test_the_ur5_at_zero_is_stretched_out_as_its_drawing_says():
    T = link_poses(robot_spec("ur5_rg2"), np.zeros(6))["tool0"]
    np.testing.assert_allclose(T[:3, 3], [0.425 + 0.39225, 0.10915 + 0.0823, 0.089159 - 0.09465], atol=1e-9)


@given(q=joint_angles("j2s7s300"))
def test_the_rounded_dh_table_of_kinovas_guide_is_4_mm_from_the_urdf_at_most(q):
    half = np.pi / 2
    rows = [DhRow(0, d, half) for d in (-0.2755, 0, -0.41, -0.0098, -0.3111, 0)] + [DhRow(0, -0.2638, np.pi, -half)]
    rows[0] = DhRow(0, -0.2755, half, np.pi)
    guide = dh_pose(rows, (np.pi, 0, 0), q)
    ours = link_poses(robot_spec("j2s7s300"), q)["j2s7s300_end_effector"]
    assert np.linalg.norm(guide[:3, 3] - ours[:3, 3]) < 0.004
    np.testing.assert_allclose(guide[:3, :3], ours[:3, :3], atol=1e-9)


@pytest.mark.parametrize("name", NAMES)
def test_the_written_urdf_has_the_kinematics_and_masses_of_the_data(name, tmp_path):
    pinocchio = pytest.importorskip("pinocchio")
    spec = robot_spec(name)
    model = pinocchio.buildModelFromUrdf(str(write_urdf(spec, tmp_path)))
    data = model.createData()
    rng = np.random.default_rng(0)
    for _ in range(20):
        q = rng.uniform(spec.lower_rad, spec.upper_rad)
        fingers = spec.gripper.closed + rng.random() * (spec.gripper.open - spec.gripper.closed)
        where = dict(zip((*spec.joint_names, *spec.gripper.joint_names), (*q, *fingers), strict=True))
        full = np.array([where[joint] for joint in list(model.names)[1:]])
        pinocchio.framesForwardKinematics(model, data, full)
        for link, T in link_poses(spec, q, fingers).items():
            np.testing.assert_allclose(data.oMf[model.getFrameId(link)].homogeneous, T, atol=1e-6)
    # A base that stands still has no inertia in the model.
    moving = sum(link.mass_kg for link in spec.links if link.name != spec.base_link)
    np.testing.assert_allclose(pinocchio.computeTotalMass(model), moving, rtol=1e-6)
    np.testing.assert_allclose(sorted(model.upperPositionLimit), sorted([*spec.upper_rad, *_upper(spec)]))


def _upper(spec):
    return [joint.upper for joint in spec.gripper.joints]


@pytest.mark.parametrize("name", NAMES)
def test_at_home_the_open_gripper_points_down_and_closes_along_y(name):
    spec = robot_spec(name)
    poses = link_poses(spec, spec.home_q_rad)
    reach = spec.gripper.tips_m[-1] - spec.gripper.tips_m[0]
    expected = transform_from(np.diag([1.0, -1.0, -1.0]), (0.5, 0.0, 0.24 + reach))
    np.testing.assert_allclose(poses[spec.tcp_link], expected, atol=2e-5)
    T_tcp_base = invert_transform(poses[spec.tcp_link])
    pads = [T_tcp_base @ poses[finger.pad_link] @ [*finger.pad_point_m, 1.0] for finger in spec.gripper.fingers]
    middle = np.mean(pads, axis=0)
    assert abs(pads[0][1] - middle[1]) > 0.03
    assert abs(pads[0][0] - middle[0]) < 0.001


@pytest.mark.parametrize("name", NAMES)
def test_home_is_well_inside_the_joint_limits(name):
    spec = robot_spec(name)
    assert (np.minimum(spec.home_q_rad - spec.lower_rad, spec.upper_rad - spec.home_q_rad) > 0.3).all()


@pytest.mark.parametrize(
    ("name", "opening_m"), [("panda", 0.080), ("ur5_rg2", 0.110), ("ur5_robotiq_2f85", 0.085), ("j2s7s300", 0.0872)]
)
@pytest.mark.parametrize("part", [0.0, 0.25, 0.5, 1.0])
def test_the_pads_are_as_far_apart_as_the_gripper_says(name, opening_m, part):
    spec = robot_spec(name)
    gripper = spec.gripper
    assert gripper.opening_range_m == pytest.approx((0.0, opening_m), abs=1e-4)
    wanted = part * opening_m
    fingers = gripper.joint_positions(wanted)
    measured, tips = pads_and_tips(spec, fingers)
    assert measured == pytest.approx(min(wanted, gripper.opening_range_m[1]), abs=1e-4)
    assert gripper.opening_m(fingers) == pytest.approx(measured, abs=1e-4)
    assert gripper.tips_beyond_tcp_m(wanted) == pytest.approx(tips, abs=1e-4)


def pads_and_tips(spec, fingers):
    """Distance of the pads along y of the tcp, and how far the tips reach along its z, from the links' poses."""
    poses = link_poses(spec, spec.home_q_rad, fingers)
    T_tcp_base = invert_transform(poses[spec.tcp_link])
    pads, tips = (
        [transform_points(T_tcp_base @ poses[f.pad_link], np.array(point(f))) for f in spec.gripper.fingers]
        for point in (lambda f: f.pad_point_m, lambda f: f.tip_point_m)
    )
    return abs(pads[0][1] - np.mean([pad[1] for pad in pads[1:]])), max(tip[2] for tip in tips)


@pytest.mark.parametrize(("name", "length_m", "tool_kg"), [("ur5_rg2", 0.213, 0.78), ("ur5_robotiq_2f85", 0.163, 0.90)])
def test_closed_grippers_are_as_long_and_heavy_as_the_datasheet_says(name, length_m, tool_kg):
    spec = robot_spec(name)
    poses = link_poses(spec, np.zeros(6), spec.gripper.closed)
    tip = spec.gripper.tips_m[0] + (invert_transform(poses["tool0"]) @ poses["tcp"])[2, 3]
    assert tip == pytest.approx(length_m, abs=5e-4)
    of_arm = {joint.child for joint in spec.joints} | {spec.base_link}
    assert sum(link.mass_kg for link in spec.links if link.name not in of_arm) == pytest.approx(tool_kg)


@pytest.mark.parametrize("name", OWN)
def test_pads_stay_parallel_while_they_close(name):
    spec = robot_spec(name)
    for finger in spec.gripper.fingers:
        turned = []
        for opening in (0.0, 0.03, 0.08):
            poses = link_poses(spec, spec.home_q_rad, spec.gripper.joint_positions(opening))
            turned.append(poses[finger.pad_link][:3, :3])
        np.testing.assert_allclose(turned[1], turned[0], atol=1e-6)
        np.testing.assert_allclose(turned[2], turned[0], atol=1e-6)


@pytest.mark.parametrize("name", NAMES)
def test_every_link_that_moves_has_a_mass_that_can_exist(name):
    spec = robot_spec(name)
    moved = {joint.child for joint in (*spec.joints, *spec.gripper.joints)}
    for link in spec.links:
        if link.name not in moved:
            continue
        xx, yy, zz, xy, xz, yz = link.inertia_kgm2
        moments = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        assert link.mass_kg > 0
        assert moments[0] > 0
        # ManiSkill's files break this for the Panda's links by a little.
        assert name == "panda" or moments[0] + moments[1] >= moments[2] * (1 - 1e-9)


@pytest.mark.parametrize("name", NAMES)
def test_limits_are_arrays_of_positive_numbers(name):
    spec = robot_spec(name)
    n = len(spec.joint_names)
    for limits in (
        spec.upper_rad - spec.lower_rad,
        spec.velocity_limit_rad_s,
        spec.acceleration_limit_rad_s2,
        spec.jerk_limit_rad_s3,
        spec.effort_limit_nm,
    ):
        assert limits.shape == (n,)
        assert (limits > 0).all()


@pytest.mark.parametrize("name", NAMES)
def test_no_joint_mimics_another(name):
    root = ElementTree.fromstring(urdf_text(robot_spec(name)))
    assert root.find(".//mimic") is None
    assert {link.get("name") for link in root.findall("link")} == set(link_poses(robot_spec(name), _zeros(name)))


def _zeros(name):
    return np.zeros(len(robot_spec(name).joints))


@pytest.mark.parametrize("name", NAMES)
def test_the_jacobian_is_the_derivative_of_the_pose(name):
    spec = robot_spec(name)
    arm, q, step = ChainKinematics(spec), np.array(spec.home_q_rad) + 0.1, 1e-6
    T = arm.pose(q)
    for k, column in enumerate(arm.jacobian(q).T):
        moved = invert_transform(T) @ arm.pose(q + step * np.eye(len(q))[k])
        turn = moved[[2, 0, 1], [1, 2, 0]]
        np.testing.assert_allclose(column, np.concatenate([moved[:3, 3], turn]) / step, atol=1e-5)


def test_an_unknown_robot_is_refused_with_the_valid_names():
    with pytest.raises(ConfigError, match=r"unknown robot 'ur5-rg2'; did you mean 'ur5_rg2'.*j2s7s300, panda"):
        robot_spec("ur5-rg2")


def test_reading_the_panda_loads_no_simulator():
    code = "import sys; from tr_grasp.robots import robot_spec; robot_spec('panda'); print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert not {"sapien", "mani_skill", "torch"} & set(loaded)
