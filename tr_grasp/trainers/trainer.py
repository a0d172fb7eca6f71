"""The training loop."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase

from tr_grasp.configs import TrainCfg
from tr_grasp.configs.io import dump_yaml
from tr_grasp.errors import CheckpointError
from tr_grasp.modules import EnvSpec, build_agent, save_policy
from tr_grasp.trainers.acting import NoisyPolicy, RandomActions, ScriptedExpert
from tr_grasp.trainers.batches import BatchSampler
from tr_grasp.trainers.checkpoint import load_checkpoint, random_state, save_checkpoint, set_random_state
from tr_grasp.trainers.collect import Collection, CollectPlan, EnvMaker
from tr_grasp.trainers.interrupt import Interrupt
from tr_grasp.trainers.learner import Learner
from tr_grasp.trainers.progress import Averages, Clock, RecentEpisodes, curve, evaluation_line, progress_line
from tr_grasp.trainers.replay import OBSERVATIONS_FOR_ANY_LENGTH, ReplayBuffer
from tr_grasp.trainers.run_folder import RunFolder, provenance
from tr_grasp.trainers.validation import Evaluate, Validation

LOG_EVERY = 500
"""Environment steps between rows of the log."""


@dataclass(frozen=True)
class TrainingResult:
    """How a run ended."""

    folder: Path
    env_steps: int
    updates: int
    wall_s: float
    best_success: float | None
    interrupted: bool


class Trainer:
    """Demonstrations, imitation, then collecting and learning until ``trainer.env_steps``.

    Args:
        cfg: The settings of the run.
        folder: Where it leaves its files.
        make_env: Makes the environment of a collector, in the collector's process.
        env_spec: The sizes of these environments.
        evaluate: Scores a policy; the key ``success`` decides which one is the best. By default deterministic
            episodes on validation seeds.
        report: Takes one line of progress at a time.
        command: What the record names as the command; by default this process's.
    """

    def __init__(
        self,
        cfg: TrainCfg,
        folder: RunFolder,
        *,
        make_env: EnvMaker,
        env_spec: EnvSpec,
        evaluate: Evaluate | None = None,
        report: Callable[[str], None] = lambda line: None,
        command: Sequence[str] | None = None,
    ) -> None:
        self._cfg = cfg
        self._folder = folder
        self._make_env = make_env
        self._report = report
        self._evaluate_policy = evaluate or Validation(cfg, make_env)
        self._provenance = provenance(command)
        _seed_everything(cfg.seed)
        torch.set_num_threads(cfg.trainer.threads_n)
        self._agent = build_agent(cfg, env_spec).to(cfg.trainer.device)
        # Acts on the CPU, wherever the learner is, with the weights of the last push.
        self._policy = copy.deepcopy(self._agent.policy).cpu().eval().requires_grad_(False)
        demonstrations_n = max(1, cfg.demonstrations.transitions_n)
        self._demonstrations = ReplayBuffer(demonstrations_n, env_spec.stack_n, OBSERVATIONS_FOR_ANY_LENGTH)
        self._experience = ReplayBuffer(cfg.replay.capacity, env_spec.stack_n)
        self._sampler = BatchSampler(cfg, env_spec.octree, self._demonstrations, self._experience)
        self._learner = Learner(self._agent, cfg, folder.path)
        self._episodes = RecentEpisodes()
        self._losses = Averages()
        self._clock = Clock()
        self._interrupt = Interrupt()
        self._action_n = env_spec.action_n
        self._env_steps = 0
        self._pretrained = 0
        self._owed_updates = 0.0
        self._segment = 0
        self._best: list[float] = []

    def run(self, *, resume: bool = False) -> TrainingResult:
        """Train, or train on from the folder's checkpoint.

        Ctrl-C ends the run after the chunk at hand, with a checkpoint.

        Raises:
            CheckpointError: There is nothing to resume, or it does not fit the settings.
            TrainingDivergedError: A loss stopped being finite; the last checkpoint stays.
            StorageError: Something could not be written; the last checkpoint stays.
        """
        if resume:
            self._restore(load_checkpoint(self._folder.checkpoint))
        else:
            self._folder.open(self._cfg)
        try:
            with self._interrupt:
                self._record_demonstrations()
                self._pretrain()
                self._clock.begin(self._env_steps, self._learner.updates)
                while self._env_steps < self._cfg.trainer.env_steps and not self._interrupt.requested:
                    self._collect_and_learn()
                    self._checkpoint()
        finally:
            self._folder.close()
        return TrainingResult(
            folder=self._folder.path,
            env_steps=self._env_steps,
            updates=self._learner.updates,
            wall_s=self._clock.wall_s,
            best_success=self._best[0] if self._best else None,
            interrupted=self._interrupt.requested,
        )

    def _record_demonstrations(self) -> None:
        cfg = self._cfg.demonstrations
        if len(self._demonstrations) >= cfg.transitions_n or self._interrupt.requested:
            return
        self._report(f"recording {cfg.transitions_n} transitions of the scripted expert")
        expert = ScriptedExpert(cfg.noise_scale, cfg.gripper_flip_probability)
        # Nothing is learned meanwhile, so a process more than later keeps all cores busy.
        workers_n = self._cfg.trainer.workers_n + 1
        plan = self._plan(labels=True, workers_n=workers_n, episode_steps=cfg.episode_steps)
        episodes = RecentEpisodes()
        with Collection(plan, expert) as collection:
            for chunk in collection:
                self._demonstrations.extend(chunk[: cfg.transitions_n - len(self._demonstrations)])
                episodes.observe(chunk)
                if len(self._demonstrations) >= cfg.transitions_n or self._interrupt.requested:
                    break
        success = episodes.summary().get("train/success", math.nan)
        self._report(f"{len(self._demonstrations)} demonstrations, expert's success {100 * success:.0f} % (with noise)")
        self._checkpoint()

    def _pretrain(self) -> None:
        wanted = self._cfg.imitation.pretrain_updates if len(self._demonstrations) else 0
        if self._pretrained >= wanted or self._interrupt.requested:
            return
        self._report(f"imitating the demonstrations for {wanted} updates")
        while self._pretrained < wanted and not self._interrupt.requested:
            self._losses.add(self._learner.pretrain(self._sampler.demonstrations()))
            self._pretrained += 1
            if self._pretrained % 100 == 0:
                mean = self._losses.take("pretrain")["pretrain/loss_imitation"]
                self._report(f"{self._pretrained:>7}/{wanted} imitation updates | loss {mean:.3f}")
        self._losses.take("pretrain")
        self._learner.synchronise_targets()
        self._checkpoint()

    def _collect_and_learn(self) -> None:
        """One segment: to the next checkpoint when collecting inline, else to the end of the run.

        Inline, environments begin anew with each segment, so that a resumed run and an uninterrupted one see the
        same episodes.
        """
        cfg = self._cfg.trainer
        is_random = self._env_steps < cfg.random_steps
        imitation = self._cfg.imitation
        labels = imitation.states == "all" and max(imitation.weight_initial, imitation.weight_final) > 0
        self._push()
        acting = RandomActions(self._action_n) if is_random else NoisyPolicy(self._policy, self._cfg.algorithm.action_noise)
        plan = self._plan(labels=labels, workers_n=cfg.workers_n, deterministic=not imitation.reinforcement)
        with Collection(plan, acting) as collection:
            for chunk in collection:
                before = self._env_steps
                self._store(chunk)
                self._improve(len(chunk))
                self._push()
                collection.push_weights()
                scores = self._evaluate() if self._passed(before, cfg.evaluate_every) or self._ends_unjudged() else {}
                done = self._env_steps >= cfg.env_steps or self._interrupt.requested
                checkpoint_due = self._passed(before, cfg.checkpoint_every)
                if scores or done or checkpoint_due or self._passed(before, LOG_EVERY):
                    self._log(scores)
                if done or (is_random and self._env_steps >= cfg.random_steps):
                    return
                if checkpoint_due and cfg.collector == "inline":
                    return
                if checkpoint_due:
                    self._checkpoint()

    def _store(self, chunk: TensorDictBase) -> None:
        self._experience.extend(chunk)
        self._episodes.observe(chunk)
        self._env_steps += len(chunk)

    def _improve(self, steps_n: int) -> None:
        if self._env_steps < self._cfg.trainer.learning_starts:
            return
        self._owed_updates += steps_n * self._cfg.trainer.updates_per_step
        while self._owed_updates >= 1:
            self._losses.add(self._learner.update(self._sampler.mixed(), self._env_steps))
            self._owed_updates -= 1

    def _push(self) -> None:
        self._policy.load_state_dict(self._agent.policy.state_dict())

    def _evaluate(self) -> dict[str, float]:
        scores = self._evaluate_policy(self._policy)
        rank = [scores["success"], scores.get("reward", 0.0)]
        is_best = rank > self._best
        if is_best:
            self._best = rank
            save_policy(self._folder.best, self._agent, self._cfg, self._record(scores))
        self._report(evaluation_line(scores, self._env_steps, is_best))
        return {f"evaluation/{name}": value for name, value in scores.items()}

    def _log(self, scores: dict[str, float]) -> None:
        row = {
            "env_steps": self._env_steps,
            "updates": self._learner.updates,
            "wall_s": self._clock.wall_s,
            **self._episodes.summary(),
            **scores,
            **self._clock.rates(self._env_steps, self._learner.updates),
            **self._losses.take("learner"),
        }
        self._folder.log(row)
        total = self._cfg.trainer.env_steps
        self._report(progress_line(row, total, self._clock.eta_s(self._env_steps, total)))

    def _passed(self, before: int, every: int) -> bool:
        """Whether the last chunk crossed a multiple of ``every``."""
        return every > 0 and before // every < self._env_steps // every

    def _ends_unjudged(self) -> bool:
        """Whether the run ends here; its last policy is judged even if no evaluation is due."""
        return self._cfg.trainer.evaluate_every > 0 and self._env_steps >= self._cfg.trainer.env_steps

    def _plan(
        self, *, labels: bool, workers_n: int, episode_steps: int | None = None, deterministic: bool = False
    ) -> CollectPlan:
        cfg = self._cfg
        observation = replace(cfg.env.observation, expert_labels=labels)
        self._segment += 1
        return CollectPlan(
            make_env=self._make_env,
            env=replace(cfg.env, observation=observation),
            seed=cfg.seed,
            segment=self._segment,
            steps_per_batch=cfg.trainer.steps_per_batch,
            mode=cfg.trainer.collector,
            workers_n=workers_n,
            episode_steps=episode_steps,
            deterministic=deterministic,
        )

    def _record(self, scores: dict[str, float] | None = None) -> dict[str, Any]:
        return {
            **self._provenance,
            "seed": self._cfg.seed,
            "env_steps": self._env_steps,
            "demonstrations": len(self._demonstrations),
            "updates": self._learner.updates,
            "pretrain_updates": self._pretrained,
            "wall_s": round(self._clock.wall_s, 1),
            "evaluation": scores or {},
            "curve": curve(self._folder.rows),
        }

    def _checkpoint(self) -> None:
        counters = {
            "env_steps": self._env_steps,
            "pretrained": self._pretrained,
            "owed_updates": self._owed_updates,
            "segment": self._segment,
            "wall_s": self._clock.wall_s,
        }
        state = {
            "config": dump_yaml(self._cfg),
            "counters": counters,
            "best": list(self._best),
            "rows": self._folder.rows,
            "episodes": self._episodes.state_dict(),
            "learner": self._learner.state_dict(),
            "demonstrations": self._demonstrations.state_dict(),
            "experience": self._experience.state_dict(),
            "sampler": self._sampler.generator.get_state(),
            "random": random_state(),
        }
        save_checkpoint(self._folder.checkpoint, state)
        record = self._record()
        self._folder.write_record(record)
        save_policy(self._folder.last, self._agent, self._cfg, record)

    def _restore(self, state: dict[str, Any]) -> None:
        counters = state["counters"]
        try:
            self._learner.load_state_dict(state["learner"])
        except (RuntimeError, ValueError, KeyError) as error:
            raise CheckpointError(
                f"'{self._folder.checkpoint}' does not fit the settings: {str(error).splitlines()[0]}"
            ) from error
        self._demonstrations.load_state_dict(state["demonstrations"])
        self._experience.load_state_dict(state["experience"])
        self._episodes.load_state_dict(state["episodes"])
        self._sampler.generator.set_state(state["sampler"])
        self._env_steps = counters["env_steps"]
        self._pretrained = counters["pretrained"]
        self._owed_updates = counters["owed_updates"]
        self._segment = counters["segment"]
        self._best = list(state["best"])
        self._clock = Clock(counters["wall_s"])
        self._folder.open(self._cfg, state["rows"], self._env_steps)
        set_random_state(state["random"])
        self._report(f"resumed at {self._env_steps} environment steps")


def _seed_everything(seed: int) -> None:
    torch.manual_seed(seed)
    np.random.seed(seed % 2**32)
