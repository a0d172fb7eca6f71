"""Why an object is left out of its set: a reason to count, and a sentence to read."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from tr_grasp.errors import MeshError


class Reason(Enum):
    """What can be wrong with an object."""

    MISSING_FILE = "a file is missing"
    NO_COLLISION_MESH = "no collision mesh"
    UNREADABLE = "unreadable file"
    NO_FACES = "no faces"
    TOO_MANY_FACES = "too many faces"
    NOT_FINITE = "NaN or infinite vertices"
    WRONG_UNITS = "wrong units"
    NOT_MANIFOLD = "open or not convex"
    NO_VOLUME = "no volume"
    DEGENERATE_INERTIA = "degenerate inertia"
    SEVERAL_PIECES = "several large pieces"
    IN_TRAINING = "also a training object"


class RejectedMesh(MeshError):
    """An object that a set cannot use; the text says what to do about it."""

    def __init__(self, reason: Reason, message: str) -> None:
        super().__init__(message)
        self.reason = reason


@dataclass(frozen=True)
class Rejection:
    """An object that was left out of a set."""

    name: str
    """Which object."""

    reason: Reason
    """What is wrong with it."""

    message: str
    """The whole sentence: which file, which rule, what to do."""

    def __str__(self) -> str:
        return f"{self.name} ({self.reason.value})"
