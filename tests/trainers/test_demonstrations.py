from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
import torch
from tensordict import TensorDict
from torchrl.envs import StepCounter, TransformedEnv

from tests.toy_env import env_spec, make_env, train_cfg
from tr_grasp.errors import ConfigError, DemonstrationError
from tr_grasp.provenance import Provenance
from tr_grasp.trainers import ReplayBuffer, RunFolder, Trainer
from tr_grasp.trainers.acting import ScriptedExpert
from tr_grasp.trainers.batches import BatchSampler
from tr_grasp.trainers.demonstration_file import DemonstrationFile, Recording, append_demonstrations
from tr_grasp.trainers.load_demonstrations import load_demonstrations
from tr_grasp.trainers.record import record_demonstrations

ORIGIN = Provenance("a command", commit="abc", versions={"torch": "2"})
STACK_N = 2


def recording(**changes) -> Recording:
    cfg = train_cfg()
    env = replace(cfg.env, observation=replace(cfg.env.observation, expert_labels=True))
    return replace(
        Recording(env, noise_scale=(0.3, 0.6), gripper_flip_probability=0.2, wander_steps=2, episode_steps=9), **changes
    )


def record(path: Path, seeds=range(4), how: Recording | None = None, **kwargs) -> DemonstrationFile:
    return record_demonstrations(path, how or recording(), list(seeds), ORIGIN, make_env=make_env, **kwargs)


def in_memory(seed: int, how: Recording | None = None) -> TensorDict:
    """The same episode as TorchRL rolls it out, which has never seen a file."""
    how = how or recording()
    env = TransformedEnv(make_env(how.env), StepCounter(how.episode_steps))
    env.set_seed(seed)
    torch.manual_seed(seed)
    return env.rollout(100, ScriptedExpert(how.noise_scale, how.gripper_flip_probability, how.wander_steps))


def assert_same(a: TensorDict, b: TensorDict) -> None:
    assert a.batch_size == b.batch_size
    for key in b.keys(True, True):
        assert a[key].dtype == b[key].dtype, key
        assert torch.equal(a[key], b[key]), key


def test_an_episode_that_was_read_equals_the_one_in_memory(tmp_path):
    file = record(tmp_path / "demos.h5")
    lengths = []
    for demonstration in file:
        read, kept = demonstration.chunk(STACK_N), in_memory(demonstration.info.seed)
        assert_same(kept.select(*read.keys(True, True)), read)
        lengths.append(len(read))
        assert demonstration.info.steps == len(kept)
        assert demonstration.info.success == bool(kept["next", "success"][-1])
        assert demonstration.info.reward == pytest.approx(float(kept["next", "reward"].sum()))
    assert len(set(lengths)) > 1


def test_a_replay_filled_from_the_file_gives_the_batches_of_one_filled_in_memory(tmp_path):
    cfg = train_cfg()
    cfg = replace(cfg, demonstrations=replace(cfg.demonstrations, file=str(tmp_path / "demos.h5"), transitions_n=20))
    record(tmp_path / "demos.h5", range(15))
    from_file, from_memory = (ReplayBuffer(20, STACK_N, 2.25) for _ in range(2))
    load_demonstrations(cfg, from_file)
    for seed in range(15):
        if left := 20 - len(from_memory):
            from_memory.extend(in_memory(seed)[:left])
    assert len(from_file) == len(from_memory) == 20
    empty = ReplayBuffer(1, STACK_N)
    octree = env_spec(cfg.env).octree
    batches = [BatchSampler(cfg, octree, buffer, empty).demonstrations() for buffer in (from_file, from_memory)]
    assert_same(*batches)


def test_each_observation_is_stored_once_and_stacks_have_any_length(tmp_path):
    demonstration = record(tmp_path / "demos.h5")[0]
    steps = demonstration.info.steps
    assert demonstration.arrays["codes"].shape[:1] == (steps + 1,)
    chunk = demonstration.chunk(4)
    # Worked by hand: step 2 has seen observations 0, 0, 1, 2.
    expected = torch.from_numpy(demonstration.arrays["proprio"][[0, 0, 1, 2]])
    assert torch.equal(chunk["proprio"][2], expected)
    assert torch.equal(chunk["octree"].codes[0, 0], chunk["octree"].codes[0, 3])


def test_the_file_does_not_depend_on_interruptions(tmp_path):
    class Stop(Exception):
        pass

    def stop_after_two(info):
        if info.seed == 1:
            raise Stop

    whole = record(tmp_path / "whole.h5", range(5))
    with pytest.raises(Stop):
        record(tmp_path / "parts.h5", range(5), on_episode=stop_after_two)
    assert len(DemonstrationFile(tmp_path / "parts.h5")) == 2
    seen = []
    parts = record(tmp_path / "parts.h5", range(5), on_episode=lambda info: seen.append(info.seed))
    assert seen == [2, 3, 4]
    assert parts.episodes == whole.episodes
    for one, other in zip(parts, whole, strict=True):
        for name, array in other.arrays.items():
            np.testing.assert_array_equal(one.arrays[name], array)


def test_every_episode_knows_where_it_comes_from(tmp_path):
    file = record(tmp_path / "demos.h5", [7, 3])
    assert [episode.seed for episode in file.episodes] == [7, 3]
    assert {episode.commit for episode in file.episodes} == {"abc"}
    assert file.recording == recording()
    assert file.versions == {"torch": "2"}
    assert file.transitions_n == sum(len(demonstration.chunk(1)) for demonstration in file)


