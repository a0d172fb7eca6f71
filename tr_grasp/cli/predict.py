"""``tr-grasp predict``: train the networks of predictors, and judge predictors on motions or on a real track."""

from __future__ import annotations

import csv
import io
import shlex
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tqdm import tqdm
from tyro.conf import Positional

from tr_grasp.cli.table import text_table
from tr_grasp.configs.io import parse
from tr_grasp.errors import ConfigError, unknown_name
from tr_grasp.files import make_folder, write_atomically
from tr_grasp.provenance import provenance

if TYPE_CHECKING:
    from tr_grasp.prediction.scores import Scores
    from tr_grasp.prediction.tracks import Track
    from tr_grasp.prediction.training import Epoch

USAGE = """Where will a moving object be?

  tr-grasp predict train NAME [--SETTING VALUE ...]     train a network
  tr-grasp predict evaluate [--SETTING VALUE ...]       judge predictors on generated motions, or on a track of yours

`tr-grasp predict train --help` and `tr-grasp predict evaluate --help` list the settings.
"""
HEAD = ("motion", "predictor", "mean [mm]", "95 % below [mm]", "in 68 %", "in 95 %", "update [µs]", "predict [µs]")


@dataclass(frozen=True)
class TrainCfg:
    """Train the network of a predictor; its weights and their record go to runs/predict/NAME-SEED."""

    name: Positional[str]
    """mlp_MOTION or lstm_MOTION (linear, circular, sinusoidal) as in the thesis, or hybrid."""

    seed: int = 0
    """Of data, first weights and batches."""

    epochs: int | None = None
    """At most: 200 as in the thesis, 120 for the hybrid; ends early if the best epoch is 40 epochs ago."""

    settle: int | None = None
    """Epochs after those without dropout: 10 for the networks of the thesis, which itself has none."""

    tracks: int | None = None
    """Trajectories to learn from: 2000 as in the thesis, 2500 for the hybrid."""

    learning_rate: float = 1e-3
    """Of Adam, in the first epoch."""

    decay: float | None = None
    """Factor on it from epoch to epoch: 1 for the networks of the thesis, 0.98 for the hybrid."""

    resume: bool = False
    """Go on with the training in the folder, exactly where it stopped."""

    out: Path | None = None
    """The folder."""


@dataclass(frozen=True)
class EvaluateCfg:
    """Judge predictors: errors, honesty of their covariances, time. Writes scores.csv and prediction.png."""

    predictors: tuple[str, ...] = ()
    """hold, constant_velocity, kalman_thesis, kalman, mlp, lstm, harmonic_bank, hybrid; all by default."""

    motions: tuple[str, ...] = ()
    """Kinds of generated motions; all by default."""

    track: Path | None = None
    """A measured track instead: a CSV file with the columns t,x,y,z[,yaw] in s, m and rad."""

    weights: str = "{name}"
    """Other weights than the shipped ones: runs/predict/{name}-1/{name}.safetensors, {name} standing for hybrid, ..."""

    network_class: str = "auto"
    """Class of motion that mlp and lstm were trained for: linear, circular, sinusoidal; auto takes the nearest."""

    horizons: tuple[float, ...] = (0.5, 1.0, 2.0)
    """Times ahead [s]."""

    speed: float = 0.03
    """Of the targets [m/s]."""

    rate: float = 5.0
    """Measurements a second."""

    noise: float = 0.0
    """Standard deviation of a measurement [m]."""

    lost: float = 0.0
    """Share of the measurements that never come."""

    seeds: tuple[int, ...] = (100, 101, 102)
    """Each draws motions and noise of its own."""

    tracks: int = 4
    """Motions of each kind for each seed."""

    warm_up: float = 1.0
    """Time after the first measurement that is not judged [s]."""

    thesis_loss: bool = False
    """Print the thesis' validation loss on new tracks of its data sets instead; the thesis has no warm-up."""

    out: Path = Path("runs/predict/evaluate")
    """Folder of the results."""


