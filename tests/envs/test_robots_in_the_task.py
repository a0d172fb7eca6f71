"""What must hold in Task I whichever robot plays it."""

import os
import subprocess
import sys

import gymnasium as gym
import numpy as np
import pytest
import torch
from torchrl.envs import check_env_specs

from tests.robots.test_user import URDF, YAML
from tr_grasp import keys
from tr_grasp.configs import EnvCfg, ObjectsCfg, ObservationCfg
from tr_grasp.envs import make_env
from tr_grasp.envs.robot_bodies import link_bodies
from tr_grasp.errors import ConfigError
from tr_grasp.robots import robot_names, robot_spec

pytestmark = pytest.mark.sim
OWN = [name for name in robot_names() if name != "panda"]
ONE = ObjectsCfg(count_range=(1, 1))
LABELLED = ObservationCfg(expert_labels=True, stack_n=1)


@pytest.fixture(scope="module", params=OWN)
def env(request):
    env = make_env(EnvCfg(robot=request.param, objects=ONE, observation=LABELLED))
    yield env
    env.close()


def expert_rollout(env, steps):
    return env.rollout(steps, lambda td: td.set(keys.ACTION, td[keys.EXPERT_ACTION]))


def test_specs_are_kept(env):
    check_env_specs(env)


def test_after_reset_the_tool_is_home_points_down_and_is_open(env):
    env.set_seed(5)
    proprio = env.reset()[keys.PROPRIO][-1].numpy()
    assert proprio[0] == pytest.approx(1.0, abs=0.02)
    np.testing.assert_allclose(proprio[1:4], [0.5, 0.0, 0.24], atol=0.08)
    np.testing.assert_allclose(proprio[4:7], [1, 0, 0], atol=0.25)


def test_the_same_seed_gives_the_same_episode_to_the_bit(env):
    runs = []
    for other in (11, 12):  # something else happens in between
        env.set_seed(other)
        env.rollout(2)
        env.set_seed(4)
        runs.append(expert_rollout(env, 12))
    for key in (keys.PROPRIO, keys.ACTION, ("next", "reward")):
        assert torch.equal(runs[0][key], runs[1][key])
    assert torch.equal(runs[0][keys.OCTREE].codes, runs[1][keys.OCTREE].codes)
    assert torch.equal(runs[0][keys.OCTREE].features, runs[1][keys.OCTREE].features)


def test_the_expert_lifts_single_objects(env):
    lifted = []
    for seed in range(4):
        env.set_seed(seed)
        lifted.append(bool(expert_rollout(env, 100)[-1]["next", keys.SUCCESS]))
    assert sum(lifted) >= 3


def test_a_closed_gripper_reads_minus_one(env):
    env.set_seed(6)
    td = env.reset()
    readings = []
    for _ in range(8):
        td = env.step(td.set(keys.ACTION, torch.tensor([0.0, 0, 0, 0, -1])))["next"]
        readings.append(float(td[keys.PROPRIO][-1, 0]))
    assert readings == sorted(readings, reverse=True)
    assert readings[-1] == pytest.approx(-1.0, abs=0.05)


def test_every_link_that_is_drawn_is_seen(env):
    task = env.task
    links = {name: link._objs[0] for name, link in task.agent.robot.links_map.items()}
    drawn = {link.name for link in robot_spec(task.cfg.robot).links if any(shape.drawn for shape in link.shapes)}
    assert set(link_bodies(task.agent, links)) == drawn


def test_fingers_count_with_all_their_links(env):
    spec = robot_spec(env.task.cfg.robot)
    assert [len(finger) for finger in env.task._fingers] == [len(finger.links) for finger in spec.gripper.fingers]


def test_robot_uids_choose_the_robot():
    task = gym.make("GraspNovelObjects-v1", robot_uids="ur5_rg2").unwrapped
    assert task.agent.uid == "ur5_rg2"
    task.close()


def test_a_robot_of_ones_own_plays_by_the_path_of_its_yaml(tmp_path):
    (tmp_path / "robot.urdf").write_text(
        URDF.replace('<mesh filename="package://meshes/bar.stl"/>', '<sphere radius="0.1"/>')
    )
    path = tmp_path / "mine.yaml"
    path.write_text(YAML.replace("urdf/robot.urdf", "robot.urdf"))
    env = make_env(EnvCfg(robot=str(path), objects=ONE, observation=LABELLED), seed=0)
    assert len(env.rollout(2)) == 2
    env.close()


def test_an_unknown_robot_names_the_valid_ones():
    with pytest.raises(ConfigError, match="unknown robot 'ur5_rg3'; did you mean 'ur5_rg2'"):
        make_env(EnvCfg(robot="ur5_rg3"))


WITHOUT_A_DRIVER = """
from tr_grasp.configs import EnvCfg
from tr_grasp.envs import make_env
for robot in {robots}:
    env = make_env(EnvCfg(robot=robot), seed=0)
    assert len(env.rollout(1)) == 1
    env.close()
"""


@pytest.mark.slow
def test_all_robots_play_where_there_is_no_graphics_driver():
    environment = {**os.environ, "VK_DRIVER_FILES": "/nonexistent", "VK_ICD_FILENAMES": "/nonexistent"}
    code = WITHOUT_A_DRIVER.format(robots=robot_names())
    ended = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stderr
