"""What timing a motion gives back."""

from __future__ import annotations

from dataclasses import dataclass

from tr_grasp.motion.outcome import Outcome
from tr_grasp.motion.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class Timing:
    """A trajectory, or why there is none.

    Attributes:
        outcome: How it ended.
        trajectory: Only where ``outcome.succeeded``; it keeps all limits that were given.
        detail: What exactly was wrong; empty for success.
    """

    outcome: Outcome
    trajectory: Trajectory | None = None
    detail: str = ""

    @property
    def reason(self) -> str:
        """A sentence for people."""
        return f"{self.outcome.label}{': ' if self.detail else ''}{self.detail}"
