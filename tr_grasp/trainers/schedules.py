"""Quantities that change during a run, as functions of how far it has come."""

from __future__ import annotations

from tr_grasp.configs import ImitationCfg, OptimiserCfg


def learning_rate(cfg: OptimiserCfg, progress: float) -> float:
    """Constant until ``decay_start``, then linear to ``final_fraction`` of the initial rate at ``progress`` 1."""
    if progress <= cfg.decay_start or cfg.decay_start >= 1:
        return cfg.learning_rate
    done = min(1.0, (progress - cfg.decay_start) / (1 - cfg.decay_start))
    return cfg.learning_rate * (1 + done * (cfg.final_fraction - 1))


def imitation_weight(cfg: ImitationCfg, env_steps: int) -> float:
    """Linear from ``weight_initial`` to ``weight_final`` over ``decay_env_steps``."""
    done = min(1.0, env_steps / cfg.decay_env_steps) if cfg.decay_env_steps > 0 else 1.0
    return cfg.weight_initial + done * (cfg.weight_final - cfg.weight_initial)


def warmup(updates: int, warmup_updates: int) -> float:
    """From 0 to 1 over ``warmup_updates``, then 1."""
    return min(1.0, updates / warmup_updates) if warmup_updates > 0 else 1.0
