"""What each network learns, step by step: its batches, its loss, and the error it is judged by."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable
from typing import Any

import torch
from torch import Generator, Tensor, nn

from tr_grasp.errors import PredictionError, unknown_name
from tr_grasp.prediction.datasets import (
    THESIS_AHEAD_S,
    THESIS_MOTIONS,
    THESIS_TRAJECTORIES_N,
    Corrections,
    Windows,
    WindowTable,
    corrections,
    thesis_tracks,
)
from tr_grasp.prediction.hybrid import FINEST_M, features_n
from tr_grasp.prediction.networks import MotionLSTM, MotionMLP, ResidualNet
from tr_grasp.prediction.scores import PROBABLE_95

BATCH_N = 1000
SEQUENCE_N = 85
"""Windows of the shortest trajectory of the thesis' data; longer ones are cut into pieces of this length."""
VALIDATION_N = 60
"""Tracks of the thesis' data that are left out, or a tenth if that is less."""
TRACKS_N = 2500
"""Tracks of the hybrid's data."""
Progress = Callable[[Iterable[Any], int], Iterable[Any]]
"""Shows how far one is in an iterable of that many."""


class Course(ABC):
    """One network, its data and its loss."""

    kind: str
    epochs_n = 200
    """By default."""
    decay = 1.0
    """Of the learning rate from epoch to epoch, by default."""
    settling_n = 0
    """Last epochs without dropout, by default."""
    steps_n: int
    """Steps an epoch."""
    network: nn.Module

    @abstractmethod
    def loss(self, generator: Generator) -> Tensor:
        """Of a random batch, with gradient."""

    @abstractmethod
    def validate(self) -> float:
        """On data that is not learned from."""

    @abstractmethod
    def settings(self) -> dict[str, Any]:
        """What a predictor has to know beside the weights."""


class MLPCourse(Course):
    """The thesis' perceptron on one class of motion: mean squared error, 100 steps of 1000 windows an epoch."""

    kind, steps_n, settling_n = "mlp", 100, 10
    sequences_n, sequence_n = BATCH_N, 1
    """Random pieces of tracks in a batch, and windows in each."""

    def __init__(self, motion: str, seed: int, trajectories_n: int = THESIS_TRAJECTORIES_N) -> None:
        tracks = [Windows.of(track) for track in thesis_tracks(motion, trajectories_n, Generator().manual_seed(seed))]
        border = left_out(trajectories_n)
        self.network: nn.Module = self._network()
        self._train, self._validation = WindowTable(tracks[border:]), tracks[:border]

    def loss(self, generator: Generator) -> Tensor:
        """Of random pieces."""
        inputs, targets = self._train.pieces(self.sequences_n, self.sequence_n, generator)
        return nn.functional.mse_loss(self.outputs(inputs), targets)

    def validate(self) -> float:
        """Mean squared error [m²], every track left out counting alike, as in the thesis' batches."""
        return float(torch.tensor(self._squares()).mean())

    def settings(self) -> dict[str, Any]:
        """Times of the outputs and their errors."""
        return {"ahead_s": THESIS_AHEAD_S, "sigma_m": torch.tensor(self._squares()).sqrt().tolist()}

    def outputs(self, inputs: Tensor) -> Tensor:
        """Outputs (tracks, steps, 2, 3) on windows (tracks, steps, 5, 3)."""
        return self.network(inputs)

    def _network(self) -> nn.Module:
        return MotionMLP()

    @torch.no_grad()
    def _squares(self) -> list[float]:
        """Mean square of both outputs."""
        by_length: dict[int, list[Windows]] = {}
        for track in self._validation:
            by_length.setdefault(len(track.inputs), []).append(track)
        errors = [self.outputs(stacked(tracks, "inputs")) - stacked(tracks, "targets") for tracks in by_length.values()]
        return torch.cat([each.square().mean((1, 3)) for each in errors]).mean(0).tolist()


class LSTMCourse(MLPCourse):
    """The thesis' LSTM: as many steps and windows an epoch as the perceptron, a step being 12 sequences of 85 windows.

    The peer's code takes 10 steps of 1000 such sequences. That costs eight times as much for a tenth of the steps.
    """

    kind = "lstm"
    sequences_n, sequence_n = round(BATCH_N / SEQUENCE_N), SEQUENCE_N

    def outputs(self, inputs: Tensor) -> Tensor:
        """Outputs (tracks, steps, 2, 3) on windows (tracks, steps, 5, 3), the memory empty at the start of a track."""
        return self.network(inputs)[0]

    def _network(self) -> nn.Module:
        return MotionLSTM()