def test_a_file_goes_on_only_with_the_settings_it_began_with(tmp_path):
    record(tmp_path / "demos.h5", [0])
    with pytest.raises(DemonstrationError, match=r"noise_scale \[0.3, 0.6\], not \[\]; name another file"):
        record(tmp_path / "demos.h5", [1], recording(noise_scale=()))
    assert len(DemonstrationFile(tmp_path / "demos.h5")) == 1


def test_a_run_refuses_demonstrations_of_another_world(tmp_path):
    record(tmp_path / "demos.h5", [0])
    cfg = train_cfg()
    cfg = replace(
        cfg,
        env=replace(cfg.env, robot="ur5_rg2"),
        demonstrations=replace(cfg.demonstrations, file=str(tmp_path / "demos.h5")),
    )
    with pytest.raises(DemonstrationError, match=r"env.robot panda, not ur5_rg2; record anew"):
        load_demonstrations(cfg, ReplayBuffer(10, STACK_N))


def write_text(path: Path) -> None:
    path.write_text("no HDF5 at all")


def truncate(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-500])


def flip_a_byte_of_an_octree(path: Path) -> None:
    with h5py.File(path) as file:
        dataset = file["episodes/000000/features"]
        where = dataset.id.get_chunk_info(0).byte_offset
    content = bytearray(path.read_bytes())
    content[where + 20] ^= 0xFF
    path.write_bytes(content)


def drop_an_array(path: Path) -> None:
    with h5py.File(path, "r+") as file:
        del file["episodes/000000/action"]


def shorten_an_array(path: Path) -> None:
    with h5py.File(path, "r+") as file:
        rewards = file["episodes/000000/reward"][1:]
        del file["episodes/000000/reward"]
        file["episodes/000000/reward"] = rewards


def make_foreign(path: Path) -> None:
    with h5py.File(path, "w") as file:
        file["traj_0/actions"] = np.zeros((3, 4))


def make_newer(path: Path) -> None:
    with h5py.File(path, "r+") as file:
        file.attrs["version"] = 99


def add_a_setting(path: Path) -> None:
    with h5py.File(path, "r+") as file:
        file.attrs["recording"] = json.dumps({"gravity_on_mars": True})


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (Path.unlink, "there are no demonstrations at"),
        (write_text, "is damaged or no HDF5 file"),
        (truncate, "is damaged or no HDF5 file"),
        (flip_a_byte_of_an_octree, "is damaged or no HDF5 file"),
        (drop_an_array, "is damaged or no HDF5 file"),
        (shorten_an_array, "is damaged: episode 0 has not"),
        (make_foreign, "holds no demonstrations of this package"),
        (make_newer, "has version 99 of its format, this package reads version 1"),
        (add_a_setting, "has settings that this release does not know: .*gravity_on_mars"),
    ],
)
def test_a_damaged_or_foreign_file_is_refused_in_one_sentence(tmp_path, damage, message):
    path = tmp_path / "demos.h5"
    record(path, [0, 1])
    damage(path)
    with pytest.raises(DemonstrationError, match=message) as refusal:
        list(DemonstrationFile(path))
    assert "\n" not in str(refusal.value)


def test_nothing_is_appended_to_a_damaged_file(tmp_path):
    path = tmp_path / "demos.h5"
    write_text(path)
    with pytest.raises(DemonstrationError):
        append_demonstrations(path, recording(), [], {})
    assert path.read_text() == "no HDF5 at all"


def test_a_run_starts_from_a_file_without_recording_and_resumes(tmp_path):
    record(tmp_path / "demos.h5", range(20))
    cfg = train_cfg(env_steps=40)
    cfg = replace(cfg, demonstrations=replace(cfg.demonstrations, file=str(tmp_path / "demos.h5"), transitions_n=30))
    lines = []

    def train(cfg, **kwargs):
        folder = RunFolder(tmp_path / "run")
        spec = env_spec(cfg.env)
        return Trainer(cfg, folder, make_env=make_env, env_spec=spec, report=lines.append).run(**kwargs)

    assert train(cfg).env_steps == 40
    assert any(line.startswith("30 demonstrations of the ") for line in lines)
    assert not any(line.startswith("recording") for line in lines)
    (tmp_path / "demos.h5").unlink()  # the checkpoint has what it needs
    assert train(replace(cfg, trainer=replace(cfg.trainer, env_steps=80)), resume=True).env_steps == 80


def refuse(cfg, seed):
    raise ConfigError("no such robot")


def test_several_processes_write_the_same_file_and_tell_mistakes_in_their_own_words(tmp_path):
    one, two = record(tmp_path / "one.h5"), record(tmp_path / "two.h5", workers=2)
    assert one.episodes == two.episodes
    for mine, theirs in zip(one, two, strict=True):
        assert_same(mine.chunk(STACK_N), theirs.chunk(STACK_N))
    with pytest.raises(ConfigError, match=r"^no such robot$"):
        record_demonstrations(tmp_path / "no.h5", recording(), [0, 1], ORIGIN, make_env=refuse, workers=2)
    assert not (tmp_path / "no.h5").exists()
