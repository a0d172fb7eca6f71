"""The arms in the simulator: a table, a box, and nothing else."""

import numpy as np
import pytest
from mani_skill.agents.registration import REGISTERED_AGENTS

from tests.robots.bare_scene import BareScene
from tests.robots.test_user import URDF, YAML
from tr_grasp.robots import load_robot, robot_names, robot_spec
from tr_grasp.robots.agents import CartesianPanda, agent_class

pytestmark = pytest.mark.sim
NAMES = robot_names()
OWN = [name for name in NAMES if name != "panda"]


@pytest.fixture(scope="module", params=NAMES)
def scene(request):
    return request.param, BareScene(request.param, box_at=(0.9, 0.4))


def test_moves_end_within_2_mm(scene):
    _, bare = scene
    rng = np.random.default_rng(0)
    for _ in range(6):
        goal = rng.uniform([0.38, -0.12, 0.03], [0.62, 0.12, 0.25])
        yaw = rng.uniform(-1.5, 1.5)
        bare.go_to(goal, yaw, steps=12)
        T = bare.controller.measured_pose()
        assert np.linalg.norm(T[:3, 3] - goal) < 0.002
        assert T[2, 2] < -0.9999
        assert abs(np.arctan2(T[1, 0], T[0, 0]) - yaw) < 0.005


def test_the_tool_stays_where_it_is_while_the_fingers_close_and_open(scene):
    name, bare = scene
    bare.go_to((0.5, 0.0, 0.1), 0.0, steps=8)
    start = bare.controller.measured_pose()[:3, 3]
    openings = [bare.controller.gripper_opening_m()]
    for gripper in [-1.0] * 8 + [1.0] * 8:
        bare.step([0, 0, 0, 0, gripper])
        openings.append(bare.controller.gripper_opening_m())
        assert np.linalg.norm(bare.controller.measured_pose()[:3, 3] - start) < 0.004
    widest = robot_spec(name).gripper.opening_range_m[1]
    assert openings[0] == pytest.approx(widest, abs=1e-3)
    assert min(openings) < 0.002
    assert openings[-1] == pytest.approx(widest, abs=1e-3)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(("box_at", "yaw"), [((0.5, 0.0), 0.0), ((0.43, 0.09), 0.9), ((0.57, -0.08), -1.2)])
def test_a_box_is_gripped_and_lifted(name, box_at, yaw):
    bare = BareScene(name, box_m=(0.04, 0.04, 0.05), box_at=box_at, box_yaw_rad=yaw)
    bare.go_to((*box_at, 0.12), yaw, steps=10)
    bare.go_to((*box_at, 0.03), yaw, steps=6)
    bare.go_to((*box_at, 0.03), yaw, gripper=-1.0, steps=8)
    bare.go_to((*box_at, 0.2), yaw, gripper=-1.0, steps=8)
    position = bare.box_position()
    assert position[2] > 0.17
    assert np.linalg.norm(position[:2] - box_at) < 0.01
    assert bare.controller.gripper_opening_m() == pytest.approx(0.04, abs=0.006)


@pytest.mark.parametrize("name", OWN)
def test_a_box_beside_the_middle_is_gripped_too(name):
    bare = BareScene(name, box_m=(0.04, 0.04, 0.05), box_at=(0.5, 0.012))
    bare.go_to((0.5, 0.0, 0.03), steps=8)
    bare.go_to((0.5, 0.0, 0.03), gripper=-1.0, steps=8)
    bare.go_to((0.5, 0.0, 0.2), gripper=-1.0, steps=8)
    assert bare.box_position()[2] > 0.17


@pytest.mark.parametrize("name", OWN)
def test_masses_in_the_simulator_are_those_of_the_data(name):
    bare, spec = BareScene(name), robot_spec(name)
    simulated = {link.name.split(f"{name}_", 1)[1]: link.mass for link in bare.robot.links}
    for link in spec.links:
        if link.mass_kg > 0:
            assert simulated[link.name] == pytest.approx(link.mass_kg, rel=1e-5)


def test_agents_are_registered_for_robot_uids():
    assert set(OWN) <= set(REGISTERED_AGENTS)
    assert agent_class("panda") is CartesianPanda
    assert agent_class("ur5_rg2").uid == "ur5_rg2"


def test_the_urdf_is_written_once_and_named_after_its_content(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    BareScene("ur5_rg2")
    BareScene("ur5_rg2")
    (written,) = (tmp_path / "tr_grasp" / "robots").iterdir()
    assert written.name.startswith("ur5_rg2-")


def test_a_users_robot_loads_and_moves(tmp_path):
    (tmp_path / "robot.urdf").write_text(
        URDF.replace('<mesh filename="package://meshes/bar.stl"/>', '<sphere radius="0.1"/>')
    )
    path = tmp_path / "mine.yaml"
    path.write_text(YAML.replace("urdf/robot.urdf", "robot.urdf"))
    bare = BareScene(str(path), box_at=(5.0, 0.0))
    assert bare.agent.spec == load_robot(path)
    bare.step([0, 0, 0, 0, -1])
    assert bare.controller.gripper_opening_m() < 0.07
