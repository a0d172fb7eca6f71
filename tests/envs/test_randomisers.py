"""Each randomiser varies what it names and nothing else."""

from __future__ import annotations

import hashlib
import subprocess
import sys
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from tr_grasp import keys
from tr_grasp.configs import ActionCfg, CameraCfg, EnvCfg, ObjectsCfg, ObservationCfg, RandomisationCfg
from tr_grasp.envs import grasp_novel_objects, make_env
from tr_grasp.envs.latency import draw_delay_substeps
from tr_grasp.envs.streams import Stream, stream, uniform_or_middle
from tr_grasp.envs.torchrl_env import TorchRLGraspEnv, episode_seed
from tr_grasp.errors import ConfigError

pytestmark = pytest.mark.sim
SMALL = EnvCfg(
    objects=ObjectsCfg(count_range=(1, 2)),
    camera=CameraCfg(image_size_px=40),
    observation=ObservationCfg(stack_n=1),
)
ALL_ON = RandomisationCfg(camera_pose=True, depth_noise="stereo", gravity=True, latency=True)
SEED = 5


def with_switches(**switches: Any) -> EnvCfg:
    return replace(SMALL, randomise=replace(SMALL.randomise, **switches))


def drawn(cfg: EnvCfg, seed: int = SEED) -> dict[str, Any]:
    """What was drawn for the first episode of a seed."""
    env = make_env(cfg, seed)
    env.reset()
    task = env.task
    shapes = [body.collision_shapes[0] for body in task._bodies]
    found = {
        "objects": [model.name for model in task.models],
        "masses": [body.mass for body in task._bodies],
        "frictions": [shape.physical_material.static_friction for shape in shapes],
        "rest": task.view.object_poses().round(6).tolist(),
        "joints": task.agent.robot._objs[0].qpos.tolist(),
        "eye": task.view.camera.T_base_cam[:3, 3].tolist(),
        "gravity": float(task.scene.px.config.gravity[2]),
        "delay": getattr(task.controller, "delay_substeps", 0),
    }
    env.close()
    return found


@pytest.fixture(scope="module")
def base() -> dict[str, Any]:
    return drawn(SMALL)


@pytest.mark.parametrize(
    ("switch", "changes"),
    [
        ({"camera_pose": True}, {"eye"}),
        ({"latency": True}, {"delay"}),
        ({"depth_noise": "stereo"}, set()),
        ({"gravity": True}, {"gravity", "rest"}),
        ({"object_properties": False}, {"masses", "frictions", "rest"}),
        ({"initial_joints": False}, {"joints"}),
    ],
)
def test_a_switch_changes_what_it_names_and_nothing_else(base: dict, switch: dict, changes: set[str]) -> None:
    now = drawn(with_switches(**switch))
    # Where objects come to rest may move with their mass and with gravity: that is physics, not drawn.
    assert {name for name in base if now[name] != base[name]} - {"rest"} == changes - {"rest"}
    assert "rest" in changes or now["rest"] == base["rest"]


def test_without_properties_every_object_has_the_middle_of_the_ranges() -> None:
    found = drawn(with_switches(object_properties=False))
    np.testing.assert_allclose(found["masses"], 0.15)
    np.testing.assert_allclose(found["frictions"], 1.125)


def test_without_count_there_are_as_many_objects_as_allowed() -> None:
    seeds = [next(seed for seed in range(20) if drawn_count(seed) == count) for count in (1, 2)]
    assert [len(drawn(SMALL, seed)["objects"]) for seed in seeds] == [1, 2]
    assert [len(drawn(with_switches(object_count=False), seed)["objects"]) for seed in seeds] == [2, 2]


def drawn_count(seed: int) -> int:
    return int(stream(episode_seed(seed, 0), Stream.SCENE).integers(1, 3))


def test_without_joint_noise_the_arm_starts_at_home() -> None:
    env = make_env(with_switches(initial_joints=False), SEED)
    env.reset()
    np.testing.assert_allclose(env.task.agent.robot._objs[0].qpos[:7], env.task.agent.home_arm_q, atol=1e-6)
    env.close()


def test_without_poses_objects_drop_in_the_same_way_in_every_episode(monkeypatch: pytest.MonkeyPatch) -> None:
    dropped = []
    original = grasp_novel_objects.drop_poses

    def recording(*args: Any) -> list:
        dropped.append(original(*args))
        return dropped[-1]

    monkeypatch.setattr(grasp_novel_objects, "drop_poses", recording)

    def first_drop(poses: bool, seed: int) -> np.ndarray:
        env = make_env(replace(with_switches(object_poses=poses, object_count=False)), seed)
        dropped.clear()
        env.reset()
        env.close()
        return np.array([[*position[:2], *q] for position, q in dropped[0]])

    np.testing.assert_array_equal(first_drop(False, 0)[0], first_drop(False, 1)[0])
    assert (first_drop(True, 0)[0] != first_drop(True, 1)[0]).all()


def test_gravity_is_the_nominal_one_plus_a_normal_number_of_its_own_stream() -> None:
    strong = replace(with_switches(gravity=True), gravity_sigma_mps2=0.5)
    expected = 9.81 + 0.5 * stream(episode_seed(SEED, 0), Stream.GRAVITY).standard_normal()
    assert drawn(strong)["gravity"] == pytest.approx(-expected, abs=1e-5)


