"""``tr-grasp demos``: record demonstrations of the scripted expert, look at a file of them, export them."""

from __future__ import annotations

import json
import shlex
from collections import Counter
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from tyro.conf import Positional

from tr_grasp.configs import EnvCfg
from tr_grasp.configs.io import load_train_cfg, parse
from tr_grasp.errors import ConfigError, unknown_name
from tr_grasp.provenance import cores_n, provenance

if TYPE_CHECKING:
    from tr_grasp.trainers.demonstration import EpisodeInfo
    from tr_grasp.trainers.demonstration_file import DemonstrationFile

USAGE = """usage: tr-grasp demos record|info|export ...

  tr-grasp demos record --robot panda --episodes 500 --out demos.h5
  tr-grasp demos info demos.h5
  tr-grasp demos export demos.h5 --format lerobot --out DIR

`record` lets the scripted expert play seeded episodes; called again it goes on where it stopped, and a larger
--episodes adds to the file. `tr-grasp train PRESET --demonstrations.file demos.h5` starts from it. Each of the three
has a --help."""


@dataclass(frozen=True)
class RecordCfg:
    """Record demonstrations of the scripted expert; a file that is there goes on."""

    out: Path = Path("demos.h5")
    """The file."""

    episodes: int = 500
    """Episodes that the file is to hold, with the seeds seed, seed + 1, ..."""

    robot: str | None = None
    """The arm: panda, ur5_rg2, ur5_robotiq_2f85, j2s7s300 or your own YAML file; by default the preset's."""

    objects: str = "train"
    """train or test for procedural objects, or a folder of meshes, or the name of one."""

    split: Literal["train", "test"] = "train"
    """Which objects of a folder."""

    suite: Literal["preset", "single", "scattered", "pile"] = "preset"
    """How objects lie: as in the preset, or one object, 2-4 apart, 4 in a dropped pile."""

    preset: str = "grasp"
    """Preset or YAML file whose world, observation and noise are recorded."""

    noise: bool = True
    """With the preset's noise on the expert's action, so that an imitator learns to come back; labels stay clean."""

    seed: int = 40_000_000
    """Seed of the first episode."""

    workers: int = field(default_factory=lambda: min(2, cores_n()))
    """Processes that record; the file does not depend on it."""

    def __post_init__(self) -> None:
        for name, least in (("episodes", 1), ("workers", 1), ("seed", 0)):
            if getattr(self, name) < least:
                raise ConfigError(f"--{name} must be at least {least}, got {getattr(self, name)}.")


@dataclass(frozen=True)
class InfoCfg:
    """Say what a file of demonstrations holds."""

    file: Positional[Path]
    """A file that `tr-grasp demos record` wrote."""


@dataclass(frozen=True)
class ExportCfg:
    """Write demonstrations in another format."""

    file: Positional[Path]
    """A file that `tr-grasp demos record` wrote."""

    out: Path
    """Folder of the data set; made, and must be empty if it is there."""

    format: Literal["lerobot"] = "lerobot"
    """lerobot: a LeRobot data set, format v3.0."""

    successes_only: bool = False
    """Leave out episodes in which nothing was lifted."""


def main(args: list[str]) -> int:
    """Run the verb."""
    which, *rest = args or ["--help"]
    if which in ("-h", "--help"):
        print(USAGE)
        return 0
    actions = {"record": record, "info": info, "export": export}
    if which not in actions:
        raise ConfigError(f"{unknown_name('action', which, actions)} Try `tr-grasp demos --help`.")
    return actions[which](rest)


def record(args: list[str]) -> int:
    """Record, with progress on stderr."""
    cfg = parse(RecordCfg, args, prog="tr-grasp demos record")
    # --help must not wait for a simulator.
    from tqdm import tqdm

    from tr_grasp.envs import make_env
    from tr_grasp.files import make_folder
    from tr_grasp.trainers.demonstration_file import DemonstrationFile
    from tr_grasp.trainers.record import record_demonstrations

    recording = _recording(cfg)
    make_folder(cfg.out.parent)
    seeds = range(cfg.seed, cfg.seed + cfg.episodes)
    there = {episode.seed for episode in DemonstrationFile(cfg.out).episodes} if cfg.out.exists() else set()
    origin = provenance(shlex.join(["tr-grasp", "demos", "record", *args]))
    successes = 0
    with tqdm(total=len(seeds), initial=len(there.intersection(seeds)), unit="episode", dynamic_ncols=True) as bar:

        def count(episode: EpisodeInfo) -> None:
            nonlocal successes
            successes += episode.success
            bar.update()
            bar.set_postfix_str(f"success {100 * successes / (bar.n - bar.initial):.0f} %", refresh=False)

        try:
            file = record_demonstrations(
                cfg.out, recording, seeds, origin, make_env=make_env, workers=cfg.workers, on_episode=count
            )
        except KeyboardInterrupt:
            bar.close()
            print(f"stopped by Ctrl-C; what was recorded is in {cfg.out}, the same command goes on")
            return 130
    print(summary(file))
    return 0


