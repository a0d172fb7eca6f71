"""``tr-grasp grasps``: make, show and try sets of grasps."""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np
from tqdm import tqdm
from tyro.conf import Positional

from tr_grasp.cli.arguments import make_room, run_part
from tr_grasp.cli.table import text_table
from tr_grasp.configs.io import parse
from tr_grasp.errors import ConfigError, GraspError, unknown_name
from tr_grasp.evaluation.statistics import Counts, wilson_interval
from tr_grasp.files import make_folder
from tr_grasp.grasps import (
    BuildCfg,
    GraspSet,
    TrialCfg,
    build_grasp_set,
    candidate_grasps,
    contact_sheet,
    forget_tally,
    gripper_names,
    shipped_grasp_set,
    shipped_objects,
)
from tr_grasp.grasps.grasp_set import ENDING
from tr_grasp.objects import single_object

HELP = """usage: tr-grasp grasps build|show|replay|motion ...

  build OBJECT   find, try and rank grasps of an object, and write them to a file
  show FILE      list the best grasps of a file, and draw them
  replay FILE    try the best ones again, with new misplacements, beside random candidates
  motion ...     learn and judge which grasps hold while the object moves; `tr-grasp grasps motion --help`

OBJECT is a mesh file, the folder of an object, or one of Task II; FILE may be one of Task II, too, whose grasps come
with the package. `tr-grasp grasps build --help` lists the flags of each."""
HEAD = ("rank", "held", "95 % from", "width mm", "tcp x y z mm", "comes from")


@dataclass(frozen=True)
class GraspsBuildCfg:
    """Find, try and rank grasps of an object, and write them to a file; interrupted, it goes on where it was."""

    object: Positional[str]
    """A mesh file in metres, the folder of an object, or an object of Task II such as 006_mustard_bottle."""

    gripper: str = "robotiq_2f85"
    """robotiq_2f85, rg2, panda or kg3."""

    out: Path | None = None
    """The file; by default OBJECT.GRIPPER.grasps.safetensors here. A picture is put beside it."""

    scale: float = 1.0
    """Factor on the object's size."""

    mass_kg: float | None = None
    """Mass of the object; by default that of Task II's, or its volume at 600 kg/m³."""

    picture: bool = True
    """Draw a contact sheet of the best grasps beside the file."""

    build: BuildCfg = field(default_factory=BuildCfg)


@dataclass(frozen=True)
class GraspsShowCfg:
    """List the best grasps of a set, and draw them."""

    file: Positional[str]
    """A file of `build`, or an object of Task II."""

    top: int = 10
    """How many are listed."""

    picture: Path | None = None
    """Draw the contact sheet into this PNG."""

    object: str | None = None
    """The object, to be drawn, if it is none of Task II: its mesh file or folder."""

    scale: float = 1.0
    """Factor on its size."""


@dataclass(frozen=True)
class GraspsReplayCfg:
    """Try the best grasps of a set again, with misplacements that it has not seen, beside random candidates."""

    file: Positional[str]
    """A file of `build`, or an object of Task II."""

    top: int = 20
    """How many of the best, and how many random candidates."""

    tries: int = 20
    """Tries of each."""

    seed: int = 1000
    """Of the misplacements; not that of the build."""

    object: str | None = None
    """The object if it is none of Task II: its mesh file or folder."""

    scale: float = 1.0
    """Factor on its size."""

    mass_kg: float | None = None
    """Its mass."""


def main(args: list[str]) -> int:
    """Run the verb."""
    return run_part("grasps", _VERBS, args, HELP)


def build(args: list[str]) -> int:
    """Make a set."""
    cfg = parse(GraspsBuildCfg, args, prog="tr-grasp grasps build")
    if cfg.gripper not in gripper_names():
        raise GraspError(unknown_name("gripper", cfg.gripper, gripper_names()))
    thing = single_object(cfg.object, scale=cfg.scale, mass_kg=cfg.mass_kg)
    out = cfg.out or Path(f"{thing.name}.{cfg.gripper}{ENDING}")
    make_room(out)
    from tr_grasp.envs.grasp_trials import GraspTrials  # --help must not wait for a simulator

    started = time.monotonic()
    trials = GraspTrials(thing.model, thing.mass_kg, cfg.gripper, cfg.build.trial)
    with StageBar() as bar:
        made = build_grasp_set(
            thing.model, cfg.gripper, trials, cfg.build, progress=bar.update, resume_file=_tally_file(out)
        )
    made.save(out)
    forget_tally(_tally_file(out))
    print(_summary(made, time.monotonic() - started))
    print(f"grasps   {out}")
    if cfg.picture:
        print(f"picture  {contact_sheet(made, thing.model, out.with_suffix('.png'))}")
    return 0


