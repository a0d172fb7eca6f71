"""Build a grasp set: candidates from geometry, then tries in a simulator, then a ranking and a spread-out choice."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tr_grasp.errors import GraspError
from tr_grasp.grasps.antipodal import ContactPairs, antipodal_pairs, hands_on
from tr_grasp.grasps.grasp_set import GraspSet, shape_key, wilson_lower
from tr_grasp.grasps.grippers import floating_gripper
from tr_grasp.grasps.poses import Grasps, farthest_points
from tr_grasp.grasps.sweep import HandSweep
from tr_grasp.grasps.tally import Tally
from tr_grasp.grasps.trial import TrialCfg, TryGrasps
from tr_grasp.objects import ObjectModel

Array = NDArray[np.floating]
SAMPLES_AT_ONCE, SAMPLES_MAX = 20_000, 400_000
EXTENT_LIMITS_M = (0.005, 2.0)
Progress = Callable[[str, int, int], None]
"""Called with the name of a stage, how many tries are done, and of how many."""


@dataclass(frozen=True)
class BuildCfg:
    """How a grasp set is made."""

    candidates_n: int = 5000
    """Antipodal candidates drawn."""

    cone_friction: float = 0.5
    """Friction that the closing line may need at either contact."""

    gap_m: float = 0.003
    """Space kept between hand and object, and hand and table, until the pads close."""

    screen_n: int = 600
    """Candidates without collision that are tried at all; a random choice if there are more."""

    screen_tries: int = 2
    """Tries of each of these; they decide who goes on, and do not count in the ranking."""

    finalists_n: int = 150
    """How many go on: the most successful, spread out."""

    tries: int = 50
    """Tries of each finalist, with misplacements that it has not seen; only these count."""

    keep_from: float = 0.8
    """Least success rate in the set; who can no longer reach it is not tried to the end."""

    keep_n: int = 120
    """Most grasps in the set, spread out."""

    seed: int = 0
    """Of candidates and misplacements."""

    trial: TrialCfg = field(default_factory=TrialCfg)

    def __post_init__(self) -> None:
        """Refuse what has no meaning.

        Raises:
            GraspError: A count below 1, a share outside [0, 1].
        """
        for name in ("candidates_n", "screen_n", "screen_tries", "finalists_n", "tries", "keep_n"):
            if getattr(self, name) < 1:
                raise GraspError(f"{name} must be at least 1, got {getattr(self, name)}.")
        if not 0 <= self.keep_from <= 1:
            raise GraspError(f"keep_from must be between 0 and 1, got {self.keep_from}.")
        if not (self.cone_friction > 0 and self.gap_m >= 0):
            raise GraspError("cone_friction must be positive and gap_m not negative.")


def candidate_grasps(model: ObjectModel, gripper: str, cfg: BuildCfg) -> tuple[Grasps, int]:
    """Antipodal grasps whose hand touches neither object nor table on its way, and how many were checked.

    Raises:
        GraspError: No such gripper; the object is nowhere narrow enough for it, absurdly scaled, or cannot be reached.
    """
    hand, opening = floating_gripper(gripper), floating_gripper(gripper).gripper.opening_range_m[1]
    _require_sane_size(model)
    rng = np.random.default_rng([cfg.seed, 0])
    found, thinnest = [], np.inf
    for _ in range(SAMPLES_MAX // SAMPLES_AT_ONCE):
        pairs = antipodal_pairs(model, SAMPLES_AT_ONCE, cfg.cone_friction, rng)
        thinnest = min(thinnest, pairs.width_m.min(initial=np.inf))
        fits = pairs.width_m <= opening - 2 * cfg.gap_m
        found.append((pairs.first[fits], pairs.second[fits]))
        if sum(len(first) for first, _ in found) >= cfg.candidates_n or not len(found[0][0]):
            break
    first, second = (np.concatenate(points)[: cfg.candidates_n] for points in zip(*found, strict=True))
    if not len(first):
        wide = f"nowhere narrower than {1e3 * thinnest:.0f} mm" if np.isfinite(thinnest) else "without opposite sides"
        raise GraspError(
            f"object {model.name!r} is {wide} and gripper {gripper!r} opens {1e3 * opening:.0f} mm"
            f" ({1e3 * cfg.gap_m:.0f} mm are kept on either side); check its scale or use a larger gripper."
        )
    grasps = hands_on(ContactPairs(first, second), hand, rng)
    free = HandSweep(hand, model, cfg.trial.approach_m, cfg.gap_m).free(grasps)
    if not free.any():
        raise GraspError(
            f"no hand of {len(free)} candidates reaches object {model.name!r} without touching it or the table;"
            f" gripper {gripper!r} may be too large for it."
        )
    return grasps.subset(free), len(free)


def build_grasp_set(
    model: ObjectModel,
    gripper: str,
    try_grasps: TryGrasps,
    cfg: BuildCfg | None = None,
    *,
    progress: Progress = lambda stage, done, total: None,
    resume_file: Path | None = None,
) -> GraspSet:
    """Candidates, tries, ranking; see :class:`BuildCfg`.

    Every round of tries draws its misplacements from the seed and its own number, so a build that was interrupted and
    resumed is tried with the same ones.

    Args:
        model: The object; it stands on its lowest point.
        gripper: A name of :func:`~tr_grasp.grasps.gripper_names`.
        try_grasps: Tries each of some grasps once.
        cfg: How.
        progress: Told how far it is.
        resume_file: Where the tally is kept after every round; a tally of the same build is taken up.

    Raises:
        GraspError: As in :func:`candidate_grasps`, or no grasp holds often enough.
        StorageError: The tally cannot be written.
    """
    cfg = cfg or BuildCfg()
    started = time.monotonic()
    free, checked_n = candidate_grasps(model, gripper, cfg)
    geometry_s = time.monotonic() - started
    rng = np.random.default_rng([cfg.seed, 1])
    screened = free.subset(np.sort(rng.permutation(len(free))[: cfg.screen_n]))
    key = f"{shape_key(model, gripper)} {asdict(cfg)}"
    first = Tally.of("screening", key, len(screened), cfg.screen_tries, resume_file)
    first.run(screened, try_grasps, cfg.seed, progress)
    finalists = screened.subset(_finalists(screened, first, cfg))
    last = Tally.of("ranking", key, len(finalists), cfg.tries, resume_file)
    last.run(finalists, try_grasps, cfg.seed, progress, drop_below=cfg.keep_from)
    chosen = _ranked(finalists, last, cfg)
    if not len(chosen):
        best = 100 * (last.successes / np.maximum(last.tries, 1)).max(initial=0.0)
        raise GraspError(
            f"no grasp of {model.name!r} by {gripper!r} held in {100 * cfg.keep_from:.0f} % of its tries, the best in"
            f" {best:.0f} %; lower keep_from, or use another gripper."
        )
    tries_n, trials_s = int(first.tries.sum() + last.tries.sum()), first.seconds + last.seconds
    return GraspSet(
        object_name=model.name,
        gripper=gripper,
        grasps=finalists.subset(chosen),
        successes=last.successes[chosen],
        tries=last.tries[chosen],
        shape_key=shape_key(model, gripper),
        settings=asdict(cfg),
        statistics={
            "candidates_n": checked_n,
            "free_n": len(free),
            "screened_n": len(screened),
            "screening_success": float(first.successes.sum() / first.tries.sum()),
            "finalists_n": len(finalists),
            "tries_n": tries_n,
            "geometry_s": round(geometry_s, 3),
            "trials_s": round(trials_s, 1),
        },
        bounds_m=model.bounds_m,
    )


def _require_sane_size(model: ObjectModel) -> None:
    low, high = EXTENT_LIMITS_M
    size = float(model.extents_m.max())
    if not low <= size <= high:
        raise GraspError(
            f"object {model.name!r} is {size:.3g} m long, outside {low:g} to {high:g} m; meshes are in metres: check"
            " its unit, or scale it."
        )


def _finalists(screened: Grasps, tally: Tally, cfg: BuildCfg) -> NDArray[np.integer]:
    """Indices of the most successful ones; of equals at the border, a spread-out choice."""
    order = np.unique(tally.successes)[::-1]
    chosen: list[int] = []
    for successes in order[order > 0]:
        equals = np.flatnonzero(tally.successes == successes)
        spread = farthest_points(screened.poses()[equals], np.ones(len(equals)), cfg.finalists_n - len(chosen))
        chosen += equals[spread].tolist()
    return np.array(chosen, int)


def _ranked(finalists: Grasps, tally: Tally, cfg: BuildCfg) -> NDArray[np.integer]:
    """Indices of the set, best first; of equals, the nearer to the centre of mass goes first.

    The set is chosen by farthest points weighed by robustness, and then ordered by robustness alone.
    """
    good = np.flatnonzero((tally.tries >= cfg.tries) & (tally.successes >= cfg.keep_from * tally.tries))
    robustness = wilson_lower(tally.successes[good], tally.tries[good])
    chosen = farthest_points(finalists.poses()[good], robustness, cfg.keep_n)
    good, robustness = good[chosen], robustness[chosen]
    lever = np.linalg.norm(finalists.position_m[good], axis=1)
    return good[np.lexsort((lever, -robustness))]
