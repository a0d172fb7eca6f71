from __future__ import annotations

import csv

import pytest

from tests.toy_env import train_cfg
from tr_grasp.configs.io import load_train_cfg
from tr_grasp.errors import StorageError
from tr_grasp.trainers import RunFolder


def rows_of(folder: RunFolder) -> list[dict[str, str]]:
    with (folder.path / "progress.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def test_columns_that_come_later_are_added(tmp_path):
    folder = RunFolder(tmp_path / "a" / "run")
    folder.open(train_cfg())
    folder.log({"env_steps": 10, "wall_s": 1.5})
    folder.log({"env_steps": 20, "wall_s": 2.5, "evaluation/success": 0.5})
    folder.close()
    assert rows_of(folder) == [
        {"env_steps": "10", "wall_s": "1.5", "evaluation/success": ""},
        {"env_steps": "20", "wall_s": "2.5", "evaluation/success": "0.5"},
    ]
    assert load_train_cfg(folder.path) == train_cfg()


def test_a_resumed_run_drops_what_was_logged_after_its_checkpoint(tmp_path):
    folder = RunFolder(tmp_path)
    folder.open(train_cfg())
    folder.log({"env_steps": 10})
    folder.log({"env_steps": 20})
    folder.close()
    again = RunFolder(tmp_path)
    again.open(train_cfg(), rows=[{"env_steps": 10}], env_steps=10)
    again.close()
    assert [row["env_steps"] for row in rows_of(again)] == ["10"]


def test_a_run_folder_that_is_a_file_is_a_storage_error(tmp_path):
    (tmp_path / "run").write_text("")
    with pytest.raises(StorageError, match="could not make the run folder"):
        RunFolder(tmp_path / "run").open(train_cfg())
