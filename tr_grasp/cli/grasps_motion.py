"""``tr-grasp grasps motion``: learn and judge which grasps hold on an object that moves."""

from __future__ import annotations

import shlex
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

from tyro.conf import Positional

from tr_grasp.cli.arguments import make_room, run_part
from tr_grasp.cli.table import text_table
from tr_grasp.configs.io import parse
from tr_grasp.evaluation.statistics import Counts, wilson_interval
from tr_grasp.grasps import GraspSet, TrialCfg, shipped_grasp_set, shipped_objects
from tr_grasp.grasps.motion_aware import (
    Judgement,
    MotionLearnCfg,
    MotionTries,
    MotionTriesCfg,
    collect_motion_tries,
    judge,
    motion_aware_scorer,
    train_scorer,
)
from tr_grasp.grasps.motion_aware.scorer import ENDING
from tr_grasp.objects import single_object
from tr_grasp.provenance import provenance

HELP = """usage: tr-grasp grasps motion train|evaluate ...

  train SET               try a set's grasps on the moving object, and fit a network; goes on where it was stopped
  evaluate SCORER SET     try them again with other velocities, and compare with what the network says

SET is a file of `tr-grasp grasps build`, or an object of Task II; SCORER is a file of `train`, or such an object.
`tr-grasp grasps motion train --help` lists the flags."""
PLAIN = TrialCfg(shift_m=0.0, turn_deg=0.0)
"""Objects are where they should be, so that only their motion decides."""


@dataclass(frozen=True)
class ThingCfg:
    """The object, if it is none of Task II."""

    object: str | None = None
    """Its mesh file or folder."""

    scale: float = 1.0
    """Factor on its size."""

    mass_kg: float | None = None
    """Its mass."""


@dataclass(frozen=True)
class MotionTrainCfg:
    """Try a set's grasps on the moving object, and fit a network to the outcomes."""

    set: Positional[str]
    """A file of `tr-grasp grasps build`, or an object of Task II."""

    out: Path | None = None
    """The file; by default OBJECT.motion.safetensors here. The tries are kept beside it."""

    tries: MotionTriesCfg = field(default_factory=MotionTriesCfg)

    learn: MotionLearnCfg = field(default_factory=MotionLearnCfg)

    trial: TrialCfg = PLAIN

    thing: ThingCfg = field(default_factory=ThingCfg)


@dataclass(frozen=True)
class MotionEvaluateCfg:
    """Try a set's grasps with velocities that the network has not seen, and compare."""

    scorer: Positional[str]
    """A file of `train`, or an object of Task II."""

    set: Positional[str]
    """A file of `tr-grasp grasps build`, or an object of Task II."""

    tries: MotionTriesCfg = field(default_factory=lambda: MotionTriesCfg(tries_n=960, seed=1000))

    trial: TrialCfg = PLAIN

    thing: ThingCfg = field(default_factory=ThingCfg)

    kept: Path | None = None
    """Keep the tries in this file, and go on from it."""


def main(args: list[str]) -> int:
    """Run the verb."""
    return run_part("grasps motion", _VERBS, args, HELP)


def train(args: list[str]) -> int:
    """Make a scorer."""
    cfg = parse(MotionTrainCfg, args, prog="tr-grasp grasps motion train")
    grasps = _load(cfg.set)
    out = cfg.out or Path(f"{grasps.object_name}{ENDING}")
    make_room(out)
    source = provenance(shlex.join(["tr-grasp", "grasps", "motion", "train", *args])).as_json()
    tries = _tries(cfg.thing, grasps, cfg.tries, cfg.trial, out.with_suffix(".tries.npz"))
    scorer, judgement = train_scorer(grasps, tries, cfg.learn, source)
    scorer.save(out)
    print(_table({f"{grasps.object_name}, kept from it": judgement}))
    print(f"scorer   {out}")
    return 0


def evaluate(args: list[str]) -> int:
    """Judge a scorer."""
    cfg = parse(MotionEvaluateCfg, args, prog="tr-grasp grasps motion evaluate")
    scorer, grasps = motion_aware_scorer(cfg.scorer), _load(cfg.set)
    scorer.require_for(grasps)
    print(
        _table({grasps.object_name: judge(scorer, grasps, _tries(cfg.thing, grasps, cfg.tries, cfg.trial, cfg.kept))})
    )
    return 0


def _tries(of: ThingCfg, grasps: GraspSet, cfg: MotionTriesCfg, trial: TrialCfg, file: Path | None) -> MotionTries:
    from tr_grasp.cli.grasps import StageBar
    from tr_grasp.envs.grasp_trials import GraspTrials  # --help must not wait for a simulator

    thing = single_object(of.object or grasps.object_name, scale=of.scale, mass_kg=of.mass_kg)
    grasps.require_for(thing.model)
    hands = GraspTrials(thing.model, thing.mass_kg, grasps.gripper, trial)
    with TemporaryDirectory() as folder, StageBar() as bar:
        return collect_motion_tries(
            grasps, hands, cfg, file or Path(folder) / "tries.npz", lambda done, n: bar.update("tries", done, n)
        )


def _load(name_or_file: str) -> GraspSet:
    return shipped_grasp_set(name_or_file) if name_or_file in shipped_objects() else GraspSet.load(name_or_file)


def _table(judgements: dict[str, Judgement]) -> str:
    head = ("tries", "n", "held", "right", "95 % interval", "always the same", "balanced", "Brier", "off by")
    return text_table(head, [(name, *_row(found)) for name, found in judgements.items()])


def _row(found: Judgement) -> tuple[str, ...]:
    low, high = wilson_interval(Counts(found.right_n, found.tries_n))
    return (
        str(found.tries_n),
        f"{100 * found.held_n / found.tries_n:.1f} %",
        f"{100 * found.accuracy:.1f} %",
        f"{100 * low:.1f} to {100 * high:.1f} %",
        f"{100 * found.majority:.1f} %",
        f"{100 * found.balanced:.1f} %",
        f"{found.brier:.3f}",
        f"{found.calibration:.3f}",
    )


_VERBS = {"train": train, "evaluate": evaluate}