def main(args: list[str]) -> int:
    """Run the verb."""
    what, *rest = args or ["--help"]
    if what in ("-h", "--help"):
        print(USAGE)
        return 0
    if what == "train":
        return train(parse(TrainCfg, rest, prog="tr-grasp predict train"), shlex.join(["tr-grasp", "predict", *args]))
    if what == "evaluate":
        return evaluate(parse(EvaluateCfg, rest, prog="tr-grasp predict evaluate"))
    raise ConfigError(unknown_name("thing to do with predictors", what, ["train", "evaluate"]))


def train(cfg: TrainCfg, command: str) -> int:
    """Train one network."""
    # --help must not wait for torch.
    import torch

    from tr_grasp.prediction.courses import make_course
    from tr_grasp.prediction.training import LearnCfg, learn

    torch.set_num_threads(1)  # networks this small only wait for each other on several
    course = make_course(cfg.name, cfg.seed, cfg.tracks, lambda tracks, n: _bar(tracks, n, "data", "track"))
    decay = course.decay if cfg.decay is None else cfg.decay
    settling_n = course.settling_n if cfg.settle is None else cfg.settle
    settings = LearnCfg(cfg.epochs or course.epochs_n, cfg.seed, cfg.learning_rate, decay, settling_n=settling_n)
    folder = cfg.out or Path("runs/predict") / f"{cfg.name}-{cfg.seed}"
    bar: tqdm[Any] = tqdm(total=settings.epochs_n + settling_n, desc=cfg.name, unit="epoch", mininterval=_pause_s())

    def report(epoch: Epoch) -> None:
        bar.update(epoch.epoch - bar.n)
        bar.set_postfix_str(f"loss {epoch.loss:.3g}, validation {epoch.validation:.3g}", refresh=False)

    try:
        path = learn(
            cfg.name,
            course,
            settings,
            folder,
            provenance=provenance(command).as_json(),
            resume=cfg.resume,
            report=report,
        )
    except KeyboardInterrupt:
        print(f"stopped, all finished epochs saved; go on with: {command} --resume True", file=sys.stderr)
        return 130
    finally:
        bar.close()
    print(f"weights  {path}, {path.stat().st_size / 1e3:.0f} kB\nrecord   {path.with_suffix('.json')}")
    return 0


def evaluate(cfg: EvaluateCfg) -> int:
    """Judge predictors."""
    from tr_grasp.prediction.pictures import errors_picture
    from tr_grasp.prediction.registry import NEAREST_CLASS, PREDICTORS, make_predictor
    from tr_grasp.prediction.scores import Scores, score

    if not cfg.horizons or min(cfg.horizons) < 0:
        raise ConfigError(f"--horizons must be numbers of at least 0, got {cfg.horizons}")
    if not cfg.seeds or cfg.tracks < 1:
        raise ConfigError("--seeds and --tracks must leave something to judge")
    names = cfg.predictors or tuple(PREDICTORS)
    if cfg.thesis_loss:
        _print_thesis_losses(names, cfg)
        return 0
    tracks = _tracks(cfg)
    table: dict[tuple[str, str], list[Scores]] = {}
    for track, name in _bar(((t, n) for t in tracks for n in names), len(tracks) * len(names), "judging", "track"):
        motion_class = NEAREST_CLASS.get(track.label, "linear") if cfg.network_class == "auto" else cfg.network_class
        found = score(make_predictor(name, motion_class, cfg.weights), track, cfg.horizons, cfg.warm_up)
        if not len(found.errors_m):
            raise ConfigError(f"the track {track.label!r} is too short for horizons of {max(cfg.horizons):g} s.")
        table.setdefault((name, track.label), []).append(found)
    joined = {key: Scores.joined(found) for key, found in table.items()}
    rows = sorted(joined.items(), key=lambda item: [track.label for track in tracks].index(item[0][1]))
    print(f"horizons {', '.join(f'{h:g}' for h in cfg.horizons)} s\n")
    print(text_table(HEAD, [row(name, motion, scores) for (name, motion), scores in rows], left_n=2))
    make_folder(cfg.out)
    write_atomically(cfg.out / "scores.csv", csv_text(joined))
    write_atomically(cfg.out / "prediction.png", errors_picture(joined))
    print(f"\nscores   {cfg.out / 'scores.csv'}\npicture  {cfg.out / 'prediction.png'}")
    return 0


