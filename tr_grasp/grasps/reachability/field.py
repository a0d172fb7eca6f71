"""How far a tool pose is inside or outside of what an arm reaches: a smooth function, as a file."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray
from torch import Tensor

from tr_grasp.errors import GraspError, MotionError, unknown_name
from tr_grasp.grasps.reachability.labels import Domain
from tr_grasp.grasps.reachability.network import ArmShape, MarginNet
from tr_grasp.grasps.robot_model import model_text
from tr_grasp.grasps.tensor_file import FileKind
from tr_grasp.robots import RobotSpec

Array = NDArray[np.floating]
FILE = FileKind("reachability field", "tr_grasp.reachability.1", "build", "tr-grasp reachability build")
ENDING = ".reachability.safetensors"
_SHIPPED = Path(__file__).parent / "fields"


@dataclass(frozen=True, eq=False)
class ReachabilityField:
    """A signed margin over tool poses: positive where the arm reaches them without touching itself or the floor.

    Away from zero it is about the distance to the border in metres, a turn of one radian counting as 0.3 m; it comes
    from a network that was fitted to labels of inverse kinematics, so it is smooth, and a guess near the border.

    Attributes:
        robot: Name of the arm.
        robot_key: :func:`robot_key` of the arm that it was made for.
        domain: Where labels were drawn; nothing is known outside.
        network: What gives the margins.
        settings: What it was made with.
        statistics: How it was made and how well it fits.
    """

    robot: str
    robot_key: str
    domain: Domain
    network: MarginNet = field(repr=False)
    settings: Mapping[str, Any] = field(default_factory=dict)
    statistics: Mapping[str, Any] = field(default_factory=dict)

    @torch.inference_mode()
    def values(self, T_base_tcp: ArrayLike) -> Array:
        """(*batch,) margins [m] of tool poses (*batch, 4, 4).

        Raises:
            MotionError: NaN or another shape.
        """
        position, rotation, batch = _tensors(T_base_tcp)
        return self._margins(position, rotation).numpy().astype(float).reshape(batch)

    def gradient(self, T_base_tcp: ArrayLike) -> Array:
        """(*batch, 6): change of the margin by shifts [m/m] over turns about the tool's origin [m/rad], base axes.

        Raises:
            MotionError: NaN or another shape.
        """
        position, rotation, batch = _tensors(T_base_tcp)
        twist = torch.zeros(len(position), 6, requires_grad=True)
        turned = rotation + torch.linalg.cross(twist[:, 3:, None].expand(-1, -1, 3), rotation, dim=1)
        margins = self._margins(position + twist[:, :3], turned)
        (slope,) = torch.autograd.grad(margins.sum(), twist)
        return slope.numpy().astype(float).reshape(*batch, 6)

    def require_for(self, spec: RobotSpec) -> ReachabilityField:
        """Itself, if it was made for this arm, hand included.

        Raises:
            GraspError: It was made for another.
        """
        if robot_key(spec) != self.robot_key:
            raise GraspError(
                f"this reachability field was made for another model of {self.robot!r} than {spec.name!r} is now;"
                f" build it again: tr-grasp reachability build {spec.name}."
            )
        return self

    def save(self, path: str | Path) -> Path:
        """Write it in one step.

        Raises:
            StorageError: It could not be written.
        """
        facts = {
            "robot": self.robot,
            "robot_key": self.robot_key,
            "domain": asdict(self.domain),
            "shape": asdict(self.network.shape),
            "settings": dict(self.settings),
            "statistics": dict(self.statistics),
        }
        return FILE.write_network(path, self.network, facts)

    @classmethod
    def load(cls, path: str | Path) -> ReachabilityField:
        """Read a file that :meth:`save` wrote.

        Raises:
            GraspError: No such file, one of another kind or version, or a damaged one.
        """
        weights, facts = FILE.read_network(path)
        shape = {**facts["shape"], "wrist_tcp_m": tuple(facts["shape"]["wrist_tcp_m"])}
        network = MarginNet(ArmShape(**shape), len(weights["layers.0.bias"]))
        network.load_state_dict(weights)
        return cls(
            facts["robot"], facts["robot_key"], Domain(**facts["domain"]), network.eval(), facts["settings"],
            facts["statistics"],
        )  # fmt: skip

    def _margins(self, position: Tensor, rotation: Tensor) -> Tensor:
        return self.network(self.network.shape.features(position, rotation))


@lru_cache(maxsize=16)  # a method asks at every ranking, and hashing takes 5 ms
def robot_key(spec: RobotSpec) -> str:
    """What tells models of arms apart: a hash of the URDF, hand included, wherever its meshes are installed."""
    return hashlib.sha256(model_text(spec).encode()).hexdigest()[:32]


def shipped_fields() -> tuple[str, ...]:
    """Arms whose fields come with the package."""
    return tuple(sorted(path.name.removesuffix(ENDING) for path in _SHIPPED.glob(f"*{ENDING}")))


def reachability_field(name_or_file: str | Path) -> ReachabilityField:
    """The field of an arm that comes with the package, or of a file.

    Raises:
        GraspError: Neither, or a damaged file.
    """
    if str(name_or_file) in shipped_fields():
        return ReachabilityField.load(_SHIPPED / f"{name_or_file}{ENDING}")
    if Path(name_or_file).is_file() or Path(name_or_file).suffix:
        return ReachabilityField.load(name_or_file)
    sentence = unknown_name("arm with a shipped reachability field", str(name_or_file), shipped_fields())
    raise GraspError(f"{sentence} Others: tr-grasp reachability build ROBOT, then name its file.")


def _tensors(T_base_tcp: ArrayLike) -> tuple[Tensor, Tensor, tuple[int, ...]]:
    T = np.asarray(T_base_tcp, np.float32)
    if T.ndim < 2 or T.shape[-2:] != (4, 4) or not np.isfinite(T).all():
        raise MotionError(f"T_base_tcp must be finite poses (*batch, 4, 4), got an array of shape {T.shape}.")
    flat = torch.from_numpy(np.ascontiguousarray(T.reshape(-1, 4, 4)))
    return flat[:, :3, 3], flat[:, :3, :3], T.shape[:-2]
