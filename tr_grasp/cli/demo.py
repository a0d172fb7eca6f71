"""``tr-grasp demo``: the shipped policy grasps objects that it has never seen."""

from __future__ import annotations

import shlex
from dataclasses import dataclass, field
from pathlib import Path

from tr_grasp.cli import doctor
from tr_grasp.cli.evaluate import EvaluateCfg, run
from tr_grasp.configs.io import parse
from tr_grasp.provenance import cores_n


@dataclass(frozen=True)
class DemoCfg:
    """Check the machine, then let the shipped policy grasp held-out objects out of clutter and write a report."""

    episodes: int = 20
    """How many."""

    policy: str = "panda"
    """A shipped policy, or the folder of a saved one."""

    seed: int = 20_000
    """Seed of the first episode."""

    out: Path = Path("runs/demo")
    """Folder of the results; those of the last demo are replaced."""

    workers: int = field(default_factory=lambda: min(2, cores_n()))
    """Processes that play."""

    replays: int = 4
    """Animated episodes in the report."""


def main(args: list[str]) -> int:
    """Run the verb.

    Returns:
        0; 1 if the machine lacks something that is needed; 130 if Ctrl-C ended it early.
    """
    cfg = parse(DemoCfg, args, prog="tr-grasp demo")
    if code := doctor.main([]):
        return code
    print(f"\n{cfg.policy}: {cfg.episodes} episodes, 2-4 held-out objects each", flush=True)
    asked = EvaluateCfg(
        policy=cfg.policy,
        objects="test",
        suite="scattered",
        episodes=cfg.episodes,
        seed=cfg.seed,
        workers=cfg.workers,
        replays=cfg.replays,
    )
    return run(asked, cfg.out, command=shlex.join(["tr-grasp", "demo", *args]))
