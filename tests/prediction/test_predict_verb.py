"""Tracks, scores, and ``tr-grasp predict``."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
import torch

import tr_grasp.cli as cli
from tr_grasp.errors import PredictionError
from tr_grasp.prediction import ConstantVelocityPredictor, GateCfg, HoldPredictor
from tr_grasp.prediction.scores import score, thesis_loss
from tr_grasp.prediction.tracks import SensorCfg, generated_tracks, read_track


def written(folder: Path, rows: list[str], head: str = "t,x,y,z") -> Path:
    path = folder / "belt.csv"
    path.write_text("\n".join([head, *rows]) + "\n")
    return path


def line_csv(folder: Path) -> Path:
    return written(folder, [f"{0.2 * i:.3f},{0.01 * i:.4f},0.5,0.1,{0.02 * i:.3f}" for i in range(40)], "t,x,y,z,yaw")


def test_holding_a_line_errs_by_speed_times_horizon() -> None:
    (track,) = generated_tracks("linear", 1, speed_m_s=0.03, seed=0)
    found = score(HoldPredictor(), track, (0.5, 1.0, 2.0))
    assert found.mean_mm == pytest.approx([15.0, 30.0, 60.0])
    # A line of 33.3 s measured at 5 Hz, judged from 1 s to 2 s before its end.
    assert len(found.errors_m) == 152
    assert len(found.update_us) == 167


def test_the_covariance_of_the_right_model_is_honest() -> None:
    tracks = generated_tracks("linear", 12, speed_m_s=0.03, seed=0, sensor=SensorCfg(noise_m=1e-3))
    cfg = ConstantVelocityPredictor().cfg.__class__(density=1e-14)
    found = [score(ConstantVelocityPredictor(cfg), track, (1.0,), warm_up_s=30.0) for track in tracks]
    distances = np.concatenate([each.distances for each in found])
    assert distances.mean() == pytest.approx(3.0, rel=0.5)


def test_sensors_lose_and_disturb_what_they_measure() -> None:
    sensor = SensorCfg(rate_hz=10, noise_m=2e-3, lost_share=0.3)
    (track,) = generated_tracks("circular", 1, speed_m_s=0.03, seed=1, sensor=sensor)
    assert 0.6 < len(track.times) / 333 < 0.8
    assert (track.positions - track.truth(track.times)[0]).std() == pytest.approx(2e-3, rel=0.15)
    with pytest.raises(PredictionError, match="a sensor needs"):
        generated_tracks("circular", 1, speed_m_s=0.03, seed=1, sensor=SensorCfg(rate_hz=0))


def test_the_thesis_loss_of_holding_is_the_mean_square_of_the_way() -> None:
    # Speeds of 1, 3 or 5 cm/s; 1.2 and 2.2 s ahead; a third of the square for each axis.
    losses = {seed: thesis_loss(HoldPredictor, "linear", 1, seed) for seed in range(3)}
    possible = [(1.2**2 + 2.2**2) / 2 * v**2 / 3 for v in (0.01, 0.03, 0.05)]
    assert all(min(abs(loss / value - 1) for value in possible) < 1e-6 for loss in losses.values())


def test_every_track_counts_alike_in_the_thesis_loss(monkeypatch: pytest.MonkeyPatch) -> None:
    # A long track that stands still, and a short one at 1 m a step along x.
    tracks = [torch.zeros(100, 3).double(), torch.arange(20.0)[:, None].double() * torch.tensor([1.0, 0, 0])]
    monkeypatch.setattr("tr_grasp.prediction.scores.thesis_tracks", lambda *given: tracks)
    gate = GateCfg(top_speed_m_s=100.0)
    loss = thesis_loss(lambda: HoldPredictor(gate=gate), "linear", 2, 0)
    # Six and eleven steps ahead, on one of three axes.
    assert loss == pytest.approx(0.5 * (6**2 + 11**2) / 2 / 3)
    # Nothing before the fourth window counts once the first three are warm-up.
    tracks[1][:7] = 0.0
    jump = thesis_loss(lambda: HoldPredictor(gate=gate), "linear", 2, 0)
    assert jump != loss
    assert thesis_loss(lambda: HoldPredictor(gate=gate), "linear", 2, 0, warm_up_s=1.4) == pytest.approx(loss)


def test_a_track_is_read_from_a_file(tmp_path: Path) -> None:
    track = read_track(line_csv(tmp_path))
    assert track.label == "belt"
    assert track.positions.shape == (40, 3)
    positions, yaws = track.truth(np.array([0.1]))
    assert positions[0] == pytest.approx([0.005, 0.5, 0.1])
    assert yaws == pytest.approx([0.01])


def test_a_track_from_a_spreadsheet_is_read_too(tmp_path: Path) -> None:
    path = line_csv(tmp_path)
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes().replace(b"\n", b"\r\n").replace(b"t,x,y", b"t, x, y"))
    assert read_track(path).positions.shape == (40, 3)


@pytest.mark.parametrize(
    ("rows", "head", "sentence"),
    [
        (["0,0,0"] * 12, "t,x,y", "lacks z: its columns must be"),
        ([f"{i},0,0,0" for i in range(5)], "t,x,y,z", "has 5 rows; at least 10"),
        ([], "", "lacks t, x, y, z: its columns must be"),
        (["0;0;0;0"] * 12, "t;x;y;z", "lacks t, x, y, z: its columns must be"),
        ([f"{i % 7},0,0,0" for i in range(12)], "t,x,y,z", "t must rise from row to row; it does not after 6.0 s"),
        ([f"{min(i, 9)},0,0,0" for i in range(12)], "t,x,y,z", "t must rise from row to row; it does not after 9.0 s"),
        ([f"{i if i != 3 else 'nan'},0,0,0" for i in range(12)], "t,x,y,z", "t in line 5 must be a finite number"),
        ([f"{i},0,left,0" for i in range(12)], "t,x,y,z", "y in line 2 must be a finite number, got 'left'"),
        ([f"{i},0,nan,0" for i in range(12)], "t,x,y,z", "y in line 2 must be a finite number"),
        ([f"{i},0,0" for i in range(12)], "t,x,y,z", "z in line 2 must be a finite number"),
    ],
)
def test_a_broken_track_is_refused(rows: list[str], head: str, sentence: str, tmp_path: Path) -> None:
    with pytest.raises(PredictionError, match=sentence):
        read_track(written(tmp_path, rows, head))


def test_evaluate_prints_a_table_and_draws_a_picture(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    args = ["--predictors", "hold", "kalman", "--motions", "linear", "circular", "--seeds", "5", "--tracks", "1"]
    assert cli.main(["predict", "evaluate", *args]) == 0
    printed = capsys.readouterr().out
    assert "15.0 / 30.0 / 60.0" in printed
    assert (tmp_path / "runs/predict/evaluate/prediction.png").read_bytes().startswith(b"\x89PNG")
    with (tmp_path / "runs/predict/evaluate/scores.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 2 * 2 * 3
    assert float(rows[0]["mean_mm"]) == pytest.approx(15.0)


def test_evaluate_prints_the_loss_of_the_thesis(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    args = ["--thesis-loss", "True", "--predictors", "hold", "constant_velocity", "--seeds", "1", "--tracks", "1"]
    assert cli.main(["predict", "evaluate", *args]) == 0
    rows = [line.split() for line in capsys.readouterr().out.splitlines()]
    losses = {tuple(row[:2]): float(row[2]) for row in rows if row[:1] in (["hold"], ["constant_velocity"])}
    assert len(losses) == 2 * 3
    assert losses["hold", "linear"] > 1e6 * losses["constant_velocity", "linear"]
    assert not (tmp_path / "runs").exists()


def test_evaluate_takes_a_real_track(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    args = ["--track", str(line_csv(tmp_path)), "--predictors", "hold", "constant_velocity", "--horizons", "1"]
    assert cli.main(["predict", "evaluate", *args]) == 0
    assert "belt" in capsys.readouterr().out


def test_train_writes_weights_and_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("tr_grasp.prediction.courses.MLPCourse.steps_n", 2)
    args = ["predict", "train", "mlp_linear", "--tracks", "10", "--epochs"]
    assert cli.main([*args, "1"]) == 0
    assert cli.main([*args, "2"]) == 2
    assert cli.main([*args, "2", "--resume", "True"]) == 0
    assert (tmp_path / "runs/predict/mlp_linear-0/mlp_linear.safetensors").is_file()
    assert "holds a training already" in capsys.readouterr().err
    evaluate = ["predict", "evaluate", "--predictors", "mlp", "--track", str(line_csv(tmp_path)), "--horizons", "1"]
    assert cli.main(evaluate) == 0
    shipped = capsys.readouterr().out
    assert cli.main([*evaluate, "--weights", "runs/predict/{name}-0/{name}.safetensors"]) == 0
    assert capsys.readouterr().out != shipped
    assert cli.main([*evaluate, "--weights", "runs/predict/{name}-7/{name}.safetensors"]) == 2
    assert "no weights at 'runs/predict/mlp_linear-7/mlp_linear.safetensors'" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("args", "sentence"),
    [
        (["trane"], "unknown thing to do with predictors 'trane'; did you mean 'train'?"),
        (["train", "hibrid"], "unknown network 'hibrid'; did you mean 'hybrid'?"),
        (["evaluate", "--predictors", "kallman"], "unknown predictor 'kallman'"),
        (["evaluate", "--motions", "linaer"], "unknown motion 'linaer'"),
        (["evaluate", "--track", "none.csv"], "the track 'none.csv' cannot be read"),
    ],
)
def test_a_mistake_is_one_sentence(
    args: list[str], sentence: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert cli.main(["predict", *args]) == 2
    assert sentence in capsys.readouterr().err
