"""How a run is doing, in numbers and in one line."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any

import torch
from tensordict import TensorDictBase
from torch import Tensor

from tr_grasp.keys import SUCCESS
from tr_grasp.trainers.acting import STEP_COUNT
from tr_grasp.trainers.collect import EPISODE_REWARD

RECENT_EPISODES_N = 100


class RecentEpisodes:
    """Success, reward and length of the last hundred training episodes."""

    def __init__(self) -> None:
        self._ends: deque[tuple[float, float, float]] = deque(maxlen=RECENT_EPISODES_N)
        self.finished = 0

    def observe(self, chunk: TensorDictBase) -> None:
        """Take note of the episodes that end in a chunk."""
        following = chunk["next"]
        ends = following[following["done"][..., 0]]
        self.finished += len(ends)
        columns = [ends[key].flatten().float().tolist() for key in (SUCCESS, EPISODE_REWARD, STEP_COUNT)]
        self._ends.extend(zip(*columns, strict=True))

    def summary(self) -> dict[str, float]:
        """Means under ``train/``; empty before the first episode has ended."""
        if not self._ends:
            return {}
        success, reward, steps = (sum(values) / len(self._ends) for values in zip(*self._ends, strict=True))
        return {"train/success": success, "train/reward": reward, "train/steps": steps, "train/episodes": self.finished}

    def state_dict(self) -> dict[str, Any]:
        """For the checkpoint."""
        return {"ends": [list(end) for end in self._ends], "finished": self.finished}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Restore."""
        self._ends.clear()
        self._ends.extend(tuple(end) for end in state["ends"])
        self.finished = state["finished"]


class Averages:
    """Means of named scalars since they were last asked for; nothing waits for the device until then."""

    def __init__(self) -> None:
        self._rows: list[Mapping[str, Tensor]] = []

    def add(self, scalars: Mapping[str, Tensor]) -> None:
        """One update's worth."""
        self._rows.append(scalars)

    def take(self, prefix: str) -> dict[str, float]:
        """``prefix/name`` to mean; forgets them."""
        rows, self._rows = self._rows, []
        if not rows:
            return {}
        return {f"{prefix}/{name}": float(torch.stack([row[name].cpu() for row in rows]).mean()) for name in rows[-1]}


class Clock:
    """Wall time of a run over all its sessions, and the pace of this one."""

    def __init__(self, wall_s: float = 0.0) -> None:
        self._offset = wall_s - time.monotonic()
        self.begin(0, 0)

    @property
    def wall_s(self) -> float:
        """Seconds that the run has taken."""
        return time.monotonic() + self._offset

    def begin(self, env_steps: int, updates: int) -> None:
        """From here on the pace is measured."""
        self._began = self._last = (self.wall_s, env_steps, updates)

    def rates(self, env_steps: int, updates: int) -> dict[str, float]:
        """Steps and updates per second since the last call."""
        wall_s, steps_before, updates_before = self._last
        self._last = (self.wall_s, env_steps, updates)
        elapsed = max(self._last[0] - wall_s, 1e-9)
        return {
            "rate/env_steps_per_s": (env_steps - steps_before) / elapsed,
            "rate/updates_per_s": (updates - updates_before) / elapsed,
        }

    def eta_s(self, env_steps: int, total: int) -> float | None:
        """Seconds left at the pace of this session; None before there is one."""
        wall_s, steps_before, _ = self._began
        if env_steps <= steps_before:
            return None
        return max(0, total - env_steps) * (self.wall_s - wall_s) / (env_steps - steps_before)


def progress_line(row: Mapping[str, float], total: int, eta_s: float | None) -> str:
    """One line for a terminal, from a row of the log."""
    parts = [f"{int(row['env_steps']):>7}/{total} steps", f"{int(row['updates']):>6} updates"]
    if "train/success" in row:
        parts.append(f"success {100 * row['train/success']:3.0f} % of last {RECENT_EPISODES_N}")
    parts.append(f"{row['rate/env_steps_per_s']:.0f} steps/s, {row['rate/updates_per_s']:.1f} updates/s")
    parts.append(f"{clock_text(row['wall_s'])} elapsed")
    if eta_s is not None:
        parts.append(f"{clock_text(eta_s)} left")
    return " | ".join(parts)


def evaluation_line(scores: Mapping[str, float], env_steps: int, is_best: bool) -> str:
    """One line for a terminal about an evaluation."""
    numbers = ", ".join(f"{name} {value:.3g}" for name, value in scores.items())
    return f"evaluation at {env_steps} steps: {numbers}{' (best so far)' if is_best else ''}"


def clock_text(seconds: float) -> str:
    """``1:02:03`` or ``2:03``."""
    minutes, rest = divmod(int(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"


def curve(rows: Sequence[Mapping[str, float]]) -> list[dict[str, float]]:
    """The learning curve of a record: wall time and success over environment steps."""
    names = ("env_steps", "updates", "wall_s", "train/success", "evaluation/success")
    return [{name: round(row[name], 4) for name in names if name in row} for row in rows]
