"""One gradient step: losses, clipping, Adam, target networks."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from tensordict import TensorDict
from torch import Tensor
from torch.optim.swa_utils import AveragedModel, get_ema_multi_avg_fn

from tr_grasp.configs import TrainCfg
from tr_grasp.errors import TrainingDivergedError
from tr_grasp.files import write_atomically
from tr_grasp.keys import ACTOR_FEATURES, EXPERT_ACTION, EXPERT_TARGET
from tr_grasp.modules import Agent, TargetUpdate, build_loss, imitation_loss
from tr_grasp.modules.imitation import TARGET_N, localisation_loss
from tr_grasp.trainers.batches import IMITATION_WEIGHT
from tr_grasp.trainers.schedules import imitation_weight, learning_rate, warmup

BROKEN_BATCH_FILE = "diverged_batch.pt"


class Learner:
    """Improves an agent in place.

    Args:
        agent: On the device where it shall learn.
        cfg: The settings of the run.
        folder: Where the batch is kept if a loss stops being finite.
    """

    def __init__(self, agent: Agent, cfg: TrainCfg, folder: Path) -> None:
        self.agent = agent
        self.updates = 0
        self._average = AveragedModel(agent, multi_avg_fn=get_ema_multi_avg_fn(cfg.optimiser.averaging))
        self._cfg = cfg
        self._folder = folder
        self._loss = build_loss(cfg, agent).to(cfg.trainer.device)
        self._targets = TargetUpdate(self._loss, tau=cfg.algorithm.tau)
        # Only learning needs it, so it is no part of the agent.
        self._locator = torch.nn.Linear(agent.features_n, TARGET_N).to(cfg.trainer.device)
        networks = [p for name, p in self._loss.named_parameters() if name != "log_alpha"]
        self._networks = [*networks, *self._locator.parameters()]
        self._optimiser = torch.optim.Adam(
            [*self._loss.parameters(), *self._locator.parameters()], lr=cfg.optimiser.learning_rate, fused=True
        )

    @property
    def average(self) -> Agent:
        """The agent with the running mean of its weights, which is judged and saved: it lacks the last steps' noise."""
        return self._average.module

    def pretrain(self, batch: TensorDict) -> dict[str, Tensor]:
        """One update with the imitation loss alone. Target networks follow without delay, they are not in use yet.

        Raises:
            TrainingDivergedError: The loss or its gradient is not finite.
        """
        batch = batch.to(self._cfg.trainer.device)
        losses = self._imitation(batch, self._loss.encode(batch))
        self._step(batch, losses, self._weighted(losses, 1.0), self._cfg.optimiser.learning_rate)
        return {name: loss.detach() for name, loss in losses.items()}

    def synchronise_targets(self) -> None:
        """Make the target networks equal to the online ones."""
        self._targets = TargetUpdate(self._loss, tau=self._cfg.algorithm.tau)

    def update(self, batch: TensorDict, env_steps: int) -> dict[str, Tensor]:
        """One update with all losses that the settings ask for.

        Args:
            batch: From ``BatchSampler``.
            env_steps: Steps collected so far, which the schedules go by.

        Returns:
            Named scalars, still on the device so that nothing waits for them.

        Raises:
            TrainingDivergedError: A loss or its gradient is not finite; the batch is kept in a file.
        """
        cfg = self._cfg
        batch = batch.to(cfg.trainer.device)
        features = self._loss.encode(batch)
        weight = imitation_weight(cfg.imitation, env_steps)
        losses: dict[str, Tensor] = {}
        total = torch.zeros((), device=features.device)
        if weight > 0:
            losses |= self._imitation(batch, features)
            total = total + self._weighted(losses, weight)
        actors_turn = self.updates % cfg.algorithm.actor_period == 0
        if cfg.imitation.reinforcement:
            losses |= dict(self._loss(batch.set(ACTOR_FEATURES, features)).items())
            total = total + losses["loss_qvalue"] + losses.get("loss_alpha", 0.0)
            # Left out, not multiplied by zero, or Adam's momentum would move the actor all the same.
            if actors_turn and (share := warmup(self.updates, cfg.algorithm.actor_warmup_updates)) > 0:
                total = total + share * losses["loss_actor"]
        rate = learning_rate(cfg.optimiser, env_steps / max(1, cfg.trainer.env_steps))
        norm = self._step(batch, losses, total, rate)
        if actors_turn:
            self._targets.step()
        self.updates += 1
        settings = {"learning_rate": torch.tensor(rate), "imitation_weight": torch.tensor(weight)}
        return {name: value.detach() for name, value in losses.items()} | settings | {"gradient_norm": norm}

    def state_dict(self) -> dict[str, Any]:
        """Networks, their targets, the temperature, and Adam's moments."""
        return {
            "loss": dict(self._loss.state_dict()),
            "locator": self._locator.state_dict(),
            "optimiser": self._optimiser.state_dict(),
            "average": self._average.state_dict(),
            "updates": self.updates,
        }

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Restore exactly what :meth:`state_dict` returned."""
        self._loss.load_state_dict(state["loss"])
        self._locator.load_state_dict(state["locator"])
        self._optimiser.load_state_dict(state["optimiser"])
        self._average.load_state_dict(state["average"])
        self.updates = state["updates"]

    def _imitation(self, batch: TensorDict, features: Tensor) -> dict[str, Tensor]:
        mean = self.agent.mean_before_tanh(features)
        weight = batch[IMITATION_WEIGHT]
        return {
            "loss_imitation": imitation_loss(mean, batch[EXPERT_ACTION], weight),
            "loss_localisation": localisation_loss(self._locator(features), batch[EXPERT_TARGET], weight),
        }

    def _weighted(self, losses: Mapping[str, Tensor], weight: float) -> Tensor:
        localisation = self._cfg.imitation.localisation_weight * losses["loss_localisation"]
        return weight * (losses["loss_imitation"] + localisation)

    def _step(self, batch: TensorDict, losses: Mapping[str, Tensor], total: Tensor, rate: float) -> Tensor:
        for group in self._optimiser.param_groups:
            group["lr"] = rate
        self._optimiser.zero_grad(set_to_none=True)
        if total.requires_grad:
            total.backward()
        clip = self._cfg.optimiser.gradient_clip
        norm = torch.nn.utils.clip_grad_norm_(self._networks, clip if clip > 0 else float("inf"))
        if not torch.isfinite(total) or not torch.isfinite(norm):
            self._report_divergence(batch, losses, norm)
        self._optimiser.step()
        self._average.update_parameters(self.agent)
        return norm.detach()

    def _report_divergence(self, batch: TensorDict, losses: Mapping[str, Tensor], norm: Tensor) -> None:
        path = self._folder / BROKEN_BATCH_FILE
        content = {"batch": batch.detach().cpu().to_dict(), "learner": self.state_dict()}
        write_atomically(path, lambda file: torch.save(content, file))
        values = ", ".join(f"{name} {value.item():g}" for name, value in losses.items())
        raise TrainingDivergedError(
            f"training diverged at update {self.updates}: {values}, gradient norm {norm.item():g}; "
            f"the batch and the networks before the update are in '{path}'."
        )
