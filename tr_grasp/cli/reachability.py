"""``tr-grasp reachability``: learn, show and ask where an arm's tool can be."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from tyro.conf import Positional

from tr_grasp.cli.arguments import make_room, run_part
from tr_grasp.cli.grasps import StageBar
from tr_grasp.cli.table import text_table
from tr_grasp.configs.io import parse
from tr_grasp.errors import ConfigError
from tr_grasp.evaluation.statistics import Counts, wilson_interval
from tr_grasp.files import make_folder
from tr_grasp.geometry import matrix_from_wxyz, transform_from
from tr_grasp.grasps.reachability import (
    Labeller,
    ReachabilityCfg,
    ReachabilityField,
    agreement,
    build_reachability,
    draw_slices,
    reachability_field,
)
from tr_grasp.grasps.reachability.field import ENDING
from tr_grasp.motion import Kinematics
from tr_grasp.robots import robot_spec

HELP = """usage: tr-grasp reachability build|show|query ...

  build ROBOT                 learn where the tool of an arm can be; goes on where it was stopped
  show ROBOT|FILE             compare its signs with inverse kinematics, and draw slices
  query ROBOT|FILE X Y Z      margin and slope at a tool pose [m], by default with the tool pointing down

`tr-grasp reachability build --help` lists the flags of each."""
DOWN_WXYZ = (0.0, 1.0, 0.0, 0.0)
MARGINS_M = (0.0, 0.01, 0.02, 0.03, 0.05)


@dataclass(frozen=True)
class ReachabilityBuildCfg:
    """Learn where the tool of an arm can be, and write it to a file; interrupted, it goes on where it was."""

    robot: Positional[str]
    """ur5_robotiq_2f85, ur5_rg2, panda, j2s7s300, or the YAML file of your own."""

    out: Path | None = None
    """The file; by default ROBOT.reachability.safetensors here."""

    build: ReachabilityCfg = field(default_factory=ReachabilityCfg)


@dataclass(frozen=True)
class ReachabilityShowCfg:
    """Compare the signs of a field with inverse kinematics on fresh poses, and draw slices."""

    source: Positional[str]
    """An arm whose field comes with the package, or a file of `build`."""

    picture: Path | None = None
    """Draw slices into this PNG."""

    poses_n: int = 5000
    """Poses to compare on."""

    seed: int = 1000
    """Of these poses."""

    robot: str | None = None
    """The arm, if the field was made for your own: its YAML file."""


@dataclass(frozen=True)
class ReachabilityQueryCfg:
    """Tell margin and slope at one tool pose, and what inverse kinematics says."""

    source: Positional[str]
    """An arm whose field comes with the package, or a file of `build`."""

    x: Positional[float]
    """Of the tool in the base frame [m]."""

    y: Positional[float]
    """Of the tool in the base frame [m]."""

    z: Positional[float]
    """Of the tool in the base frame [m]."""

    q_wxyz: tuple[float, float, float, float] = DOWN_WXYZ
    """Its orientation as a quaternion w, x, y, z; pointing down by default."""

    robot: str | None = None
    """The arm, if the field was made for your own: its YAML file."""


def main(args: list[str]) -> int:
    """Run the verb."""
    return run_part("reachability", _VERBS, args, HELP)


def build(args: list[str]) -> int:
    """Learn a field."""
    cfg = parse(ReachabilityBuildCfg, args, prog="tr-grasp reachability build")
    spec = robot_spec(cfg.robot)
    out = cfg.out or Path(f"{spec.name}{ENDING}")
    make_room(out)
    labels, started = out.with_name(f".{out.name}.labels.npz"), time.monotonic()
    with StageBar("pose") as bar:
        made = build_reachability(spec, cfg.build, progress=bar.update, resume_file=labels)
    made.save(out)
    labels.unlink(missing_ok=True)
    print(f"{_summary(made)}\n(in {time.monotonic() - started:.0f} s)")
    print(f"field    {out}")
    return 0


def show(args: list[str]) -> int:
    """Compare and draw a field."""
    cfg = parse(ReachabilityShowCfg, args, prog="tr-grasp reachability show")
    if cfg.poses_n < 1:
        raise ConfigError(f"--poses-n must be at least 1, got {cfg.poses_n}.")
    found = reachability_field(cfg.source)
    compared = agreement(found, robot_spec(cfg.robot or found.robot), cfg.poses_n, cfg.seed)
    print(_summary(found))
    rows = [(f"{1e3 * margin:.0f} mm", *_shares(*compared.beyond(margin), cfg.poses_n)) for margin in MARGINS_M]
    print(text_table(("margin over", "of all poses", "right sign", "95 % interval"), rows))
    if cfg.picture is not None:
        make_folder(cfg.picture.parent)
        print(f"picture  {draw_slices(found, cfg.picture)}")
    return 0


def query(args: list[str]) -> int:
    """Ask at one pose."""
    cfg = parse(ReachabilityQueryCfg, args, prog="tr-grasp reachability query")
    q = np.array(cfg.q_wxyz)
    if not (np.isfinite(q).all() and np.linalg.norm(q) > 1e-6):
        raise ConfigError(f"--q-wxyz must be a quaternion that is not zero, got {cfg.q_wxyz}.")
    found = reachability_field(cfg.source)
    spec = robot_spec(cfg.robot or found.robot)
    found.require_for(spec)
    T = transform_from(matrix_from_wxyz(q / np.linalg.norm(q)), [cfg.x, cfg.y, cfg.z])
    margin, slope = float(found.values(T)), found.gradient(T)
    says = Labeller(Kinematics(spec), float(found.settings["floor_m"]))(T[None])[0]
    print(f"margin   {1e3 * margin:.0f} mm, {'reachable' if margin > 0 else 'out of reach'}")
    print("slope    " + " ".join(f"{value:+.2f}" for value in slope[:3]) + " m/m along x, y, z")
    print("         " + " ".join(f"{value:+.2f}" for value in slope[3:]) + " m/rad about x, y, z")
    print(f"inverse kinematics says {'reachable' if says else 'out of reach'}")
    return 0


def _summary(found: ReachabilityField) -> str:
    facts = found.statistics
    return (
        f"{found.robot}: {facts['poses_n']} poses, {100 * facts['reachable_share']:.0f} % of them reachable,"
        f" {facts['border_n']} on the border; labels {facts['labels_s']:.0f} s, fit {facts['fit_s']:.0f} s"
    )


def _shares(right_n: int, sure_n: int, poses_n: int) -> tuple[str, str, str]:
    if not sure_n:
        return "0 %", "-", "-"
    low, high = wilson_interval(Counts(right_n, sure_n))
    return (
        f"{100 * sure_n / poses_n:.1f} %",
        f"{100 * right_n / sure_n:.2f} %",
        f"{100 * low:.2f} to {100 * high:.2f} %",
    )


_VERBS = {"build": build, "show": show, "query": query}
