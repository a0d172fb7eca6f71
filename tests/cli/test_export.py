"""``tr-grasp export``."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch

import tr_grasp.cli as cli
from tests.toy_env import env_spec, train_cfg
from tr_grasp.modules import build_agent, save_policy


def test_a_saved_policy_becomes_a_file_and_a_summary(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    cfg = train_cfg()
    torch.manual_seed(0)
    save_policy(tmp_path / "mine", build_agent(cfg, env_spec(cfg.env)), cfg, {})
    monkeypatch.chdir(tmp_path)
    assert cli.main(["export", "mine", "--format", "torch", "--observations", "3"]) == 0
    file, *inputs, output, parity, speed = capsys.readouterr().out.splitlines()
    assert file.startswith("file    runs/export/mine.pt2, ")
    assert inputs[0] == "input   codes int16 (batch, 2, 32)"
    assert output == "output  action float32 (batch, 5)"
    assert parity.endswith("on 3 observations")
    assert speed.startswith("speed   ")
    module = torch.export.load(tmp_path / "runs/export/mine.pt2").module()
    codes, features = torch.full((1, 2, 32), -1, dtype=torch.int16), torch.zeros(1, 2, 32, 7, dtype=torch.float16)
    assert module(codes, features, torch.zeros(1, 2, 10)).shape == (1, 5)


@pytest.mark.parametrize(
    ("args", "sentence"),
    [
        (["pandda"], "unknown policy 'pandda'; did you mean 'panda'?"),
        (["panda", "--format", "tflite"], "--format: must be one of 'onnx', 'torch', got 'tflite'"),
        (["panda", "--observations", "0"], "observations must be at least 1, got 0"),
        (["panda", "--out", "."], "could not write '.': it is a folder"),
    ],
)
def test_a_mistake_is_one_sentence(
    args: list[str],
    sentence: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert cli.main(["export", *args]) == 2
    error = capsys.readouterr().err
    assert sentence in error
    assert error.count("\n") == 1
