"""What goes wrong by a caller's mistake, each as one sentence that says what to do next."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches


class TrGraspError(Exception):
    """Base of every error that this package raises on purpose; the command line prints its text alone."""


class ConfigError(TrGraspError, ValueError):
    """A setting, preset or flag that does not exist or has a value outside its range."""


class MotionError(TrGraspError, ValueError):
    """A motion that cannot be asked for: another number of joints, NaN, a limit that is not positive, no such mode."""


class GraspError(TrGraspError, ValueError):
    """Grasps that cannot be made, found or read: no such gripper, an object too wide for it, a file that is damaged."""


class PredictionError(TrGraspError, ValueError):
    """Something that no predictor or target motion can use: a stamp that is NaN, a wrong shape, a broken track."""


class HardwareError(TrGraspError, RuntimeError):
    """A device that cannot be asked: it is missing, not connected, or sends nothing; it does not move."""


class CalibrationError(TrGraspError, ValueError):
    """A calibration that cannot be made: too few or too similar samples, a damaged file, an impossible board."""


class MeshError(TrGraspError, ValueError):
    """An object mesh that cannot be simulated: missing, empty, open, absurdly scaled or not finite."""


class CheckpointError(TrGraspError, ValueError):
    """A checkpoint or policy that is corrupt, foreign, or of another version."""


class DemonstrationError(TrGraspError, ValueError):
    """Demonstrations that cannot be read or do not fit: damaged, foreign, of another version, or of another world."""


class ExportError(TrGraspError, ValueError):
    """A policy that cannot be exported, or whose exported twin acts differently."""


class TrainingDivergedError(TrGraspError, ArithmeticError):
    """A loss or gradient stopped being finite; the message names the file that holds the batch."""


class StorageError(TrGraspError, OSError):
    """Something could not be written; the file that was there before is still whole."""


class MissingSystemLibraryError(TrGraspError, ImportError):
    """A library outside Python is missing; the message says how to install it."""


def unknown_name(what: str, given: str, valid: Iterable[str]) -> str:
    """A sentence for a name that does not exist: the nearest one and all valid ones.

    >>> unknown_name("encoder", "vanila_ocnn", ["vanilla_ocnn", "residual_ocnn"])
    "unknown encoder 'vanila_ocnn'; did you mean 'vanilla_ocnn'? Valid: residual_ocnn, vanilla_ocnn."
    """
    names = sorted(valid)
    near = get_close_matches(given, names, n=1, cutoff=0.5)
    hint = f" did you mean {near[0]!r}?" if near else ""
    return f"unknown {what} {given!r};{hint} Valid: {', '.join(names) or 'none'}."