class HybridCourse(Course):
    """The correction of the filter bank: likelihood of the truth, its distance, and the logarithm of that."""

    kind, steps_n, epochs_n, decay = "hybrid", 50, 120, 0.98

    def __init__(self, motion: str, seed: int, tracks_n: int = TRACKS_N, progress: Progress | None = None) -> None:
        tracks: Iterable[Corrections] = corrections(tracks_n, seed)
        data = list(progress(tracks, tracks_n) if progress else tracks)
        border = max(1, len(data) // 10)
        self._train, self._validation = joined(data[border:]), joined(data[:border])
        network, features = ResidualNet(features_n()), self._train.features
        network.mean.copy_(features.mean(0))
        network.scale.copy_(features.std(0).clamp(min=1e-3))
        self.network = network

    def loss(self, generator: Generator) -> Tensor:
        """Of 1000 situations."""
        rows = torch.randint(len(self._train.features), (BATCH_N,), generator=generator)
        return self._loss(picked(self._train, rows))

    @torch.no_grad()
    def validate(self) -> float:
        """The same loss on tracks left out."""
        return float(self._loss(self._validation))

    @torch.no_grad()
    def settings(self) -> dict[str, Any]:
        """By how much the deviations have to grow for 95 % of the truth to be within the 95 % ellipsoid.

        Errors have longer tails than a normal distribution, since nobody foresees the start of a turn; so the ellipsoid
        that a chance constraint uses is made right, and the 68 % ellipsoid holds more than 68 %.
        """
        _, normal, _ = self._judged(self._validation)
        return {"inflation": float((normal.square().sum(-1).quantile(0.95) / PROBABLE_95).sqrt())}

    def _loss(self, data: Corrections) -> Tensor:
        mean, normal, deviation = self._judged(data)
        # A target that surprises everybody is no reason to forget all others, so far tails count linearly.
        tails = nn.functional.huber_loss(normal, torch.zeros_like(normal), delta=4.0, reduction="none")
        far = nn.functional.smooth_l1_loss(mean, data.truth, beta=0.01)
        # Where the filters are right, a tenth of a millimetre is much; where nobody is, ten are little.
        near = ((data.truth - mean).norm(dim=-1) + 2 * FINEST_M).log()
        return (tails + deviation.log()).mean() + 20.0 * far + near.mean()

    def _judged(self, data: Corrections) -> tuple[Tensor, Tensor, Tensor]:
        """Means, errors in units of their deviations, and those deviations, each (n, 3)."""
        gate, residual, spread = self.network(data.features)
        scale = data.scale.unsqueeze(-1)
        mean, deviation = (gate.unsqueeze(-1) * data.candidates).sum(1) + scale * residual, scale * spread.exp()
        return mean, (data.truth - mean) / deviation, deviation


def stacked(tracks: list[Windows], name: str) -> Tensor:
    """Inputs or targets of tracks of one length (tracks, steps, ...)."""
    return torch.stack([getattr(track, name) for track in tracks])


def left_out(tracks_n: int) -> int:
    """How many of so many tracks validate."""
    return min(VALIDATION_N, max(1, tracks_n // 10))


def joined(data: list[Corrections]) -> Corrections:
    """All situations of many tracks."""
    return Corrections(*(torch.cat([getattr(each, name) for each in data]) for name in _FIELDS))


def picked(data: Corrections, rows: Tensor) -> Corrections:
    """Some situations."""
    return Corrections(*(getattr(data, name)[rows] for name in _FIELDS))


_FIELDS = ("features", "candidates", "scale", "truth")

COURSES: dict[str, tuple[type[MLPCourse] | type[HybridCourse], str]] = {
    **{f"mlp_{motion}": (MLPCourse, motion) for motion in THESIS_MOTIONS},
    **{f"lstm_{motion}": (LSTMCourse, motion) for motion in THESIS_MOTIONS},
    "hybrid": (HybridCourse, "all"),
}
"""What can be trained: a course and its motion, under the name of the weights."""


def make_course(name: str, seed: int, tracks_n: int | None = None, progress: Progress | None = None) -> Course:
    """The course of that name in :data:`COURSES`.

    Args:
        name: Of the weights.
        seed: Decides data and the first weights.
        tracks_n: How many trajectories; 2000 as in the thesis, 2500 for the hybrid.
        progress: Shows how far the hybrid's data is, which takes minutes.

    Raises:
        PredictionError: No such course, or fewer than ten trajectories.
    """
    if name not in COURSES:
        raise PredictionError(unknown_name("network", name, COURSES))
    if tracks_n is not None and tracks_n < 10:
        raise PredictionError(f"at least 10 tracks are needed to train and to validate, got {tracks_n}.")
    course, motion = COURSES[name]
    torch.manual_seed(seed)
    if issubclass(course, HybridCourse):
        return course(motion, seed, tracks_n or TRACKS_N, progress)
    return course(motion, seed, tracks_n or THESIS_TRAJECTORIES_N)