@given(
    seed=st.integers(0, 2**31),
    low=st.floats(0, 0.25),
    width=st.floats(0, 0.25),
    physics_hz=st.sampled_from([60, 100, 240]),
)
def test_a_delay_lies_in_its_range_to_the_nearest_physics_step(
    seed: int, low: float, width: float, physics_hz: int
) -> None:
    steps = draw_delay_substeps((low, low + width), physics_hz, np.random.default_rng(seed))
    assert low - 0.5 / physics_hz <= steps / physics_hz <= low + width + 0.5 / physics_hz


@given(seed=st.integers(0, 2**31), low=st.floats(0, 1), width=st.floats(0, 1))
def test_a_property_lies_in_its_range_and_costs_one_draw_either_way(seed: int, low: float, width: float) -> None:
    ons, offs = np.random.default_rng(seed), np.random.default_rng(seed)
    assert low <= uniform_or_middle((low, low + width), ons, uniform=True) <= low + width
    assert uniform_or_middle((low, low + width), offs, uniform=False) == pytest.approx(low + width / 2)
    assert ons.random() == offs.random()


@given(seed=st.integers(0, 2**31))
def test_streams_of_one_episode_differ(seed: int) -> None:
    assert len({stream(seed, which).integers(2**62) for which in Stream}) == len(Stream)


def heights_of_each_physics_step(latency_s: float | None, monkeypatch: pytest.MonkeyPatch) -> np.ndarray:
    """(75,) tool heights [m] while an arm goes down, up and down again."""
    action = ActionCfg() if latency_s is None else ActionCfg(latency_s=(latency_s, latency_s))
    cfg = replace(with_switches(latency=latency_s is not None, initial_joints=False), action=action)
    # As many iterations as the arm has: with more, objects that are still awake change how exactly the arm is solved.
    env = make_env(replace(cfg, contact_iterations=15), SEED)
    td, task, heights = env.reset(), env.task, []
    monkeypatch.setattr(task, "_after_simulation_step", lambda: heights.append(task.controller.measured_pose()[2, 3]))
    for dz in (-1.0, 0.5, -1.0):
        td = env.step(td.set(keys.ACTION, torch.tensor([0.0, 0.0, dz, 0.0, 1.0])))["next"]
    env.close()
    return np.array(heights)


@pytest.mark.parametrize("delay_n", [0, 7, 25])
def test_the_tool_moves_as_without_latency_but_that_much_later(delay_n: int, monkeypatch: pytest.MonkeyPatch) -> None:
    prompt = heights_of_each_physics_step(None, monkeypatch)
    late = heights_of_each_physics_step(delay_n / 100, monkeypatch)
    np.testing.assert_allclose(late[delay_n:], prompt[: len(prompt) - delay_n], atol=1e-4)
    np.testing.assert_allclose(late[:delay_n], prompt[0], atol=1e-3)
    assert np.ptp(prompt) > 0.04


def test_a_new_camera_each_episode_sees_the_cube_even_in_a_scene_that_stays() -> None:
    env = make_env(replace(with_switches(camera_pose=True), fresh_scene_every_n=3), SEED)
    eyes = []
    for _ in range(3):
        leaves = int((env.reset()[keys.OCTREE].codes >= 0).sum())
        eyes.append(env.task.view.camera.T_base_cam[:3, 3])
        assert leaves > 30
    assert np.linalg.norm(eyes[0] - eyes[1]) > 0.05 < np.linalg.norm(eyes[1] - eyes[2])
    env.close()


def test_a_camera_inside_an_object_is_refused_at_reset_with_the_name_of_the_object() -> None:
    env = make_env(SMALL, SEED)
    env.reset()
    model, T = env.task.models[0], env.task.view.object_poses()[0]
    eye = tuple((T[:3, :3] @ model.parts[0].vertices.mean(axis=0) + T[:3, 3]).tolist())
    env.close()
    with pytest.raises(ConfigError, match=f"inside the object '{model.name}'; move camera.eye_m"):
        make_env(replace(SMALL, camera=replace(SMALL.camera, eye_m=eye)), SEED).reset()


def digest(env: TorchRLGraspEnv, seed: int) -> str:
    """A hash of two short episodes."""
    env.set_seed(seed)
    found, actions = hashlib.sha256(), torch.Generator().manual_seed(0)
    for _ in range(2):
        td = env.reset()
        for _ in range(3):
            td = env.step(td.set(keys.ACTION, 2 * torch.rand(5, generator=actions) - 1))["next"]
            for tensor in (td[keys.PROPRIO], td[keys.OCTREE].codes, td[keys.OCTREE].features, td["reward"]):
                found.update(tensor.numpy().tobytes())
    return found.hexdigest()


def test_with_everything_on_equal_seeds_give_equal_episodes_in_this_and_in_another_process() -> None:
    env = make_env(replace(SMALL, randomise=ALL_ON), 0)
    first, other, again = digest(env, 3), digest(env, 4), digest(env, 3)
    env.close()
    assert first == again != other
    code = "from tests.envs.test_randomisers import *; print(digest(make_env(replace(SMALL, randomise=ALL_ON), 1), 3))"
    done = subprocess.run([sys.executable, "-W", "ignore", "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == first
