from __future__ import annotations

import sys

import numpy as np
import pytest

pytest.importorskip("pyarrow")

from tests.trainers.lerobot_reader import LeRobotV3
from tests.trainers.test_demonstrations import record, recording
from tr_grasp.errors import ConfigError, DemonstrationError
from tr_grasp.trainers import lerobot
from tr_grasp.trainers.lerobot import export_lerobot, statistics


@pytest.fixture
def demos(tmp_path):
    return record(tmp_path / "demos.h5", range(4), recording(noise_scale=(), gripper_flip_probability=0.0))


def test_a_reader_of_the_format_finds_every_step(demos, tmp_path):
    written = export_lerobot(demos, tmp_path / "set")
    data = LeRobotV3(tmp_path / "set")
    assert (written.episodes_n, written.steps_n) == (4, demos.transitions_n)
    assert data.info["robot_type"] == "panda"
    assert data.info["fps"] == demos.recording.env.control_hz
    assert data.tasks == {0: "grasp one of the objects and lift it"}
    first = 0
    for number, demonstration in enumerate(demos):
        read, arrays, steps = data.episode(number), demonstration.arrays, demonstration.info.steps
        np.testing.assert_array_equal(read["observation.state"], arrays["proprio"][:-1])
        np.testing.assert_array_equal(read["action"], arrays["action"])
        np.testing.assert_array_equal(read["expert_action"], arrays["expert_action"][:-1])
        np.testing.assert_array_equal(read["observation.octree.codes"], arrays["codes"][:-1])
        octrees = read["observation.octree.features"].reshape(arrays["features"][:-1].shape)
        np.testing.assert_array_equal(octrees.astype(np.float16), arrays["features"][:-1])
        np.testing.assert_array_equal(read["next.reward"], arrays["reward"][:, 0])
        np.testing.assert_array_equal(read["index"], first + np.arange(steps))
        np.testing.assert_array_equal(read["timestamp"], np.arange(steps, dtype=np.float32) / np.float32(4))
        assert read["next.done"].tolist() == [False] * (steps - 1) + [True]
        assert read["next.success"][-1] == demonstration.info.success
        assert set(read["episode_index"]) == {number}
        first += steps


def test_statistics_are_those_of_all_steps(demos, tmp_path):
    export_lerobot(demos, tmp_path / "set")
    data = LeRobotV3(tmp_path / "set")
    actions = np.concatenate([demonstration.arrays["action"] for demonstration in demos])
    np.testing.assert_allclose(data.stats["action"]["mean"], actions.mean(0), rtol=1e-5, atol=1e-7)
    np.testing.assert_allclose(data.stats["action"]["std"], actions.std(0), rtol=1e-5, atol=1e-7)
    assert data.stats["action"]["count"] == [len(actions)]
    first = data.episodes[0]
    np.testing.assert_allclose(first["stats/action/max"], demos[0].arrays["action"].max(0), rtol=1e-6)
    # Worked by hand.
    hand = statistics(np.array([1, 2, 3, 6]))
    assert (hand["min"], hand["max"], hand["mean"], hand["q50"]) == ([1], [6], [3], [2.5])
    assert hand["std"] == pytest.approx([np.sqrt(3.5)])


def test_large_data_are_shared_out_over_files(demos, tmp_path, monkeypatch):
    export_lerobot(demos, tmp_path / "one")
    monkeypatch.setattr(lerobot, "BYTES_PER_FILE", 1)
    export_lerobot(demos, tmp_path / "many")
    one, many = LeRobotV3(tmp_path / "one"), LeRobotV3(tmp_path / "many")
    assert len(list((tmp_path / "many/data").glob("*/*.parquet"))) == 4
    for number in range(4):
        for name, column in one.episode(number).items():
            np.testing.assert_array_equal(column, many.episode(number)[name])


def test_failures_can_be_left_out(tmp_path):
    demos = record(tmp_path / "demos.h5", range(8), recording(noise_scale=(0.0, 2.0), episode_steps=3))
    successes = sum(episode.success for episode in demos.episodes)
    assert 0 < successes < 8
    assert export_lerobot(demos, tmp_path / "set", successes_only=True).episodes_n == successes
    data = LeRobotV3(tmp_path / "set")
    assert all(data.episode(number)["next.success"][-1] for number in range(successes))


def test_a_folder_that_holds_something_is_refused(demos, tmp_path):
    with pytest.raises(DemonstrationError, match="is not an empty folder"):
        export_lerobot(demos, tmp_path)


def test_missing_pyarrow_is_told_with_its_cure(demos, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(ConfigError, match=r"pip install 'tr-grasp\[lerobot\]'"):
        export_lerobot(demos, tmp_path / "set")
    assert not (tmp_path / "set").exists()
