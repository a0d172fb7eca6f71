"""One trial of Task II as data: where the path lies, how the target stands on it, what stands beside it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import torch

from tr_grasp.configs.dynamic import DYNAMIC_OBJECTS, MORE_MOTIONS, THESIS_MOTIONS
from tr_grasp.envs.dynamic_grasp.obstacles import Line, Standing, draw_obstacles
from tr_grasp.errors import ConfigError, unknown_name
from tr_grasp.prediction.motions import Motion, sample_motion

DYNAMIC_MOTIONS = (*THESIS_MOTIONS, *MORE_MOTIONS)
KINDS = {"linear_obstacles": "linear", "linear_slab": "linear"}
"""Motions that are another one with something in the way."""
NOT_DRAWN = "speed_m_s"


@dataclass(frozen=True)
class Trial:
    """What is random in a trial; the same for every method and speed.

    Attributes:
        motion: Which case of the benchmark.
        object_name: The target.
        number, seed: Which of the trials of a list; they decide everything else.
        parameters: Of the function in ``tr_grasp.prediction.motions.MOTIONS``, but for the speed.
        obstacles: What stands beside the path.
        has_slab: A slab lies above the path.
    """

    motion: str
    object_name: str
    number: int
    seed: int
    parameters: Mapping[str, Any]
    obstacles: tuple[Standing, ...] = ()
    has_slab: bool = False

    @property
    def yaw_rad(self) -> float:
        """Heading of the target at first."""
        return float(self.parameters["yaw_rad"])

    @property
    def line(self) -> Line:
        """The middle of the path: for slab and obstacles, which only straight paths have."""
        return Line(float(self.parameters["distance_m"]), float(self.parameters["theta_rad"]))

    def path(self, speed_m_s: float) -> Motion:
        """The motion of the carrier's top, at a speed; a batch of one."""
        values = {name: torch.tensor([value], dtype=torch.float64) for name, value in self.parameters.items()}
        speed = torch.tensor([speed_m_s], dtype=torch.float64)
        return Motion(KINDS.get(self.motion, self.motion), {NOT_DRAWN: speed, **values})

    def as_json(self) -> dict[str, Any]:
        """Plain numbers and names."""
        return asdict(self)

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Trial:
        """What :meth:`as_json` gave.

        Raises:
            ConfigError: Something is missing or too much, or no such motion or object.
        """
        try:
            values = {**data, "obstacles": tuple(Standing(**one) for one in data["obstacles"])}
            trial = cls(**values)
        except (TypeError, KeyError) as error:
            raise ConfigError(f"this is not a trial of Task II ({error}): {str(dict(data))[:200]}") from error
        _known(trial.motion, trial.object_name)
        return trial


def make_trial(motion: str, object_name: str, number: int, seed: int = 0) -> Trial:
    """A trial by its number: equal arguments give the equal trial, and motions that start alike share their path.

    So ``linear``, ``linear_obstacles``, ``linear_slab``, ``varying_speed`` and the middle line of ``sinusoidal`` are
    the same lines with the same headings, as in the thesis' lists.

    Raises:
        ConfigError: No such motion or object, or a negative number or seed.
    """
    _known(motion, object_name)
    if number < 0 or seed < 0:
        raise ConfigError(f"the number and the seed of a trial must not be negative, got {number} and {seed}.")
    words = [seed, DYNAMIC_OBJECTS.index(object_name), number]  # type: ignore[arg-type]
    generator = torch.Generator().manual_seed(int(np.random.SeedSequence(words).generate_state(1)[0]))
    path = sample_motion(KINDS.get(motion, motion), 1, speed_m_s=1.0, generator=generator)
    parameters = {name: value[0].tolist() for name, value in path.parameters.items() if name != NOT_DRAWN}
    trial = Trial(motion, object_name, number, seed, parameters, has_slab=motion == "linear_slab")
    if motion != "linear_obstacles":
        return trial
    obstacles = draw_obstacles(trial.line, object_name, trial.yaw_rad, np.random.default_rng([*words, 1]))
    return Trial(motion, object_name, number, seed, parameters, obstacles)


def _known(motion: str, object_name: str) -> None:
    if motion not in DYNAMIC_MOTIONS:
        raise ConfigError(unknown_name("motion", motion, DYNAMIC_MOTIONS))
    if object_name not in DYNAMIC_OBJECTS:
        raise ConfigError(unknown_name("object", object_name, DYNAMIC_OBJECTS))
