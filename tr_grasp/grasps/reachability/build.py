"""Build a reachability field: labels by inverse kinematics, the border between them, and a network fitted to both."""

from __future__ import annotations

import io
import time
import zipfile
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from tr_grasp.errors import GraspError
from tr_grasp.files import write_atomically
from tr_grasp.grasps.reachability.field import ReachabilityField, robot_key
from tr_grasp.grasps.reachability.labels import Domain, Labeller, border_distance, border_poses
from tr_grasp.grasps.reachability.network import ArmShape, MarginNet
from tr_grasp.motion import Kinematics
from tr_grasp.robots import RobotSpec

Array = NDArray[np.floating]
ROUND_N = 4000
FARTHEST_M = 0.4
"""Distances beyond this are all the same."""
SIGN_SCALE_M = 0.02
"""Margins of this size are nearly sure of their sign."""
SIGN_WEIGHT = 0.3
Progress = Callable[[str, int, int], None]
"""Called with the name of a stage, how much of it is done, and of how much."""


@dataclass(frozen=True)
class ReachabilityCfg:
    """How a reachability field is made."""

    poses_n: int = 400_000
    """Poses drawn and labelled; about one in nine also gives a pose on the border."""

    step_m: float = 0.15
    """Typical way from a pose on which the border is looked for; turns are as long at 0.3 m per rad."""

    halvings_n: int = 6
    """The border is found to ``step_m / 2**halvings_n``."""

    floor_m: float = -0.005
    """Height of the floor in the base frame."""

    width: int = 128
    """Of the three layers of the network."""

    epochs_n: int = 30
    """Passes over the labels."""

    batch_n: int = 2048
    """Poses in a step."""

    learning_rate: float = 3e-3
    """Of Adam at the start; it falls to zero along a cosine."""

    seed: int = 0
    """Of poses, ways and first weights."""

    def __post_init__(self) -> None:
        """Refuse what has no meaning.

        Raises:
            GraspError: A count or length that is not positive.
        """
        for name in ("poses_n", "step_m", "halvings_n", "width", "epochs_n", "batch_n", "learning_rate"):
            if not getattr(self, name) > 0:
                raise GraspError(f"{name} must be positive, got {getattr(self, name)}.")


@dataclass(frozen=True, eq=False)
class Labels:
    """What inverse kinematics said.

    Attributes:
        T_base_tcp: (n, 4, 4) poses.
        is_reachable: (n,).
        border: (m, 4, 4) poses between reachable and not.
        seconds: Spent so far, interruptions left out.
    """

    T_base_tcp: Array
    is_reachable: NDArray[np.bool_]
    border: Array
    seconds: float = 0.0


def build_reachability(
    spec: RobotSpec,
    cfg: ReachabilityCfg | None = None,
    *,
    progress: Progress = lambda stage, done, total: None,
    resume_file: Path | None = None,
) -> ReachabilityField:
    """Labels, border, network; see :class:`ReachabilityCfg`.

    Args:
        spec: The arm with its hand, whose fingers are open.
        cfg: How.
        progress: Told how far it is.
        resume_file: Where labels are kept while they are made; those of the same build are taken up.

    Raises:
        GraspError: Nothing is reachable, or everything is.
        StorageError: The labels cannot be kept.
    """
    cfg = cfg or ReachabilityCfg()
    kinematics = Kinematics(spec)
    domain = Domain.of(kinematics)
    labels = label_poses(spec, kinematics, domain, cfg, progress, resume_file)
    if not len(labels.border):
        share = 100 * labels.is_reachable.mean()
        raise GraspError(f"{share:.0f} % of the poses around {spec.name!r} are reachable: there is no border to learn.")
    started = time.monotonic()
    network, statistics = _fit(ArmShape.of(kinematics), labels, cfg, progress)
    statistics |= {
        "poses_n": len(labels.is_reachable),
        "border_n": len(labels.border),
        "reachable_share": round(float(labels.is_reachable.mean()), 4),
        "labels_s": round(labels.seconds, 1),
        "fit_s": round(time.monotonic() - started, 1),
    }
    return ReachabilityField(spec.name, robot_key(spec), domain, network, asdict(cfg), statistics)


