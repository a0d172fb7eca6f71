"""Fit a motion-aware network to tries, and judge it on tries that it has not seen."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from tr_grasp.errors import GraspError
from tr_grasp.grasps.grasp_set import GraspSet
from tr_grasp.grasps.motion_aware.network import NetworkName, QualityNet, inputs
from tr_grasp.grasps.motion_aware.scorer import MotionAwareScorer
from tr_grasp.grasps.motion_aware.tries import MotionTries

Array = NDArray[np.floating]


@dataclass(frozen=True)
class MotionLearnCfg:
    """How the network is trained: Adam on the cross-entropy, as in the thesis."""

    network: NetworkName = "ours"
    """``thesis``: 16-512-512-2 on raw poses and angles. ``ours``: 19-64-64-1."""

    epochs_n: int = 100
    """Passes over the tries."""

    batch_n: int = 64
    """Tries in a step."""

    learning_rate: float = 1e-3
    """Of Adam."""

    weight_decay: float = 1e-3
    """Of Adam with decoupled decay, for ours; the thesis has none."""

    test_share: float = 0.2
    """Of the tries, kept for judging."""

    seed: int = 0
    """Of the split, the batches and the first weights."""

    def __post_init__(self) -> None:
        """Refuse what has no meaning.

        Raises:
            GraspError: A count that is not positive, or a share outside (0, 1).
        """
        for name in ("epochs_n", "batch_n", "learning_rate"):
            if not getattr(self, name) > 0:
                raise GraspError(f"{name} must be positive, got {getattr(self, name)}.")
        if not 0 < self.test_share < 1:
            raise GraspError(f"test_share must lie between 0 and 1, got {self.test_share}.")


@dataclass(frozen=True)
class Judgement:
    """How well a scorer predicts tries.

    Attributes:
        tries_n: Tries it was judged on.
        right_n: Tries whose outcome has the larger predicted probability.
        held_n: Tries that held; whoever always says the more frequent outcome is right this often, or in the others.
        balanced: Mean of the accuracies on tries that held and on those that did not; NaN without one of them.
        brier: Mean squared error of the probability.
        calibration: Mean distance between the probability said and the share that then held, in ten bins.
    """

    tries_n: int
    right_n: int
    held_n: int
    balanced: float
    brier: float
    calibration: float

    @property
    def accuracy(self) -> float:
        """Share of the tries that it predicts."""
        return self.right_n / self.tries_n

    @property
    def majority(self) -> float:
        """Accuracy of always saying the more frequent outcome."""
        return max(self.held_n, self.tries_n - self.held_n) / self.tries_n


def split(tries_n: int, cfg: MotionLearnCfg) -> tuple[NDArray[np.integer], NDArray[np.integer]]:
    """Indices to learn from, and to judge on.

    Raises:
        GraspError: Too few tries for either.
    """
    order = np.random.default_rng([cfg.seed, 11]).permutation(tries_n)
    test_n = round(cfg.test_share * tries_n)
    if not 0 < test_n < tries_n:
        raise GraspError(f"{tries_n} tries are too few to learn from some and judge on others.")
    return order[test_n:], order[:test_n]


def train_scorer(
    grasps: GraspSet, tries: MotionTries, cfg: MotionLearnCfg, source: Mapping[str, Any] | None = None
) -> tuple[MotionAwareScorer, Judgement]:
    """A scorer, and how well it does on the tries that were kept from it.

    Args:
        grasps: That were tried.
        tries: What came of it.
        cfg: How to learn.
        source: Command, commit and machine, for the record.

    Raises:
        GraspError: Too few tries.
    """
    learned, kept = split(len(tries), cfg)
    started = time.monotonic()
    network = _fit(grasps, tries.subset(learned), cfg)
    top = float(np.linalg.norm(tries.velocity_mps, axis=1).max())
    scorer = MotionAwareScorer(grasps.object_name, grasps.shape_key, network, top)
    judgement = judge(scorer, grasps, tries.subset(kept))
    record = {
        **(source or {}),
        "settings": asdict(cfg),
        "tries_n": len(tries),
        "test": asdict(judgement),
        "train_s": round(time.monotonic() - started, 1),
    }
    return MotionAwareScorer(grasps.object_name, grasps.shape_key, network, top, record), judgement


def judge(scorer: MotionAwareScorer, grasps: GraspSet, tries: MotionTries) -> Judgement:
    """How well it predicts tries of grasps of this set.

    Raises:
        GraspError: No tries, or a scorer of another object.
    """
    if not len(tries):
        raise GraspError("there are no tries to judge on.")
    chance = scorer.require_for(grasps).score(grasps.grasps.subset(tries.grasp), tries.velocity_mps)
    right = (chance > 0.5) == tries.held
    sides = [right[tries.held == outcome] for outcome in (True, False)]
    balanced = float(np.mean([side.mean() for side in sides])) if all(map(len, sides)) else float("nan")
    brier = float(np.mean((chance - tries.held) ** 2))
    return Judgement(
        len(tries), int(right.sum()), int(tries.held.sum()), balanced, brier, calibration_error(chance, tries.held)
    )


def calibration_error(chance: Array, held: NDArray[np.bool_]) -> float:
    """Mean distance between probabilities (n,) and the share that then held, over ten bins of equal width."""
    bins = np.minimum((10 * chance).astype(int), 9)
    off = [abs(np.sum(chance[bins == each] - held[bins == each])) for each in np.unique(bins)]
    return float(np.sum(off) / len(chance))


def _fit(grasps: GraspSet, tries: MotionTries, cfg: MotionLearnCfg) -> QualityNet:
    torch.manual_seed(cfg.seed)
    network, generator = QualityNet(cfg.network), torch.Generator().manual_seed(cfg.seed)
    rows = inputs(cfg.network, grasps.grasps.subset(tries.grasp), tries.velocity_mps)
    held = torch.from_numpy(tries.held.astype(np.float32))
    decay = 0.0 if cfg.network == "thesis" else cfg.weight_decay
    optimiser = torch.optim.AdamW(network.parameters(), cfg.learning_rate, weight_decay=decay)
    for _ in range(cfg.epochs_n):
        for batch in torch.randperm(len(rows), generator=generator).split(cfg.batch_n):
            optimiser.zero_grad()
            nn.functional.binary_cross_entropy_with_logits(network(rows[batch]), held[batch]).backward()
            optimiser.step()
    return network.eval()
