"""``tr-grasp train``: train a policy from a preset or a YAML file."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path

from tr_grasp.cli.arguments import take
from tr_grasp.configs import TrainCfg
from tr_grasp.configs.io import load_train_cfg, parse, preset_names
from tr_grasp.errors import ConfigError
from tr_grasp.trainers.progress import clock_text

USAGE = """Train a policy.

  tr-grasp train PRESET [--run-dir DIR] [--SETTING VALUE ...]
  tr-grasp train --resume RUN [--SETTING VALUE ...]

PRESET: {presets}, or a YAML file. The run's files go to DIR (default: runs/PRESET-SEED): settings, progress.csv,
TensorBoard events, checkpoint.pt, and the policies best/ and last/, which `tr-grasp evaluate` takes. RUN is such a
folder; its run goes on from its checkpoint. Ctrl-C ends a run with a checkpoint.
"""


def main(args: list[str]) -> int:
    """Run the verb."""
    run_dir, args = take(args, "--run-dir", "a folder")
    resume, args = take(args, "--resume", "a folder")
    preset, flags = (args[0], args[1:]) if args and not args[0].startswith("-") else (None, args)
    if "--help" in flags or "-h" in flags:
        preset = preset or "grasp"
    if (preset is None) == (resume is None):
        raise ConfigError(
            f"give a preset ({', '.join(preset_names())}) or a YAML file, or else --resume and the folder of a run; "
            "`tr-grasp train --help` lists all settings."
        )
    if resume is not None and run_dir is not None:
        raise ConfigError("--resume goes on in the folder of its run; leave out --run-dir.")
    source = preset if preset is not None else _resumable(Path(str(resume)))
    usage = USAGE.format(presets=", ".join(preset_names()))
    cfg = parse(TrainCfg, flags, default=load_train_cfg(source), prog="tr-grasp train PRESET", description=usage)
    folder = Path(resume) if resume is not None else _new_folder(run_dir, Path(str(source)).stem, cfg.seed)
    return _train(cfg, folder, resume=resume is not None)


def _train(cfg: TrainCfg, folder: Path, *, resume: bool) -> int:
    # The simulator takes seconds to import, so mistakes in the arguments are reported before.
    from tr_grasp.envs import env_spec, make_env
    from tr_grasp.trainers import RunFolder, Trainer

    trainer = Trainer(
        cfg,
        RunFolder(folder),
        make_env=make_env,
        env_spec=env_spec(cfg.env),
        report=lambda line: print(line, flush=True),
        command=shlex.join(["tr-grasp", *sys.argv[1:]]),
    )
    result = trainer.run(resume=resume)
    steps = f"{result.env_steps} environment steps"
    if result.interrupted:
        print(f"stopped at {steps}, all saved; go on with: tr-grasp train --resume {folder}")
        return 130
    judged = result.best_success is not None
    best = f", best success {100 * result.best_success:.0f} %" if result.best_success is not None else ""
    print(f"done: {steps} and {result.updates} updates in {clock_text(result.wall_s)}{best}")
    print(f"judge it on new objects with: tr-grasp evaluate {folder / ('best' if judged else 'last')}")
    return 0


def _resumable(run: Path) -> Path:
    if not (run / "config.yaml").is_file():
        raise ConfigError(f"--resume: '{run}' is not the folder of a run: it has no config.yaml.")
    return run


def _new_folder(run_dir: str | None, name: str, seed: int) -> Path:
    folder = Path(run_dir) if run_dir is not None else Path("runs") / f"{name}-{seed}"
    if (folder / "checkpoint.pt").exists():
        raise ConfigError(f"'{folder}' holds a run already; go on with --resume {folder}, or choose another --run-dir.")
    return folder
