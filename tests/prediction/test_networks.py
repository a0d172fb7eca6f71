"""Shapes, windows and weights of the learned predictors; their training in small."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors import safe_open
from safetensors.torch import save_file

from tests.prediction.test_predictors import SETTINGS, saved
from tr_grasp.errors import CheckpointError, PredictionError
from tr_grasp.prediction import HybridPredictor, LSTMPredictor, MLPPredictor
from tr_grasp.prediction.courses import Course, make_course
from tr_grasp.prediction.datasets import Windows, WindowTable, thesis_tracks
from tr_grasp.prediction.networks import MotionLSTM, MotionMLP
from tr_grasp.prediction.training import LearnCfg, learn
from tr_grasp.prediction.weights import load_weights, save_weights, shipped_weights
from tr_grasp.prediction.window import Window, even_times


def parameters_n(module: torch.nn.Module) -> int:
    return sum(each.numel() for each in module.parameters())


def test_the_networks_are_those_of_the_thesis() -> None:
    assert parameters_n(MotionMLP()) == 15 * 100 + 100 + 100 * 100 + 100 + 100 * 6 + 6
    gates = 4 * (15 * 100 + 100 * 100 + 2 * 100)
    assert parameters_n(MotionLSTM()) == gates + 2 * (100 * 100 + 100) + 100 * 6 + 6
    assert MotionMLP()(torch.zeros(7, 4, 5, 3)).shape == (7, 4, 2, 3)
    outputs, memory = MotionLSTM()(torch.zeros(7, 4, 5, 3))
    assert outputs.shape == (7, 4, 2, 3)
    assert memory[0].shape == (1, 7, 100)


def test_windows_are_normalised_to_their_oldest_position() -> None:
    track = torch.arange(20.0)[:, None].expand(20, 3) * torch.tensor([1.0, 10.0, 100.0])
    windows = Windows.of(track)
    # 5 positions and 11 steps to the far output leave 5 windows of 20 positions.
    assert windows.inputs.shape == (5, 5, 3)
    assert torch.equal(windows.inputs[3, :, 0], torch.arange(5.0))
    assert torch.equal(windows.targets[3], torch.tensor([[10.0, 100, 1000], [15.0, 150, 1500]]))


def test_the_shortest_trajectory_of_the_thesis_has_85_windows() -> None:
    tracks = thesis_tracks("sinusoidal", 12, torch.Generator().manual_seed(0))
    assert {len(Windows.of(track).inputs) for track in tracks} <= {85, 152, 485}
    assert min(len(Windows.of(track).inputs) for track in tracks) == 85


def test_pieces_are_windows_in_a_row_and_every_track_is_as_likely() -> None:
    # Tracks at 0, 100 and 1000; the last is ten times as long as the others.
    steps = ((0.0, 25), (100.0, 25), (1000.0, 250))
    tracks = [Windows.of((start + torch.arange(float(n)))[:, None].expand(n, 3)) for start, n in steps]
    for start, track in zip((0.0, 100.0, 1000.0), tracks, strict=True):
        track.targets[:] = (start + torch.arange(float(len(track.inputs))))[:, None, None]
    inputs, numbers = WindowTable(tracks).pieces(3000, 4, torch.Generator().manual_seed(0))
    assert inputs.shape == (3000, 4, 5, 3)
    assert (numbers[:, 1:] - numbers[:, :-1] == 1).all()
    starts = numbers[:, 0, 0, 0]
    for low, last in ((0.0, 6), (100.0, 6), (1000.0, 231)):
        mine = starts[(starts >= low) & (starts < low + 300 - 200 * (low < 100))] - low
        assert len(mine) == pytest.approx(1000, abs=120)
        assert (mine.min(), mine.max()) == (0, pytest.approx(last, abs=2))
        assert mine.max() <= last


def test_a_window_is_even_and_starts_where_the_target_stood() -> None:
    window = Window(1.0)
    for t in (0.0, 0.1, 0.35, 0.5):
        window.add(t, np.array([t, 0.0, 0.0]))
    assert window.at(even_times(0.5, 5, 0.2))[:, 0] == pytest.approx([0.0, 0.0, 0.1, 0.3, 0.5])


def test_a_window_forgets_what_is_older_than_its_span() -> None:
    window = Window(1.0)
    for index in range(1000):
        window.add(0.01 * index, np.zeros(3))
    assert len(window._times) < 105


@pytest.mark.parametrize("kind", ["mlp", "lstm"])
def test_where_the_base_stands_does_not_matter(kind: str, tmp_path: Path) -> None:
    predictor = {"mlp": MLPPredictor, "lstm": LSTMPredictor}[kind](saved(tmp_path, kind))
    found = []
    for offset in (np.zeros(3), np.array([0.4, -0.3, 0.2])):
        predictor.reset()
        for index in range(9):
            predictor.update(0.2 * index, offset + np.array([0.01 * index, 0.002 * index**2, 0.0]))
        found.append(predictor.predict([0.5, 1.2, 2.2, 4.0]).position - offset)
    assert np.allclose(found[0], found[1], atol=1e-6)


def test_the_outputs_of_the_mlp_are_its_predictions_at_1_2_and_2_2_s(tmp_path: Path) -> None:
    predictor = MLPPredictor(saved(tmp_path, "mlp"))
    positions = np.array([[0.01 * i, 0.003 * i**2, 0.1] for i in range(5)])
    for index, position in enumerate(positions):
        predictor.update(0.2 * index, position)
    with torch.no_grad():
        outputs = predictor.network(torch.from_numpy(positions - positions[0]).float()).numpy() + positions[0]
    found = predictor.predict([0.0, 1.2, 2.2])
    assert np.allclose(found.position[1:], outputs, atol=1e-6)
    assert np.allclose(found.position[0], positions[-1], atol=1e-7)
    assert np.sqrt(found.covariance[:, 0, 0]) == pytest.approx([1e-3, 0.01, 0.02])


def test_the_lstm_step_by_step_is_the_lstm_on_all_full_windows(tmp_path: Path) -> None:
    predictor = LSTMPredictor(saved(tmp_path, "lstm"))
    track = torch.stack([0.01 * torch.arange(12.0), 0.002 * torch.arange(12.0) ** 2, torch.zeros(12)], -1).double()
    windows = track.unfold(0, 5, 1).transpose(1, 2)
    with torch.no_grad():
        outputs, _ = predictor.network((windows - windows[:, :1]).float()[None])
    expected = outputs[0].double().numpy() + windows[:, :1].numpy()
    for index, position in enumerate(track.numpy()):
        predictor.update(0.2 * index, position)
        if index >= 4:
            assert np.allclose(predictor.predict([1.2, 2.2]).position, expected[index - 4], atol=1e-6)


def test_an_untrained_hybrid_stays_with_its_filters() -> None:
    hybrid = HybridPredictor(weights=None)
    for index in range(20):
        hybrid.update(0.2 * index, [0.006 * index, 0.003 * index, 0.1])
    mixed, bank = hybrid.predict([1.0]), hybrid.bank._extrapolate(np.array([1.0]))
    assert np.abs(mixed.position - bank.position).max() < 1e-3


def test_the_hybrid_turns_with_the_target() -> None:
    quarter = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    features, positions = [], []
    for R in (np.eye(3), quarter):
        torch.manual_seed(0)
        hybrid = HybridPredictor(weights=None)
        torch.nn.init.normal_(hybrid.network.layers[-1].weight, std=0.1)
        for index in range(15):
            hybrid.update(0.2 * index, R @ np.array([0.02 * index, 0.03 * np.sin(0.3 * index), 0.1]))
        features.append(hybrid.situation(np.array([1.0])).features)
        positions.append(hybrid.predict([1.0]).position[0])
    assert np.allclose(features[0], features[1], atol=1e-6)
    assert np.allclose(quarter @ positions[0], positions[1], atol=1e-6)


def test_weights_come_back_as_they_went(tmp_path: Path) -> None:
    path = saved(tmp_path, "mlp")
    weights, settings = load_weights(path, "mlp")
    assert settings == SETTINGS
    torch.manual_seed(0)
    assert all(torch.equal(weights[name], tensor) for name, tensor in MotionMLP().state_dict().items())


def test_foreign_or_damaged_weights_are_refused(tmp_path: Path) -> None:
    ours, foreign, cut, broken = saved(tmp_path, "mlp"), tmp_path / "f.safetensors", tmp_path / "c", tmp_path / "b"
    save_file(MotionMLP().state_dict(), foreign)
    cut.write_bytes(ours.read_bytes()[:200])
    save_weights(broken, "mlp", {"x": torch.tensor([float("nan")])}, SETTINGS, {})
    for path, sentence in (
        (foreign, "holds no predictor of this package"),
        (cut, "is corrupt"),
        (broken, "not finite"),
        (tmp_path / "none.safetensors", "no weights at"),
    ):
        with pytest.raises(CheckpointError, match=sentence):
            MLPPredictor(path)
    with pytest.raises(CheckpointError, match="for a predictor of kind 'mlp', not 'lstm'"):
        LSTMPredictor(ours)
    save_weights(broken, "mlp", {"x": torch.zeros(1)}, SETTINGS, {})
    with pytest.raises(CheckpointError, match="do not fit the network"):
        MLPPredictor(broken)
    save_weights(broken, "mlp", MotionMLP().state_dict(), {}, {})
    with pytest.raises(CheckpointError, match="do not say what they predict"):
        MLPPredictor(broken)


@pytest.mark.parametrize("name", shipped_weights())
def test_shipped_weights_are_small_and_say_where_they_come_from(name: str) -> None:
    path = Path(load_weights.__code__.co_filename).parent / "weights" / f"{name}.safetensors"
    assert path.stat().st_size < 1e6
    record = json.loads(path.with_suffix(".json").read_text())
    assert {"command", "commit", "settings", "best", "curve"} <= record.keys()
    with safe_open(path, "pt") as file:
        assert json.loads(file.metadata()["record"]) == {key: value for key, value in record.items() if key != "curve"}
    assert record["command"].startswith(f"tr-grasp predict train {name}")
    assert "dirty" not in record["commit"]
    kind = name.split("_")[0]
    load_weights(name, kind)


def small(name: str) -> Course:
    course = make_course(name, seed=0, tracks_n=10)
    course.steps_n = 2
    return course


@pytest.mark.parametrize("name", ["mlp_linear", "lstm_linear"])
def test_a_resumed_training_ends_like_one_that_never_stopped(name: str, tmp_path: Path) -> None:
    whole = learn(name, small(name), LearnCfg(3), tmp_path / "whole", provenance={})
    learn(name, small(name), LearnCfg(2), tmp_path / "parts", provenance={})
    parts = learn(name, small(name), LearnCfg(3), tmp_path / "parts", provenance={}, resume=True)
    kind = name.split("_")[0]
    for one, other in zip(load_weights(whole, kind)[0].values(), load_weights(parts, kind)[0].values(), strict=True):
        assert torch.equal(one, other)
    with pytest.raises(PredictionError, match="holds a training already"):
        learn(name, small(name), LearnCfg(3), tmp_path / "whole", provenance={})
    with pytest.raises(CheckpointError, match="no training to resume"):
        learn(name, small(name), LearnCfg(3), tmp_path / "none", provenance={}, resume=True)
    with pytest.raises(CheckpointError, match="is of the training"):
        learn(name, small(name), LearnCfg(3, seed=9), tmp_path / "whole", provenance={}, resume=True)


def test_the_learning_rate_falls_from_epoch_to_epoch(tmp_path: Path) -> None:
    course, places = small("mlp_linear"), []
    course.steps_n = 1

    def report(*_: object) -> None:
        places.append(torch.nn.utils.parameters_to_vector(course.network.parameters()).detach().clone())

    report()
    learn("mlp_linear", course, LearnCfg(3, decay=0.1), tmp_path, provenance={}, report=report)
    farthest = [float((after - before).abs().max()) for before, after in pairwise(places)]
    # Adam's first step is as long as the learning rate, and no later one much longer.
    assert farthest[0] == pytest.approx(1e-3, rel=1e-3)
    assert farthest[1] < 1.5e-4
    assert farthest[2] < 1.5e-5


def test_a_training_ends_when_no_epoch_is_better_any_more(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    course, epochs = small("mlp_linear"), []
    errors = iter([5.0, 3.0, 4.0, 3.5, 3.0, 1.0])
    monkeypatch.setattr(course, "validate", lambda: next(errors))
    learn("mlp_linear", course, LearnCfg(6, patience_n=3), tmp_path, provenance={}, report=epochs.append)
    # The second was the best; a third that is no better ends it, though the sixth would have been.
    assert [epoch.validation for epoch in epochs] == [5.0, 3.0, 4.0, 3.5, 3.0]


def test_a_training_settles_without_dropout_after_its_epochs_and_the_same_when_resumed(tmp_path: Path) -> None:
    def dropped(folder: str, epochs_n: int, resume: bool = False) -> list[bool]:
        """Whether dropout was on, epoch by epoch."""
        course, on = small("mlp_linear"), []
        draw = course.loss
        course.loss = lambda generator: (on.append(course.network.head[2].training), draw(generator))[1]
        cfg = LearnCfg(epochs_n, patience_n=99, settling_n=2)
        learn("mlp_linear", course, cfg, tmp_path / folder, provenance={}, resume=resume)
        return on[:: course.steps_n]

    assert dropped("whole", 3) == [True, True, True, False, False]
    learn("mlp_linear", small("mlp_linear"), LearnCfg(3), tmp_path / "parts", provenance={})
    assert dropped("parts", 3, resume=True) == [False, False]
    whole, parts = (torch.load(tmp_path / name / "checkpoint.pt", weights_only=True) for name in ("whole", "parts"))
    assert [epoch["settling"] for epoch in whole["curve"]] == [False, False, False, True, True]
    assert all(torch.equal(tensor, parts["weights"][name]) for name, tensor in whole["weights"].items())


@pytest.mark.parametrize(("epochs_n", "settling_n"), [(0, 0), (1, -1)])
def test_a_training_without_epochs_is_refused(epochs_n: int, settling_n: int, tmp_path: Path) -> None:
    with pytest.raises(PredictionError, match=f"got {epochs_n}, {settling_n}"):
        learn("mlp_linear", small("mlp_linear"), LearnCfg(epochs_n, settling_n=settling_n), tmp_path, provenance={})


def test_a_training_that_ends_early_settles_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    course, epochs = small("mlp_linear"), []
    errors = iter([5.0, 3.0, 4.0, 3.5, 9.0, 1.0])
    monkeypatch.setattr(course, "validate", lambda: next(errors))
    learn("mlp_linear", course, LearnCfg(6, patience_n=2, settling_n=2), tmp_path, provenance={}, report=epochs.append)
    assert [epoch.settling for epoch in epochs] == [False] * 4 + [True] * 2


def test_the_hybrid_learns_and_predicts(tmp_path: Path) -> None:
    path = learn("hybrid", small("hybrid"), LearnCfg(2), tmp_path, provenance={"command": "x"})
    hybrid = HybridPredictor(path)
    for index in range(5):
        hybrid.update(0.2 * index, [0.01 * index, 0.0, 0.0])
    assert np.isfinite(hybrid.predict([1.0, 4.0]).position).all()
    assert hybrid.inflation > 0


def test_unknown_networks_are_refused() -> None:
    with pytest.raises(PredictionError, match="unknown network 'hibrid'"):
        make_course("hibrid", 0)
    with pytest.raises(PredictionError, match="at least 10 tracks"):
        make_course("mlp_linear", 0, 3)
