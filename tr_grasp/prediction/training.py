"""Training of a predictor's network: Adam, best epoch kept, ends early when none is better, goes on exactly."""

from __future__ import annotations

import io
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import torch

from tr_grasp.errors import CheckpointError, PredictionError, TrainingDivergedError
from tr_grasp.files import make_folder, write_atomically
from tr_grasp.prediction.courses import Course
from tr_grasp.prediction.weights import save_weights

CHECKPOINT_FILE = "checkpoint.pt"


@dataclass(frozen=True)
class LearnCfg:
    """How a network is trained."""

    epochs_n: int
    """Passes; the thesis makes 200."""
    seed: int = 0
    """Of batches, data and first weights."""
    learning_rate: float = 1e-3
    """Of Adam, in the first epoch."""
    decay: float = 1.0
    """Factor on it from epoch to epoch."""
    patience_n: int = 40
    """The training ends early if the best epoch is this long ago."""
    settling_n: int = 0
    """Epochs after that without dropout, which the thesis does not have."""
    checkpoint_every_n: int = 10
    """Epochs between two checkpoints."""


@dataclass(frozen=True)
class Epoch:
    """What an epoch came to."""

    epoch: int
    """From 1 on."""
    loss: float
    """Mean of its steps."""
    validation: float
    """On the tracks left out."""
    wall_s: float
    """Since the training began, pauses left out."""
    settling: bool = False
    """Whether dropout was off."""


def learn(
    name: str,
    course: Course,
    cfg: LearnCfg,
    folder: Path,
    *,
    provenance: Mapping[str, Any],
    resume: bool = False,
    report: Callable[[Epoch], None] = lambda epoch: None,
) -> Path:
    """Train, and write the weights of the best epoch with their record.

    Args:
        name: Of the weights.
        course: What is learned.
        cfg: How.
        folder: For the checkpoint, ``NAME.safetensors`` and ``NAME.json``.
        provenance: Goes into the record.
        resume: Go on from the checkpoint in ``folder``; the result is that of a training that never stopped.
        report: Called after every epoch.

    Returns:
        The file of the weights.

    Raises:
        PredictionError: No epochs, fewer than none to settle, or a folder that holds a training already.
        CheckpointError: Nothing to resume, or the checkpoint of another training.
        TrainingDivergedError: The loss stopped being finite.
        StorageError: Something could not be written.
    """
    if cfg.epochs_n < 1 or cfg.settling_n < 0:
        raise PredictionError(
            f"epochs must be at least 1 and those that settle 0, got {cfg.epochs_n}, {cfg.settling_n}."
        )
    make_folder(folder)
    checkpoint = folder / CHECKPOINT_FILE
    run = _Run(name, course, cfg)
    if resume:
        run.load(checkpoint)
    elif checkpoint.exists():
        raise PredictionError(f"'{folder}' holds a training already; resume it or choose another folder.")
    try:
        while not run.is_over:
            report(run.epoch())
            if len(run.curve) % cfg.checkpoint_every_n == 0 or run.is_over:
                run.save(checkpoint)
    except KeyboardInterrupt:
        # The epoch that was cut short starts over.
        run.save(checkpoint)
        raise
    course.network.load_state_dict(run.best)
    course.network.eval()
    path = folder / f"{name}.safetensors"
    record = {**provenance, "settings": asdict(cfg), "best": asdict(run.best_epoch), "curve": run.curve_rows()}
    save_weights(path, course.kind, run.best, course.settings(), record)
    return path


