"""Tries of grasps on an object that moves: which grasp, which velocity, did it hold."""

from __future__ import annotations

import hashlib
import io
import json
import zipfile
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from tr_grasp.errors import GraspError
from tr_grasp.files import write_atomically
from tr_grasp.grasps.grasp_set import GraspSet
from tr_grasp.grasps.poses import Grasps

Array = NDArray[np.floating]
AT_ONCE = 96


@dataclass(frozen=True)
class MotionTriesCfg:
    """What is tried."""

    tries_n: int = 10_000
    """Of all grasps of the set together."""

    speed_mps: tuple[float, float] = (0.0, 0.15)
    """Speeds of the object, drawn uniformly, as are directions; of fast ones more grasps fail, so more is learned."""

    seed: int = 0
    """Of grasps and velocities."""

    def __post_init__(self) -> None:
        """Refuse what has no meaning.

        Raises:
            GraspError: No tries, or speeds that are negative or in the wrong order.
        """
        if self.tries_n < 1:
            raise GraspError(f"tries_n must be at least 1, got {self.tries_n}.")
        low, high = self.speed_mps
        if not 0 <= low <= high:
            raise GraspError(f"speed_mps must be two speeds, the smaller one first, got {self.speed_mps}.")


class TryMovingGrasps(Protocol):
    """Tries each grasp once on an object that moves; how, is its own business."""

    def __call__(
        self, grasps: Grasps, rng: np.random.Generator, velocity_mps: Array | None = None
    ) -> NDArray[np.bool_]:
        """(n,) whether each of n grasps held, with velocities (n, 3) of the object in its own frame."""
        ...


@dataclass(frozen=True, eq=False)
class MotionTries:
    """What came of n tries.

    Attributes:
        grasp: (n,) index into the set.
        velocity_mps: (n, 2) of the object, horizontal, in its own frame.
        held: (n,) whether the grasp held.
    """

    grasp: NDArray[np.integer]
    velocity_mps: Array
    held: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.grasp)

    def subset(self, chosen: NDArray[np.integer]) -> MotionTries:
        """Those that an index chooses."""
        return MotionTries(self.grasp[chosen], self.velocity_mps[chosen], self.held[chosen])


def collect_motion_tries(
    grasps: GraspSet,
    try_grasps: TryMovingGrasps,
    cfg: MotionTriesCfg,
    file: Path,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> MotionTries:
    """Try grasps of a set at random velocities, and keep every round in a file; a file of the same tries is taken up.

    Args:
        grasps: The set.
        try_grasps: Tries each of some grasps once.
        cfg: What is tried; a file with fewer tries of the same seed goes on to ``tries_n``.
        file: Where they are kept (``.npz``).
        progress: Told how many tries are done, and of how many.

    Raises:
        GraspError: The file holds tries of another set or with other settings.
        StorageError: The file cannot be written.
    """
    key = _key(grasps, cfg)
    done = _take_up(file, key)
    progress(min(len(done), cfg.tries_n), cfg.tries_n)
    while len(done) < cfg.tries_n:
        rng = np.random.default_rng([cfg.seed, 5, len(done) // AT_ONCE])
        chosen = rng.integers(len(grasps), size=AT_ONCE)
        speed, angle = rng.uniform(*cfg.speed_mps, AT_ONCE), rng.uniform(-np.pi, np.pi, AT_ONCE)
        velocity = speed[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        held = try_grasps(grasps.grasps.subset(chosen), rng, np.pad(velocity, ((0, 0), (0, 1))))
        done = MotionTries(
            np.append(done.grasp, chosen), np.vstack([done.velocity_mps, velocity]), np.append(done.held, held)
        )
        _keep(file, key, done)
        progress(min(len(done), cfg.tries_n), cfg.tries_n)
    return done.subset(np.arange(cfg.tries_n))


def set_key(grasps: GraspSet) -> str:
    """What tells grasp sets apart: a hash of the object's shape, the gripper and all poses."""
    content = hashlib.sha256(grasps.shape_key.encode())
    for numbers in (grasps.grasps.position_m, grasps.grasps.q_wxyz):
        content.update(np.ascontiguousarray(numbers, np.float32).tobytes())
    return content.hexdigest()[:32]


def _key(grasps: GraspSet, cfg: MotionTriesCfg) -> str:
    settings = {name: value for name, value in asdict(cfg).items() if name != "tries_n"}
    return json.dumps([grasps.object_name, set_key(grasps), settings], default=list)


def _keep(file: Path, key: str, tries: MotionTries) -> None:
    content = io.BytesIO()
    np.savez_compressed(
        content, key=key, grasp=tries.grasp.astype(np.int32), velocity_mps=tries.velocity_mps.astype(np.float32),
        held=tries.held,
    )  # fmt: skip
    write_atomically(file, content.getvalue())


def _take_up(file: Path, key: str) -> MotionTries:
    if not file.is_file():
        return MotionTries(np.zeros(0, np.int32), np.zeros((0, 2), np.float32), np.zeros(0, bool))
    try:
        with np.load(file, allow_pickle=False) as kept:
            mine, tries = str(kept["key"]), MotionTries(kept["grasp"], kept["velocity_mps"], kept["held"])
    except (OSError, ValueError, KeyError, zipfile.BadZipFile) as error:
        raise GraspError(f"'{file}' holds no tries, or is damaged ({error}); remove it, or name another.") from error
    if mine != key:
        raise GraspError(f"'{file}' holds tries of another grasp set or other settings; name another file.")
    return tries