def show(args: list[str]) -> int:
    """List and draw a set."""
    cfg = parse(GraspsShowCfg, args, prog="tr-grasp grasps show")
    if cfg.top < 1:
        raise ConfigError(f"--top must be at least 1, got {cfg.top}.")
    found = _load(cfg.file)
    print(_summary(found))
    print(text_table(HEAD, [_row(found, k) for k in range(min(cfg.top, len(found)))]))
    if cfg.picture is not None:
        make_folder(cfg.picture.parent)
        thing = single_object(cfg.object or found.object_name, scale=cfg.scale)
        print(f"picture  {contact_sheet(found, thing.model, cfg.picture)}")
    return 0


def replay(args: list[str]) -> int:
    """Try a set again."""
    cfg = parse(GraspsReplayCfg, args, prog="tr-grasp grasps replay")
    if cfg.top < 1 or cfg.tries < 1:
        raise ConfigError(f"--top and --tries must be at least 1, got {cfg.top} and {cfg.tries}.")
    found = _load(cfg.file)
    thing = single_object(cfg.object or found.object_name, scale=cfg.scale, mass_kg=cfg.mass_kg)
    found.require_for(thing.model)
    from tr_grasp.envs.grasp_trials import GraspTrials

    made_with = _build_cfg(found)
    free, _ = candidate_grasps(thing.model, found.gripper, replace(made_with, seed=cfg.seed))
    order = np.random.default_rng(cfg.seed).permutation(len(free))[: cfg.top]
    trials = GraspTrials(thing.model, thing.mass_kg, found.gripper, made_with.trial)
    for name, grasps in ((f"best {cfg.top}", found.top(cfg.top).grasps), (f"random {cfg.top}", free.subset(order))):
        rng = np.random.default_rng([cfg.seed, 7])
        held = sum(int(trials(grasps, rng).sum()) for _ in range(cfg.tries))
        counts = Counts(held, len(grasps) * cfg.tries)
        low, high = wilson_interval(counts)
        print(
            f"{name:10} {100 * counts.rate:5.1f} % of {counts.n} held ({100 * low:.1f} to {100 * high:.1f} %)",
            flush=True,
        )
    return 0


class StageBar:
    """Tries done and time left, on stderr; use it as a context manager."""

    def __init__(self, unit: str = "try") -> None:
        pause_s = 0.2 if sys.stderr.isatty() else 10.0
        self._bar = tqdm(total=0, desc="starting", unit=unit, mininterval=pause_s, dynamic_ncols=True)

    def __enter__(self) -> StageBar:
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.close()

    def update(self, stage: str, done: int, total: int) -> None:
        """Show that so many of the tries of a stage are done."""
        if self._bar.desc != f"{stage}: ":
            self._bar.reset(total)
            self._bar.initial = done  # what an earlier process did says nothing about this one's speed
            self._bar.set_description(stage, refresh=False)
        self._bar.total, self._bar.n = total, done
        self._bar.update(0)


def _load(name_or_file: str) -> GraspSet:
    return shipped_grasp_set(name_or_file) if name_or_file in shipped_objects() else GraspSet.load(name_or_file)


def _tally_file(out: Path) -> Path:
    return out.with_name(f".{out.name}")


def _build_cfg(found: GraspSet) -> BuildCfg:
    settings = dict(found.settings)
    return BuildCfg(**{**settings, "trial": TrialCfg(**settings["trial"])})


def _summary(found: GraspSet, seconds: float | None = None) -> str:
    facts = found.statistics
    perfect = int((found.successes == found.tries).sum())
    made = (
        f"{facts['candidates_n']} candidates, {facts['free_n']} free of collision, {facts['screened_n']} tried,"
        f" {facts['finalists_n']} finalists, {facts['tries_n']} tries"
    )
    took = "" if seconds is None else f" in {seconds:.0f} s"
    return (
        f"{found.object_name} by {found.gripper}: {len(found)} grasps, {perfect} of them never failed\n({made}{took})"
    )


def _row(found: GraspSet, k: int) -> tuple[str, ...]:
    x, y, z = 1e3 * found.grasps.position_m[k]
    return (
        str(k + 1),
        f"{found.successes[k]}/{found.tries[k]}",
        f"{100 * found.robustness[k]:.0f} %",
        f"{1e3 * found.grasps.width_m[k]:.0f}",
        f"{x:.0f} {y:.0f} {z:.0f}",
        _direction(found.grasps.approach()[k]),
    )


def _direction(approach: np.ndarray) -> Literal["above", "obliquely above", "the side", "below"]:
    elevation_deg = np.degrees(np.arcsin(np.clip(-approach[2], -1.0, 1.0)))
    if elevation_deg > 75:
        return "above"
    return "obliquely above" if elevation_deg > 45 else "the side" if elevation_deg > -45 else "below"


def motion(args: list[str]) -> int:
    """Grasps of objects that move."""
    from tr_grasp.cli import grasps_motion

    return grasps_motion.main(args)


_VERBS = {"build": build, "show": show, "replay": replay, "motion": motion}