class _Run:
    """A training at the end of some epoch."""

    def __init__(self, name: str, course: Course, cfg: LearnCfg) -> None:
        self.name, self.course, self.cfg = name, course, cfg
        self.optimiser = torch.optim.Adam(course.network.parameters(), cfg.learning_rate)
        self.curve: list[Epoch] = []
        self.best = self._weights()
        self._generator = torch.Generator()

    @property
    def best_epoch(self) -> Epoch:
        """The one with the smallest validation error."""
        return _best(self.curve)

    @property
    def is_settling(self) -> bool:
        """Whether it made all its epochs with dropout, or too many without a better one."""
        learned = [epoch for epoch in self.curve if not epoch.settling]
        return len(learned) >= self.cfg.epochs_n or (
            len(learned) > 0 and len(learned) - _best(learned).epoch >= self.cfg.patience_n
        )

    @property
    def is_over(self) -> bool:
        """Whether it has settled, too."""
        return self.is_settling and sum(epoch.settling for epoch in self.curve) >= self.cfg.settling_n

    def epoch(self) -> Epoch:
        """Another one."""
        number, network = len(self.curve) + 1, self.course.network
        # Batches and dropout of an epoch depend on its number alone, so that a resumed training repeats nothing else.
        self._generator.manual_seed(1_000_003 * self.cfg.seed + number)
        torch.manual_seed(1_000_003 * self.cfg.seed + number)
        for group in self.optimiser.param_groups:
            group["lr"] = self.cfg.learning_rate * self.cfg.decay ** (number - 1)
        before, started, settling = self._state(), time.perf_counter(), self.is_settling
        try:
            loss = self._steps(network.train(not settling))
        except KeyboardInterrupt:
            self._restore(before)
            raise
        validation = self._validate(network.eval())
        wall_s = (self.curve[-1].wall_s if self.curve else 0.0) + time.perf_counter() - started
        self.curve.append(Epoch(number, loss, validation, wall_s, settling))
        if self.best_epoch.epoch == number:
            self.best = self._weights()
        return self.curve[-1]

    def save(self, path: Path) -> None:
        """Write everything that the next epoch depends on."""
        content = {
            "name": self.name,
            "seed": self.cfg.seed,
            "learning_rate": self.cfg.learning_rate,
            "decay": self.cfg.decay,
            "curve": self.curve_rows(),
            "best": self.best,
            **self._state(),
        }
        stream = io.BytesIO()
        torch.save(content, stream)
        write_atomically(path, stream.getvalue())

    def load(self, path: Path) -> None:
        """Go on from there."""
        if not path.is_file():
            raise CheckpointError(f"there is no training to resume in '{path.parent}': {path.name} is missing.")
        try:
            content = torch.load(path, weights_only=True)
            mine = (self.name, self.cfg.seed, self.cfg.learning_rate, self.cfg.decay)
            theirs = tuple(content[key] for key in ("name", "seed", "learning_rate", "decay"))
            self._restore(content)
            self.best, self.curve = content["best"], [Epoch(**row) for row in content["curve"]]
        except Exception as error:
            raise CheckpointError(f"'{path}' is no checkpoint of such a training, or damaged: {error}.") from error
        if mine != theirs:
            raise CheckpointError(
                f"'{path}' is of the training {theirs} (name, seed, learning rate, decay), not {mine}."
            )

    def curve_rows(self) -> list[dict[str, float]]:
        """The curve for a file."""
        return [asdict(epoch) for epoch in self.curve]

    def _steps(self, network: torch.nn.Module) -> float:
        total = 0.0
        for _ in range(self.course.steps_n):
            loss = self.course.loss(self._generator)
            self.optimiser.zero_grad()
            loss.backward()
            self.optimiser.step()
            total += float(loss.detach())
        return self._finite(total / self.course.steps_n)

    def _validate(self, network: torch.nn.Module) -> float:
        return self._finite(self.course.validate())

    def _finite(self, loss: float) -> float:
        if loss != loss or abs(loss) == float("inf"):
            raise TrainingDivergedError(f"the loss of {self.name!r} is not finite in epoch {len(self.curve) + 1}.")
        return loss

    def _weights(self) -> dict[str, torch.Tensor]:
        return {name: tensor.detach().clone() for name, tensor in self.course.network.state_dict().items()}

    def _state(self) -> dict[str, Any]:
        stream = io.BytesIO()
        torch.save(self.optimiser.state_dict(), stream)
        return {"weights": self._weights(), "optimiser": stream.getvalue()}

    def _restore(self, state: Mapping[str, Any]) -> None:
        self.course.network.load_state_dict(state["weights"])
        self.optimiser.load_state_dict(torch.load(io.BytesIO(state["optimiser"]), weights_only=True))


def _best(curve: Sequence[Epoch]) -> Epoch:
    return min(curve, key=lambda epoch: epoch.validation)
