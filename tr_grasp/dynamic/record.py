"""The row that is left of a trial."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class TrialRecord:
    """What happened in a trial; times are of the world's clock, from its start, but for the last two."""

    method: str
    """Which one grasped."""
    motion: str
    """Case of the benchmark."""
    object_name: str
    """What was grasped."""
    speed_m_s: float
    """Of the carrier."""
    number: int
    """Of the trial in the list of its motion and object."""
    seed: int
    """Of the list."""
    success: bool
    """Lifted and held, nothing touched that must not be."""
    outcome: str
    """In words: success, or the reason of the failure."""
    detail: str
    """More about it."""
    time_s: float
    """Until the hand left the pre-grasp in the last attempt, as the thesis counts; all of the trial if it never did."""
    committed: bool
    """It did."""
    lifted_s: float | None
    """Until the object was up."""
    end_s: float
    """Until the trial was over, the time of holding included."""
    attempts: int
    """How often the fingers closed."""
    loops: int
    """How often the method planned."""
    switches: int
    """How often it took another grasp."""
    thinking_s: float
    """Charged for thinking."""
    notes: str
    """Other numbers of the method, as JSON."""
    wall_s: float = field(compare=False)
    """Wall time of the trial, building the scene included."""
    build_s: float = field(compare=False)
    """Wall time of building the scene."""

    @property
    def key(self) -> TrialKey:
        """Which trial this is; no two rows of a table have the same."""
        return self.method, self.speed_m_s, self.motion, self.object_name, self.seed, self.number


TrialKey = tuple[str, float, str, str, int, int]
"""Method, speed, motion, object, seed, number."""
