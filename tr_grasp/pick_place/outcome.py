"""How a pick-and-place task, and each of its stages, ended. The world decides, so these are values, not exceptions."""

from __future__ import annotations

import enum
from dataclasses import dataclass, field


class TaskOutcome(enum.Enum):
    """How a task ended; ``label`` is for people."""

    DONE = "all stages were carried out"
    PLANNED = "all stages were planned; nothing moved"
    NOT_FOUND = "the object was not seen"
    NO_PLAN = "a stage cannot be planned"
    NOT_MOVED = "a device did not do what it was told"
    MISSED = "the fingers closed on nothing"
    DROPPED = "the object was lost on the way"

    @property
    def label(self) -> str:
        """A clause for people."""
        return self.value

    @property
    def succeeded(self) -> bool:
        """As far as the devices can tell."""
        return self in (TaskOutcome.DONE, TaskOutcome.PLANNED)


@dataclass(frozen=True)
class StageRecord:
    """What came of one stage.

    Attributes:
        name: Of the stage.
        attempt: From 1; a task that is tried again goes through stages again.
        begun_s, ended_s: On the world's clock.
        reason: Why it failed; empty if it did not.
    """

    name: str
    attempt: int
    begun_s: float
    ended_s: float
    reason: str = ""


@dataclass(frozen=True)
class TaskResult:
    """What came of a task.

    Attributes:
        outcome: How it ended.
        detail: What exactly was the matter; empty where nothing was.
        stages: All that were begun, in order.
        retries: Why each attempt but the last one failed.
    """

    outcome: TaskOutcome
    detail: str = ""
    stages: tuple[StageRecord, ...] = field(default=())
    retries: tuple[str, ...] = field(default=())

    @property
    def reason(self) -> str:
        """A sentence for people."""
        return f"{self.outcome.label}{': ' if self.detail else ''}{self.detail}"

    @property
    def cycle_s(self) -> float:
        """Time on the world's clock from the first stage to the end of the last; 0 without stages."""
        return self.stages[-1].ended_s - self.stages[0].begun_s if self.stages else 0.0