def label_poses(
    spec: RobotSpec, kinematics: Kinematics, domain: Domain, cfg: ReachabilityCfg, progress: Progress, file: Path | None
) -> Labels:
    """Random poses with labels, and poses on the border, in rounds that depend on their number alone."""
    key = f"{robot_key(spec)} {[getattr(cfg, name) for name in ('step_m', 'halvings_n', 'floor_m', 'seed')]}"
    labels, label = _take_up(file, key), Labeller(kinematics, cfg.floor_m)
    while (done := len(labels.is_reachable)) < cfg.poses_n:
        progress("labels", done, cfg.poses_n)
        started, rng = time.monotonic(), np.random.default_rng([cfg.seed, done // ROUND_N])
        T = domain.sample(ROUND_N, rng)
        found = label(T)
        border = border_poses(T, found, cfg.step_m, cfg.halvings_n, label, rng)
        labels = Labels(
            np.concatenate([labels.T_base_tcp, T]),
            np.append(labels.is_reachable, found),
            np.concatenate([labels.border, border]),
            labels.seconds + time.monotonic() - started,
        )
        if (done // ROUND_N) % 10 == 9 or done + ROUND_N >= cfg.poses_n:
            _keep(file, key, labels)
    progress("labels", cfg.poses_n, cfg.poses_n)
    return labels


def _fit(
    shape: ArmShape, labels: Labels, cfg: ReachabilityCfg, progress: Progress
) -> tuple[MarginNet, dict[str, float]]:
    """A network, and how far it is from the distances that it was fitted to."""
    T = np.concatenate([labels.T_base_tcp, labels.border])
    signed = np.where(labels.is_reachable, 1.0, -1.0) * border_distance(
        labels.T_base_tcp, labels.border, shape.is_symmetric, FARTHEST_M
    )
    poses = torch.from_numpy(T.astype(np.float32))
    target = torch.from_numpy(np.concatenate([signed, np.zeros(len(labels.border))]).astype(np.float32))
    torch.manual_seed(cfg.seed)
    network, generator = MarginNet(shape, cfg.width), torch.Generator().manual_seed(cfg.seed)
    features = shape.features(poses[:, :3, 3], poses[:, :3, :3])
    network.mean.copy_(features.mean(0))
    network.scale.copy_(features.std(0).clamp_min(1e-3))
    optimiser = torch.optim.Adam(network.parameters(), cfg.learning_rate)
    batches_n = -(-len(poses) // cfg.batch_n)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, cfg.learning_rate, total_steps=cfg.epochs_n * batches_n)
    for epoch in range(cfg.epochs_n):
        progress("epochs", epoch, cfg.epochs_n)
        for rows in torch.randperm(len(poses), generator=generator).split(cfg.batch_n):
            optimiser.zero_grad()
            _loss(network(features[rows]), target[rows]).backward()
            optimiser.step()
            schedule.step()
    progress("epochs", cfg.epochs_n, cfg.epochs_n)
    with torch.no_grad():
        error = (network.eval()(features) - target).abs()
    return network, {"mean_error_m": round(float(error.mean()), 4)}


def _loss(margin: Tensor, target: Tensor) -> Tensor:
    """Margins near distances, and the right sign near zero, where distances say little about it."""
    distance = nn.functional.smooth_l1_loss(margin, target, beta=0.02) / SIGN_SCALE_M
    off_border = target != 0
    sign = nn.functional.binary_cross_entropy_with_logits(
        margin[off_border] / SIGN_SCALE_M, (target[off_border] > 0).float()
    )
    return distance + SIGN_WEIGHT * sign


def _keep(file: Path | None, key: str, labels: Labels) -> None:
    if file is None:
        return
    content = io.BytesIO()
    np.savez(
        content, key=key, T_base_tcp=labels.T_base_tcp.astype(np.float32), is_reachable=labels.is_reachable,
        border=labels.border.astype(np.float32), seconds=labels.seconds,
    )  # fmt: skip
    write_atomically(file, content.getvalue())


def _take_up(file: Path | None, key: str) -> Labels:
    nothing = Labels(np.zeros((0, 4, 4), np.float32), np.zeros(0, bool), np.zeros((0, 4, 4), np.float32))
    if file is None or not file.is_file():
        return nothing
    try:
        with np.load(file, allow_pickle=False) as kept:
            if str(kept["key"]) != key:
                return nothing
            return Labels(kept["T_base_tcp"], kept["is_reachable"], kept["border"], float(kept["seconds"]))
    # Labels can be made again, so a file that cannot be read is no reason to stop.
    except (OSError, ValueError, KeyError, zipfile.BadZipFile):
        return nothing
