"""``tr-grasp study``: train and judge the runs that answer one question."""

from __future__ import annotations

import json
import re
import shlex
from dataclasses import replace
from pathlib import Path

from tr_grasp.cli.arguments import take, whole_number
from tr_grasp.cli.progress import EpisodeBar
from tr_grasp.cli.table import text_table
from tr_grasp.configs import TrainCfg
from tr_grasp.configs.io import parse
from tr_grasp.configs.study import Study, load_study, study_names
from tr_grasp.errors import ConfigError
from tr_grasp.files import make_folder, write_atomically

USAGE = """Train every run of a study with several seeds, judge all on the same held-out scenes, and say what differs.

  tr-grasp study STUDY [--seeds N] [--episodes N] [--suite SUITE] [--out DIR] [--SETTING VALUE ...]

STUDY: {studies}, or a YAML file with `question:` and `runs:`. --seeds (1) trains with the seeds 0 .. N-1;
--episodes (200) and --suite (scattered; single, pile, all) judge; --out (runs/studies/STUDY) keeps everything. Settings
change all runs alike. Called again, it goes on where it was; what is finished is not repeated. The table is printed and
kept in summary.json, the training curves in curves.png.
"""


def main(args: list[str]) -> int:
    """Run the verb."""
    seeds_n, args = take(args, "--seeds", "a number")
    episodes_n, args = take(args, "--episodes", "a number")
    suite, args = take(args, "--suite", "a name")
    out, args = take(args, "--out", "a folder")
    name, flags = (args[0], args[1:]) if args and not args[0].startswith("-") else (None, args)
    usage = USAGE.format(studies=", ".join(study_names()))
    if "--help" in flags or "-h" in flags:
        parse(TrainCfg, ["--help"], TrainCfg(), prog="tr-grasp study STUDY", description=usage)
    if name is None:
        raise ConfigError(f"give a study ({', '.join(study_names())}) or a YAML file.")
    study = load_study(name)
    study = replace(study, runs={label: parse(TrainCfg, flags, cfg) for label, cfg in study.runs.items()})
    folder = Path(out) if out is not None else Path("runs/studies") / study.name
    seeds = range(whole_number(seeds_n, "--seeds", 1))
    episodes = whole_number(episodes_n, "--episodes", 200)
    command = shlex.join(["tr-grasp", "study", name, *flags])
    return _run(study, folder, seeds, suite or "scattered", episodes, command)


def _run(study: Study, folder: Path, seeds: range, suite: str, episodes: int, command: str) -> int:
    # --help must not wait for a simulator.
    from tr_grasp.evaluation.study import SUMMARY_HEAD, Trained, as_json, curves_png, read_curve, summary_rows

    print(study.question)
    trained: list[Trained] = []
    runs = [(label, replace(cfg, seed=seed)) for seed in seeds for label, cfg in study.runs.items()]
    for index, (label, cfg) in enumerate(runs):
        run_folder = folder / f"{_slug(label)}-{cfg.seed}"
        print(f"[{index + 1}/{len(runs)}] {label}, seed {cfg.seed}: {run_folder}", flush=True)
        if not _train(cfg, run_folder, command):
            print(f"stopped by Ctrl-C, all saved; go on with: {command} --out {folder}")
            return 130
        records = _judge(run_folder, suite, episodes, command)
        trained.append(Trained(label, cfg.seed, records, read_curve(run_folder / "progress.csv")))
    make_folder(folder)
    write_atomically(folder / "summary.json", json.dumps(as_json(trained), indent=2) + "\n")
    write_atomically(folder / "curves.png", curves_png(trained, study.question))
    print(f"\n{text_table(SUMMARY_HEAD, summary_rows(trained))}")
    print("(Seeds are pooled; where they differ more than the runs do, that says more than p.)")
    print(f"\ncurves  {folder / 'curves.png'}\ntable   {folder / 'summary.json'}")
    return 0


def _train(cfg: TrainCfg, folder: Path, command: str) -> bool:
    """Train, train on, or leave a finished run alone; False if Ctrl-C ended it."""
    from tr_grasp.envs import env_spec, make_env
    from tr_grasp.trainers import RunFolder, Trainer

    record, checkpoint = folder / "training.json", folder / "checkpoint.pt"
    if record.is_file() and json.loads(record.read_text())["env_steps"] >= cfg.trainer.env_steps:
        print("  trained already")
        return True
    trainer = Trainer(
        cfg,
        RunFolder(folder),
        make_env=make_env,
        env_spec=env_spec(cfg.env),
        report=lambda line: print(f"  {line}", flush=True),
        command=command,
    )
    return not trainer.run(resume=checkpoint.is_file()).interrupted


def _judge(run_folder: Path, suite: str, episodes: int, command: str) -> list:
    """The episodes of the run's best policy; kept, and read again if they are there in that number."""
    from tr_grasp.evaluation.players import load_player
    from tr_grasp.evaluation.records import EPISODES_FILE, read_episodes
    from tr_grasp.evaluation.run import evaluate
    from tr_grasp.evaluation.suites import named_suites
    from tr_grasp.provenance import cores_n, provenance

    best, out = run_folder / "best", run_folder / f"evaluation-{suite}"
    player = load_player(str(best if best.is_dir() else run_folder / "last"))
    suites = named_suites(suite, player.env, objects="test", episodes=episodes, first_seed=20_000)
    wanted = sum(each.episodes for each in suites)
    if (out / EPISODES_FILE).is_file() and len(records := read_episodes(out / EPISODES_FILE)) == wanted:
        print("  judged already")
        return records
    with EpisodeBar(wanted) as bar:
        finished = evaluate(
            player,
            suites,
            out,
            provenance(command),
            workers=min(2, cores_n()),
            replays_per_suite=0,
            on_episode=bar.update,
        )
    if finished is None or finished.was_interrupted:
        raise KeyboardInterrupt
    return list(finished.evaluation.records)


def _slug(label: str) -> str:
    """A label as part of a path."""
    return re.sub(r"[^a-z0-9]+", "_", label.lower()).strip("_")
