"""The training loop."""

from __future__ import annotations

import copy
import math
import shlex
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import torch
from tensordict import TensorDictBase

from tr_grasp.configs import TrainCfg
from tr_grasp.modules import EnvSpec, save_policy
from tr_grasp.provenance import provenance
from tr_grasp.trainers.acting import ExploringPolicy, RandomActions, ScriptedExpert
from tr_grasp.trainers.checkpoint import load_checkpoint, save_checkpoint
from tr_grasp.trainers.collect import Collection, CollectPlan, EnvMaker, environments_of
from tr_grasp.trainers.interrupt import Interrupt
from tr_grasp.trainers.load_demonstrations import load_demonstrations
from tr_grasp.trainers.progress import Averages, Clock, RecentEpisodes, curve, evaluation_line, progress_line
from tr_grasp.trainers.run_folder import RunFolder
from tr_grasp.trainers.session import Session
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
        command: str | None = None,
    ) -> None:
        torch.set_num_threads(cfg.trainer.threads_n)
        self._cfg = cfg
        self._folder = folder
        self._make_env = make_env
        self._evaluate_policy = evaluate or Validation(cfg, make_env)
        self._report = report
        self._provenance = provenance(command or shlex.join(sys.argv))
        self._session = Session(cfg, env_spec, folder.path)
        # Acts on the CPU, wherever the learner is, with the weights of the last push.
        self._policy = copy.deepcopy(self._session.agent.policy).cpu().eval().requires_grad_(False)
        self._judged = copy.deepcopy(self._policy)
        self._action_n = env_spec.action_n
        self._losses = Averages()
        self._clock = Clock()
        self._interrupt = Interrupt()

    def run(self, *, resume: bool = False) -> TrainingResult:
        """Train, or train on from the folder's checkpoint.

        Ctrl-C ends the run after the chunk at hand, with a checkpoint.

        Raises:
            CheckpointError: There is nothing to resume, or it does not fit the settings.
            TrainingDivergedError: A loss stopped being finite; the last checkpoint stays.
            StorageError: Something could not be written; the last checkpoint stays.
        """
        if resume:
            self._restore()
        else:
            self._folder.open(self._cfg)
        counters, learner = self._session.counters, self._session.learner
        try:
            with self._interrupt:
                self._record_demonstrations()
                self._pretrain()
                self._clock.begin(counters.env_steps, learner.updates)
                while counters.env_steps < self._cfg.trainer.env_steps and not self._interrupt.requested:
                    self._collect_and_learn()
                    self._checkpoint()
        finally:
            self._folder.close()
        return TrainingResult(
            folder=self._folder.path,
            env_steps=counters.env_steps,
            updates=learner.updates,
            wall_s=self._clock.wall_s,
            best_success=counters.best[0] if counters.best else None,
            interrupted=self._interrupt.requested,
        )

    def _record_demonstrations(self) -> None:
        cfg, demonstrations = self._cfg.demonstrations, self._session.demonstrations
        if len(demonstrations) >= cfg.transitions_n or self._interrupt.requested:
            return
        if cfg.file is not None:
            self._load_demonstrations()
            return
        self._report(f"recording {cfg.transitions_n} transitions of the scripted expert")
        expert = ScriptedExpert(cfg.noise_scale, cfg.gripper_flip_probability, cfg.wander_steps)
        # Nothing is learned meanwhile, so a process more than later keeps all cores busy.
        workers_n = self._cfg.trainer.workers_n + 1
        plan = self._plan(labels=True, workers_n=workers_n, episode_steps=cfg.episode_steps)
        episodes = RecentEpisodes()
        with Collection(plan, expert) as collection:
            for chunk in collection:
                before = len(demonstrations)
                for part in environments_of(chunk):
                    if left := cfg.transitions_n - len(demonstrations):
                        demonstrations.extend(part[:left])
                episodes.observe(chunk)
                if before // LOG_EVERY < len(demonstrations) // LOG_EVERY:
                    self._report(f"{len(demonstrations):>7}/{cfg.transitions_n} transitions")
                if len(demonstrations) >= cfg.transitions_n or self._interrupt.requested:
                    break
        success = episodes.summary().get("train/success", math.nan)
        self._report(f"{len(demonstrations)} demonstrations, expert's success {100 * success:.0f} % (with noise)")
        self._checkpoint()

    def _load_demonstrations(self) -> None:
        demonstrations = self._session.demonstrations
        if not len(demonstrations):  # of a resumed run the checkpoint brings them
            file = load_demonstrations(self._cfg, demonstrations)
            self._report(f"{len(demonstrations)} demonstrations of the {file.transitions_n} in '{file.path}'")
            self._checkpoint()

    def _pretrain(self) -> None:
        session = self._session
        wanted = self._cfg.imitation.pretrain_updates if len(session.demonstrations) else 0
        if session.counters.pretrained >= wanted or self._interrupt.requested:
            return
        self._report(f"imitating the demonstrations for {wanted} updates")
        while session.counters.pretrained < wanted and not self._interrupt.requested:
            self._losses.add(session.learner.pretrain(session.sampler.demonstrations()))
            session.counters.pretrained += 1
            if session.counters.pretrained % 100 == 0:
                means = self._losses.take("pretrain")
                self._report(
                    f"{session.counters.pretrained:>7}/{wanted} imitation updates | "
                    f"loss {means['pretrain/loss_imitation']:.3f}, "
                    f"localisation {means['pretrain/loss_localisation']:.3f}"
                )
        self._losses.take("pretrain")
        session.learner.synchronise_targets()
        self._checkpoint()

    def _collect_and_learn(self) -> None:
        """One segment: to the next checkpoint when collecting inline, else to the end of the run.

        Inline, environments begin anew with each segment, so that a resumed run and an uninterrupted one see the
        same episodes.
        """
        cfg, counters = self._cfg.trainer, self._session.counters
        is_random = counters.env_steps < cfg.random_steps
        with self._start_collecting(is_random) as collection:
            for chunk in collection:
                before = counters.env_steps
                self._store(chunk)
                self._improve(chunk.numel(), int(chunk["next", "done"].sum()))
                self._push()
                collection.push_weights()
                evaluation_due = self._passed(before, cfg.evaluate_every) or self._ends_unjudged()
                scores = self._evaluate() if evaluation_due else {}
                done = counters.env_steps >= cfg.env_steps or self._interrupt.requested
                checkpoint_due = self._passed(before, cfg.checkpoint_every)
                if scores or done or checkpoint_due or self._passed(before, LOG_EVERY):
                    self._log(scores)
                if done or (is_random and counters.env_steps >= cfg.random_steps):
                    return
                if checkpoint_due and cfg.collector == "inline":
                    return
                if checkpoint_due:
                    self._checkpoint()

    def _start_collecting(self, is_random: bool) -> Collection:
        imitation = self._cfg.imitation
        labels = imitation.states == "all" and max(imitation.weight_initial, imitation.weight_final) > 0
        # Imitation does not train the policy's deviation.
        cfg = self._cfg.trainer
        plan = self._plan(labels=labels, deterministic=not imitation.reinforcement, episode_steps=cfg.episode_steps)
        if is_random:
            return Collection(plan, RandomActions(self._action_n))
        self._push()
        noise = self._cfg.algorithm.action_noise
        return Collection(plan, ExploringPolicy(self._policy, noise, cfg.deterministic_share, self._judged))

    def _plan(self, *, labels: bool, workers_n: int | None = None, **changes: Any) -> CollectPlan:
        cfg = self._cfg
        self._session.counters.segment += 1
        return CollectPlan(
            make_env=self._make_env,
            env=replace(cfg.env, observation=replace(cfg.env.observation, expert_labels=labels)),
            seed=cfg.seed,
            segment=self._session.counters.segment,
            steps_per_batch=cfg.trainer.steps_per_batch,
            mode=cfg.trainer.collector,
            workers_n=workers_n or cfg.trainer.workers_n,
            envs_per_worker_n=cfg.trainer.envs_per_worker_n,
            **changes,
        )

    def _store(self, chunk: TensorDictBase) -> None:
        for part in environments_of(chunk):
            self._session.experience.extend(part)
        self._session.episodes.observe(chunk)
        self._session.counters.env_steps += chunk.numel()

    def _improve(self, steps_n: int, episodes_n: int) -> None:
        cfg, counters = self._cfg.trainer, self._session.counters
        if counters.env_steps < cfg.learning_starts:
            return
        counters.owed_updates += steps_n * cfg.updates_per_step + episodes_n * cfg.updates_per_episode
        while counters.owed_updates >= 1:
            self._losses.add(self._session.learner.update(self._session.sampler.mixed(), counters.env_steps))
            counters.owed_updates -= 1

    def _push(self) -> None:
        self._policy.load_state_dict(self._session.agent.policy.state_dict())
        self._judged.load_state_dict(self._session.learner.average.policy.state_dict())

    def _evaluate(self) -> dict[str, float]:
        counters = self._session.counters
        average = self._session.learner.average
        scores = self._evaluate_policy(self._judged)
        rank = [scores["success"], scores.get("reward", 0.0)]
        is_best = rank > counters.best
        if is_best:
            counters.best = rank
            save_policy(self._folder.best, average, self._cfg, self._record(scores))
        self._report(evaluation_line(scores, counters.env_steps, is_best))
        return {f"evaluation/{name}": value for name, value in scores.items()}

    def _log(self, scores: dict[str, float]) -> None:
        env_steps, updates = self._session.counters.env_steps, self._session.learner.updates
        row = {
            "env_steps": env_steps,
            "updates": updates,
            "wall_s": self._clock.wall_s,
            **self._session.episodes.summary(),
            **scores,
            **self._clock.rates(env_steps, updates),
            **self._losses.take("learner"),
        }
        self._folder.log(row)
        total = self._cfg.trainer.env_steps
        self._report(progress_line(row, total, self._clock.eta_s(env_steps, total)))

    def _passed(self, before: int, every: int) -> bool:
        """Whether the last chunk crossed a multiple of ``every``."""
        return every > 0 and before // every < self._session.counters.env_steps // every

    def _ends_unjudged(self) -> bool:
        """Whether the run ends here; its last policy is judged even if no evaluation is due."""
        cfg = self._cfg.trainer
        return cfg.evaluate_every > 0 and self._session.counters.env_steps >= cfg.env_steps

    def _record(self, scores: dict[str, float] | None = None) -> dict[str, Any]:
        session = self._session
        return {
            **self._provenance.as_json(),
            "seed": self._cfg.seed,
            "env_steps": session.counters.env_steps,
            "demonstrations": len(session.demonstrations),
            "updates": session.learner.updates,
            "pretrain_updates": session.counters.pretrained,
            "wall_s": round(self._clock.wall_s, 1),
            "evaluation": scores or {},
            "curve": curve(self._folder.rows),
        }

    def _checkpoint(self) -> None:
        state = {"session": self._session.state_dict(), "rows": self._folder.rows, "wall_s": self._clock.wall_s}
        save_checkpoint(self._folder.checkpoint, state)
        record = self._record()
        self._folder.write_record(record)
        save_policy(self._folder.last, self._session.learner.average, self._cfg, record)

    def _restore(self) -> None:
        state = load_checkpoint(self._folder.checkpoint, ("session", "rows", "wall_s"))
        self._session.load_state_dict(state["session"])
        self._clock = Clock(state["wall_s"])
        env_steps = self._session.counters.env_steps
        self._folder.open(self._cfg, state["rows"], env_steps)
        self._report(f"resumed at {env_steps} environment steps")