def info(args: list[str]) -> int:
    """Print what a file holds."""
    cfg = parse(InfoCfg, args, prog="tr-grasp demos info")
    from tr_grasp.trainers.demonstration_file import DemonstrationFile

    print(summary(DemonstrationFile(cfg.file)))
    return 0


def export(args: list[str]) -> int:
    """Export, with progress on stderr."""
    cfg = parse(ExportCfg, args, prog="tr-grasp demos export")
    from tqdm import tqdm

    from tr_grasp.trainers.demonstration_file import DemonstrationFile
    from tr_grasp.trainers.lerobot import export_lerobot

    file = DemonstrationFile(cfg.file)
    with tqdm(total=len(file), unit="episode", dynamic_ncols=True) as bar:
        written = export_lerobot(
            file, cfg.out, successes_only=cfg.successes_only, on_episode=lambda index: bar.update(index + 1 - bar.n)
        )
    print(f"dataset   {written.folder}, {written.episodes_n} episodes, {written.steps_n} steps, LeRobot v3.0")
    return 0


def summary(file: DemonstrationFile) -> str:
    """A file in a dozen lines."""
    from tr_grasp.evaluation.statistics import Counts, wilson_interval

    env, episodes = file.recording.env, file.episodes
    lines = {"file": f"{file.path}, {file.path.stat().st_size / 1e6:.1f} MB"}
    lines["robot"] = env.robot
    lines["objects"] = f"{env.objects.source}, {env.objects.split}; {_most_common(_object_counts(episodes), 5)}"
    lines["episodes"] = f"{len(episodes)}, {file.transitions_n} transitions"
    if episodes:
        counts = Counts(sum(episode.success for episode in episodes), len(episodes))
        low, high = wilson_interval(counts)
        lines["success"] = f"{100 * counts.rate:.1f} % ({100 * low:.1f} to {100 * high:.1f} %)"
        lines["outcomes"] = _most_common(Counter(episode.outcome for episode in episodes))
        lines["seeds"] = f"{min(e.seed for e in episodes)} to {max(e.seed for e in episodes)}"
    lines["noise"] = ", ".join(map(str, file.recording.noise_scale)) or "none"
    lines["octrees"] = f"depth {env.observation.depth}, {env.observation.leaf_capacity} leaves"
    lines["commits"] = ", ".join(sorted({episode.commit[:10] or "unknown" for episode in episodes})) or "none"
    lines["versions"] = json.dumps(file.versions).translate(str.maketrans("", "", '{}"'))
    return "\n".join(f"{name:9} {text}" for name, text in lines.items())


def _recording(cfg: RecordCfg) -> Any:
    from tr_grasp.evaluation.suites import ARRANGEMENTS, objects_from
    from tr_grasp.robots import robot_spec
    from tr_grasp.trainers.demonstration_file import Recording

    preset = load_train_cfg(cfg.preset)
    env: EnvCfg = preset.env
    objects = objects_from(cfg.objects, env.objects)
    if objects.source != "procedural":
        objects = replace(objects, split=cfg.split, overlap=env.objects.overlap)
    if cfg.suite != "preset":
        wanted = ARRANGEMENTS[cfg.suite]
        objects = replace(objects, count_range=wanted.count_range, arrangement=wanted.arrangement)
    if cfg.robot is not None:
        robot_spec(cfg.robot)
        env = replace(env, robot=cfg.robot)
    # An episode is decided by its seed alone only in a fresh scene; pictures are not kept.
    env = replace(
        env,
        objects=objects,
        fresh_scene_every_n=1,
        observation=replace(env.observation, expert_labels=True, image=False),
    )
    if not cfg.noise:
        return Recording(env, episode_steps=env.episode_steps)
    shown = preset.demonstrations
    return Recording(
        env,
        noise_scale=shown.noise_scale,
        gripper_flip_probability=shown.gripper_flip_probability,
        wander_steps=shown.wander_steps,
        episode_steps=shown.episode_steps,
    )


def _object_counts(episodes: list[EpisodeInfo]) -> Counter[str]:
    return Counter(name for episode in episodes for name in episode.objects)


def _most_common(counts: Counter[str], most: int = 10) -> str:
    shown = ", ".join(f"{name} ({n})" for name, n in counts.most_common(most))
    return shown + (f" and {len(counts) - most} more" if len(counts) > most else "") if counts else "none"
