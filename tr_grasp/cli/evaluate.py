"""``tr-grasp evaluate``: judge a policy on seeded episodes and write a report."""

from __future__ import annotations

import shlex
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Literal

from tyro.conf import Positional

from tr_grasp.cli.progress import EpisodeBar
from tr_grasp.cli.table import text_table
from tr_grasp.configs.io import parse
from tr_grasp.errors import ConfigError
from tr_grasp.evaluation.records import EPISODES_FILE
from tr_grasp.evaluation.report import SUMMARY_COLUMNS, Evaluation, summary_row
from tr_grasp.provenance import cores_n, provenance


@dataclass(frozen=True)
class EvaluateCfg:
    """Judge a policy on seeded episodes and write a report."""

    policy: Positional[str]
    """A shipped policy (panda), the folder of a saved one, or scripted, random, zero."""

    robot: str | None = None
    """The arm of scripted, random or zero: panda, ur5_rg2, ur5_robotiq_2f85, j2s7s300 or your own YAML file."""

    objects: str = "test"
    """test or train for procedural objects, procedural_wide, or a folder with one sub-folder per object."""

    suite: Literal["single", "scattered", "pile", "all"] = "scattered"
    """One object, 2-4 objects apart, 4 in a dropped pile, or the three after each other."""

    episodes: int = 200
    """Episodes of each suite."""

    seed: int = 20_000
    """Seed of the first episode; the next ones have the next seeds, so two policies meet the same scenes."""

    out: Path | None = None
    """Folder of the results; by default a new one under runs/evaluate."""

    workers: int = field(default_factory=lambda: min(2, cores_n()))
    """Processes that play; the results do not depend on it."""

    replays: int = 4
    """Animated episodes of each suite in the report, half of them failures if there are any."""

    def __post_init__(self) -> None:
        if self.workers < 1:
            raise ConfigError(f"--workers must be at least 1, got {self.workers}.")
        if self.replays < 0:
            raise ConfigError(f"--replays must not be negative, got {self.replays}.")


def main(args: list[str]) -> int:
    """Run the verb.

    Returns:
        0, or 130 if Ctrl-C ended it early.
    """
    cfg = parse(EvaluateCfg, args, prog="tr-grasp evaluate")
    out = cfg.out or new_folder(cfg)
    if (out / EPISODES_FILE).exists():
        raise ConfigError(f"--out: {out} already holds an evaluation; name another folder or remove it.")
    return run(cfg, out, command=shlex.join(["tr-grasp", "evaluate", *args]))


def run(cfg: EvaluateCfg, out: Path, command: str) -> int:
    """Evaluate, with progress, table and paths on the terminal."""
    # --help must not wait for a simulator.
    from tr_grasp.evaluation.players import load_player, with_robot
    from tr_grasp.evaluation.run import evaluate
    from tr_grasp.evaluation.suites import named_suites

    player = with_robot(load_player(cfg.policy), cfg.robot)
    suites = named_suites(cfg.suite, player.env, objects=cfg.objects, episodes=cfg.episodes, first_seed=cfg.seed)
    with EpisodeBar(sum(suite.episodes for suite in suites)) as bar:
        finished = evaluate(
            player,
            suites,
            out,
            provenance(command),
            workers=cfg.workers,
            replays_per_suite=cfg.replays,
            on_episode=bar.update,
        )
    if finished is None:
        raise KeyboardInterrupt
    print(tables(finished.evaluation))
    print(f"\nepisodes  {out / EPISODES_FILE}\nreport    {finished.report}")
    for path in finished.replays:
        print(f"replay    {path}")
    if finished.was_interrupted:
        n = len(finished.evaluation.records)
        print(f"stopped by Ctrl-C; the {n} episodes that were over are kept and reported")
        return 130
    return 0


def tables(evaluation: Evaluation) -> str:
    """Summary and reasons of the failures."""
    summaries = evaluation.summaries
    text = text_table(SUMMARY_COLUMNS, [summary_row(summary) for summary in summaries])
    reasons = [
        (summary.suite, reason, str(n))
        for summary in summaries
        for reason, n in summary.outcomes.items()
        if reason in evaluation.failure_reasons
    ]
    return f"{text}\n\n{text_table(('suite', 'failure', 'episodes'), reasons, left_n=2)}" if reasons else text


def new_folder(cfg: EvaluateCfg) -> Path:
    """A folder that does not exist yet, named after what is judged, on what, and when."""
    moment = datetime.now().strftime("%Y%m%d-%H%M%S")
    return Path("runs/evaluate") / f"{Path(cfg.policy).name}-{Path(cfg.objects).name}-{cfg.suite}-{moment}"