def row(predictor: str, motion: str, scores: Scores) -> tuple[str, ...]:
    """The cells of ``HEAD``."""
    import numpy as np

    return (
        motion,
        predictor,
        " / ".join(f"{value:.1f}" for value in scores.mean_mm),
        " / ".join(f"{value:.1f}" for value in scores.p95_mm),
        " / ".join(f"{100 * value:.0f}" for value in scores.within_68),
        " / ".join(f"{100 * value:.0f}" for value in scores.within_95),
        f"{np.median(scores.update_us):.0f}",
        f"{np.median(scores.predict_us):.0f}",
    )


def csv_text(table: dict[tuple[str, str], Scores]) -> str:
    """One line for each predictor, motion and horizon."""
    import numpy as np

    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    head = ["predictor", "motion", "horizon_s", "mean_mm", "p95_mm", "within_68", "within_95", "yaw_deg", "update_us"]
    writer.writerow([*head, "predictions_n"])
    for (predictor, motion), scores in table.items():
        for index, horizon in enumerate(scores.horizons_s):
            numbers = [scores.mean_mm, scores.p95_mm, scores.within_68, scores.within_95]
            yaw_deg = np.rad2deg(scores.yaw_errors_rad[:, index].mean())
            cells = [*(f"{values[index]:.5g}" for values in numbers), f"{yaw_deg:.3g}"]
            writer.writerow(
                [predictor, motion, horizon, *cells, f"{np.median(scores.update_us):.0f}", len(scores.errors_m)]
            )
    return stream.getvalue()


def _tracks(cfg: EvaluateCfg) -> list[Track]:
    from tr_grasp.prediction.motions import MOTIONS
    from tr_grasp.prediction.tracks import SensorCfg, generated_tracks, read_track

    if cfg.track is not None:
        return [read_track(cfg.track)]
    sensor = SensorCfg(cfg.rate, cfg.noise, yaw_noise_rad=0.0, lost_share=cfg.lost)
    return [
        track
        for kind in cfg.motions or tuple(MOTIONS)
        for seed in cfg.seeds
        for track in generated_tracks(kind, cfg.tracks, speed_m_s=cfg.speed, seed=seed, sensor=sensor)
    ]


def _print_thesis_losses(names: Sequence[str], cfg: EvaluateCfg) -> None:
    from tr_grasp.prediction.datasets import THESIS_MOTIONS
    from tr_grasp.prediction.registry import make_predictor
    from tr_grasp.prediction.scores import thesis_loss

    cases = [(name, motion, seed) for name in names for motion in THESIS_MOTIONS for seed in cfg.seeds]
    losses: dict[tuple[str, str], list[float]] = {}
    for name, motion, seed in _bar(cases, len(cases), "thesis losses", "case"):
        make = partial(make_predictor, name, motion, cfg.weights)
        losses.setdefault((name, motion), []).append(thesis_loss(make, motion, cfg.tracks, seed, cfg.warm_up))
    print("thesis' loss [m²], one number a seed\n")
    cells = [(name, motion, *(f"{loss:.2g}" for loss in found)) for (name, motion), found in losses.items()]
    print(text_table(("predictor", "motion", *(f"seed {seed}" for seed in cfg.seeds)), cells, left_n=2))


def _bar(items: Iterable[Any], n: int, what: str, unit: str) -> Iterable[Any]:
    return tqdm(items, total=n, desc=what, unit=unit, mininterval=_pause_s())


def _pause_s() -> float:
    # A log file is not a terminal: there, every refresh is a line of its own.
    return 0.2 if sys.stderr.isatty() else 10.0
